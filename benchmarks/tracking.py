"""Tracking of people as they film themselves: recorded clips made small, large, turned, bearded, and gone for a while.

    python benchmarks/tracking.py [--corpora ../shared/corpora] [--clips 4] [--case waist ...] [--video FILE ...]

Every clip is pasted into other pictures, encoded, and tracked. Prints a JSON object per case: the share of frames in
which a face was seen (of those that show it), the correlation of opening and width with the track of the clip as it is,
and frames per second of wall time and of CPU time, decoding included, without and with mouth pictures. With
``--video``, the files are tracked as they are.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.types import Track
from lipmotion_faces.tracking.face_mesh import FaceMesh
from lipmotion_faces.tracking.landmarks import EYE_CORNERS, JAW_POINTS, LIP_POINTS, TRACKED_POINTS
from lipmotion_faces.tracking.track import track

Image = NDArray[np.uint8]
Array = NDArray[np.float64]

EYES = [TRACKED_POINTS.index(index) for index in EYE_CORNERS]
JAW = [TRACKED_POINTS.index(index) for index in JAW_POINTS]
CORNERS = [TRACKED_POINTS.index(index) for index in (61, 291)]
LOWER_LIP = TRACKED_POINTS.index(17)
INNER_EYES = [TRACKED_POINTS.index(index) for index in (133, 362)]
LIPS = [TRACKED_POINTS.index(index) for index in LIP_POINTS]


@dataclass(frozen=True)
class Clip:
    """A recorded clip: its pictures, the points of its face in each, and its track."""

    name: str
    frames: list[Image]
    points: list[Array]
    usual: Track


@dataclass(frozen=True)
class Case:
    """Pictures made of a clip, which of its frames each shows, whether the face is in it, and the stated rotation."""

    frames: list[Image]
    order: list[int]
    shown: NDArray[np.bool_]
    rotation: int = 0


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--corpora", type=Path, default=Path("../shared/corpora"))
    parser.add_argument("--clips", type=int, default=4, help="half of them of GRID s1, the others of other speakers")
    parser.add_argument("--case", action="append", choices=sorted(CASES))
    parser.add_argument("--video", action="append", type=Path, help="track these files as they are")
    options = parser.parse_args()
    if options.video:
        for path in options.video:
            print(json.dumps({"video": path.name, **tracked(path)[1]}), flush=True)
        return
    clips = [read_clip(path) for path in clip_files(options.corpora, options.clips)]
    for name in options.case or CASES:
        rows = [figures(clip, CASES[name](clip)) for clip in clips]
        keys = dict.fromkeys(key for row in rows for key in row)
        print(json.dumps({"case": name, **{key: summary([row[key] for row in rows if key in row]) for key in keys}}))


def clip_files(corpora: Path, count: int) -> list[Path]:
    """Return clips of GRID s1 (validation list) and of other speakers, in turn."""
    names = (corpora / "grid-s1" / "val.txt").read_text().split()
    own = [corpora / "grid-s1" / "clips" / f"{name}.mkv" for name in names]
    others = sorted((corpora / "grid-others").glob("*.mpg"))
    return [path for pair in zip(own, others, strict=False) for path in pair][:count]


def read_clip(path: Path) -> Clip:
    """Return a clip with its points, as the mesh finds them in its own pictures."""
    with av.open(str(path)) as container:
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    with FaceMesh() as mesh:
        points = [mesh.faces(frame)[0] for frame in frames]
    return Clip(path.stem, frames, points, track(path, crops=False))


def figures(clip: Clip, case: Case) -> dict[str, float]:
    """Return the figures of one case of one clip."""
    with tempfile.TemporaryDirectory() as folder:
        found, speed = tracked(write(Path(folder) / "case.mp4", case))
    if found is None:
        return {"refused": 1.0, "seen": 0.0}
    order = case.order[: len(found.seen)]
    both = found.seen[: len(order)] & clip.usual.seen[order]
    alike = {
        name: float(np.corrcoef(found.motion[name][: len(order)][both], clip.usual.motion[name][order][both])[0, 1])
        for name in ("opening", "width")
    }
    return {
        "refused": 0.0,
        "seen": float(found.seen[: len(case.shown)][case.shown[: len(found.seen)]].mean()),
        **alike,
        **{key: value for key, value in speed.items() if key.startswith("frames")},
    }


def tracked(path: Path) -> tuple[Track | None, dict[str, float | str]]:
    """Return the track of a video, and its speed."""
    result, speed = None, {}
    for crops in (True, False):
        wall_s, cpu_s = time.perf_counter(), time.process_time()
        try:
            result = track(path, crops=crops)
        except InputError as error:
            return None, {"refused": str(error)}
        wall_s, cpu_s = time.perf_counter() - wall_s, time.process_time() - cpu_s
        kind = "crops" if crops else "no crops"
        speed |= {f"frames/s, {kind}": len(result.seen) / wall_s, f"frames/CPU-s, {kind}": len(result.seen) / cpu_s}
    return result, {"seen": float(result.seen.mean()), "notes": "; ".join(result.notes), **speed}


def summary(values: Sequence[float]) -> float:
    """Return the mean."""
    return round(float(np.mean(values)), 4)


def write(path: Path, case: Case) -> Path:
    """Encode pictures as a phone does, H.264 and 4:2:0; in one thread, as the bytes depend on load otherwise."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=25, options={"crf": "18", "preset": "veryfast", "threads": "1"})
        stream.height, stream.width = case.frames[0].shape[:2]
        stream.pix_fmt, stream.codec_context.time_base = "yuv420p", Fraction(1, 25)
        if case.rotation:
            stream.set_display_rotation(case.rotation)
        for n, image in enumerate(case.frames):
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="rgb24")
            frame.pts, frame.time_base = n, Fraction(1, 25)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def eyes_px(points: Array) -> float:
    """Return the distance between the outer eye corners."""
    return float(np.linalg.norm(points[EYES[0], :2] - points[EYES[1], :2]))


def room(height: int, width: int) -> Image:
    """Return an empty room: patches of furniture, and a little texture."""
    draw = np.random.default_rng(0)
    patches = draw.integers(40, 200, (6, 9, 3)).astype(np.uint8)
    picture = cv2.resize(patches, (width, height), interpolation=cv2.INTER_NEAREST)
    noise = cv2.resize(draw.normal(0, 6, (height // 4, width // 4)), (width, height))
    return np.clip(cv2.GaussianBlur(picture, (0, 0), width / 200) + noise[..., None], 0, 255).astype(np.uint8)


def placed(
    clip: Clip, size: tuple[int, int], eyes: float, *, at: Callable[[int], tuple[float, float]], roll_deg: float = 0.0
) -> list[Image]:
    """Return the clip in larger pictures, with a body that goes on to the lower edge, in a room.

    size : width and height, px
    eyes : distance between the eyes, px
    at   : where the point between the eyes is in frame n, as shares of width and height
    """
    width, height = size
    back = room(height, width)
    scale = eyes / eyes_px(clip.points[0])
    middle = clip.points[0][EYES, :2].mean(axis=0)
    way = cv2.INTER_AREA if scale < 0.5 else cv2.INTER_CUBIC
    pictures = []
    for n, frame in enumerate(clip.frames):
        x, y = at(n)
        turn = cv2.getRotationMatrix2D(tuple(middle), roll_deg, scale)
        turn[:, 2] += np.array([x * width, y * height]) - middle
        body = cv2.copyMakeBorder(frame, 0, 6 * frame.shape[0], 0, 0, cv2.BORDER_REPLICATE)
        soft = np.zeros(body.shape[:2], np.float32)
        soft[:, 12:-12] = 1
        soft = cv2.warpAffine(cv2.blur(soft, (25, 25)), turn, (width, height))[..., None]
        shown = cv2.warpAffine(body, turn, (width, height), flags=way, borderMode=cv2.BORDER_REPLICATE)
        pictures.append((soft * shown + (1 - soft) * back).astype(np.uint8))
    return pictures


def swaying(x: float, y: float) -> Callable[[int], tuple[float, float]]:
    """Return positions of somebody who does not sit quite still."""
    return lambda n: (x + 0.01 * np.sin(n / 9), y + 0.008 * np.sin(n / 7))


def whole(frames: list[Image], rotation: int = 0) -> Case:
    """Return the case of pictures that all show the face."""
    return Case(frames, list(range(len(frames))), np.ones(len(frames), bool), rotation)


def waist(clip: Clip, eyes: float = 65.0) -> Case:
    """Return somebody filmed to the waist at 1280 × 720."""
    return whole(placed(clip, (1280, 720), eyes, at=swaying(0.55, 0.27)))


def four_k(clip: Clip) -> Case:
    """Return somebody filmed to the waist at 3840 × 2160 (the first 40 frames, as encoding takes long)."""
    part = Clip(clip.name, clip.frames[:40], clip.points[:40], clip.usual)
    return whole(placed(part, (3840, 2160), 195.0, at=swaying(0.45, 0.3)))


def phone(clip: Clip) -> Case:
    """Return a phone's video, 1080 × 1920 upright, stored sideways with a rotation in the metadata."""
    upright = placed(clip, (1080, 1920), 110.0, at=swaying(0.5, 0.35))
    return whole([np.rot90(frame, -1) for frame in upright], rotation=90)


def away(clip: Clip) -> Case:
    """Return somebody who walks out of a picture of 1280 × 720 and comes back from the other side.

    The clip is shown to its end, backwards and to its end again; the person is away around the turn to backwards.
    """
    count = len(clip.frames)
    order = [*range(count), *reversed(range(count)), *range(count)]
    out, back = count - 20, count + 30

    def at(n: int) -> tuple[float, float]:
        if n < back:
            return 0.5 + 0.025 * max(0, n - out), 0.3
        return min(0.5, -0.15 + 0.025 * (n - back)), 0.3

    longer = Clip(clip.name, [clip.frames[n] for n in order], clip.points, clip.usual)
    shown = np.array([0.08 < at(n)[0] < 0.92 for n in range(len(order))])
    return Case(placed(longer, (1280, 720), 65.0, at=at), order, shown)


def rolled(clip: Clip) -> Case:
    """Return a head on one side."""
    return whole(placed(clip, (1280, 720), 65.0, at=swaying(0.5, 0.4), roll_deg=25.0))


def turned(clip: Clip, yaw_deg: float = 30.0) -> Case:
    """Return a head that turns to one side and back, as if its picture were on a sphere."""
    frames = []
    for n, (frame, points) in enumerate(zip(clip.frames, clip.points, strict=True)):
        angle = np.deg2rad(yaw_deg) * np.sin(np.pi * n / len(clip.frames))
        frames.append(on_sphere(frame, points, angle))
    turned_clip = Clip(clip.name, frames, clip.points, clip.usual)
    return whole(placed(turned_clip, (1280, 720), 65.0, at=swaying(0.5, 0.35)))


def on_sphere(frame: Image, points: Array, angle: float) -> Image:
    """Return a picture with its head turned by an angle about the vertical axis."""
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    (x, y), radius = (low + high) / 2, 0.62 * float((high - low).max())
    rows, columns = np.mgrid[: frame.shape[0], : frame.shape[1]].astype(np.float32)
    across, down = (columns - x) / radius, (rows - y) / (1.15 * radius)
    inside = across**2 + down**2 < 1
    depth = np.sqrt(np.clip(1 - across**2 - down**2, 0, None))
    source = np.where(inside, across * np.cos(angle) - depth * np.sin(angle), across)
    behind = inside & (across * np.sin(angle) + depth * np.cos(angle) < 0.05)
    source = np.where(behind, across, source)
    map_x = (x + radius * source).astype(np.float32)
    turned_frame: Image = cv2.remap(frame, map_x, rows, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    return turned_frame


def bearded(clip: Clip) -> Case:
    """Return a dark beard around the mouth, and glasses with thick rims."""
    frames = []
    draw = np.random.default_rng(0)
    hair = draw.normal(45, 18, clip.frames[0].shape).clip(0, 255).astype(np.uint8)
    for frame, points in zip(clip.frames, clip.points, strict=True):
        unit, flat = eyes_px(points), points[:, :2]
        beard = np.zeros(frame.shape[:2], np.uint8)
        jaw = np.concatenate([flat[JAW], flat[CORNERS] + [[-0.25 * unit, -0.1 * unit], [0.25 * unit, -0.1 * unit]]])
        cv2.fillConvexPoly(beard, cv2.convexHull(jaw.astype(np.int32)), 255)
        cv2.fillConvexPoly(beard, cv2.convexHull(flat[LIPS].astype(np.int32)), 0)
        soft = cv2.GaussianBlur(beard, (0, 0), 0.02 * unit)[..., None] / 255 * 0.9
        image = (soft * hair + (1 - soft) * frame).astype(np.uint8)
        for outer, inner in zip(EYES, INNER_EYES, strict=True):
            middle = (flat[outer] + flat[inner]) / 2
            axes = (round(0.24 * unit), round(0.19 * unit))
            cv2.ellipse(image, middle.astype(int).tolist(), axes, 0, 0, 360, (20, 18, 18), max(1, round(0.045 * unit)))
        bridge = [flat[index].astype(int).tolist() for index in INNER_EYES]
        cv2.line(image, *bridge, (20, 18, 18), max(1, round(0.04 * unit)))
        frames.append(image)
    return whole(placed(Clip(clip.name, frames, clip.points, clip.usual), (1280, 720), 65.0, at=swaying(0.5, 0.3)))


CASES: dict[str, Callable[[Clip], Case]] = {
    "as recorded, 360x288": lambda clip: whole(clip.frames),
    "waist, 1280x720, eyes 65 px": waist,
    "far, 1280x720, eyes 40 px": lambda clip: waist(clip, 40.0),
    "very far, 1280x720, eyes 25 px": lambda clip: waist(clip, 25.0),
    "near, 1280x720, eyes 180 px": lambda clip: waist(clip, 180.0),
    "4K, eyes 195 px": four_k,
    "phone, 1080x1920, rotated by metadata": phone,
    "leaves and returns": away,
    "rolled by 25 degrees": rolled,
    "turned by up to 30 degrees": turned,
    "beard and glasses": bearded,
}
"""Name of a case, and the function that makes it of a clip."""


if __name__ == "__main__":
    main()
