"""Size, error and speed of the store of motion.

    python benchmarks/motion_store.py CORPUS --grid ../shared/corpora/grid-s1 [--only tracks paper]
        [--clips 150] [--mesh FILE.npz] [--minutes 40]

CORPUS is a prepared corpus. Prints one JSON object per case. ``paper`` is the scale of Minnis &
Breen 2000, 2,000 vertices at 30 Hz for 40 minutes, made of the clips in --grid (``paper_scale`` says how); --mesh keeps
their tracked meshes for the next time.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
import warnings
import zlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from lipmotion.corpora.store import Corpus
from lipmotion.motion.motion_store import compress, lip_tolerance, motion_store_arrays, point_distances
from lipmotion.motion.resample import to_model_frames
from lipmotion.storage.archive import write_archive
from lipmotion.types import Channel
from lipmotion.vision.face_mesh import quiet_stderr
from lipmotion.vision.head_pose import without_head_motion
from lipmotion.vision.packages import import_face_mesh

Array = NDArray[Any]
POINTS, VERTICES, VIDEO_HZ, PAPER_HZ = 468, 2000, 25.0, 30.0
CORNERS = (61, 291)
PIECES, PIECE_S = 1000, 0.1


def main() -> None:
    """Print the figures of each case."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("--grid", type=Path, default=Path("../shared/corpora/grid-s1"))
    parser.add_argument("--only", nargs="*", default=["tracks", "paper"])
    parser.add_argument("--clips", type=int, default=150)
    parser.add_argument("--mesh", type=Path)
    parser.add_argument("--minutes", type=float, default=40)
    options = parser.parse_args()
    corpus = Corpus.open(options.corpus)
    names = corpus.names()[: options.clips]
    if "tracks" in options.only:
        for rate_hz in (VIDEO_HZ, 100.0):
            report(f"tracks at {rate_hz:g} Hz", *tracks(corpus, names, rate_hz))
    if "paper" in options.only:
        report("paper", *paper_scale(meshes(options.grid, options.mesh), options.minutes))


def tracks(corpus: Corpus, names: tuple[str, ...], rate_hz: float) -> tuple[Array, float, float, Array, list[Any]]:
    """Return the motion of the clips at a rate, that rate, the tolerance, the points, and the range of each clip."""
    found = [corpus.utterance(name).track for name in names]
    channels = found[0].motion.channels
    curves = [
        to_model_frames(t.motion.values, t.seen, t.motion.rate_hz, int(len(t.seen) / VIDEO_HZ * rate_hz), rate_hz)[0]
        for t in found
    ]
    values = np.concatenate(curves).astype(np.float32)
    return values, rate_hz, lip_tolerance(values, channels), point_groups(channels), ranges(curves)


def point_groups(channels: Sequence[Channel]) -> Array:
    """Return the number of the point that each channel belongs to [shape=(P,)].

    ``x_17``, ``y_17`` and ``z_17`` are one point; all other channels are each on their own.
    """
    names = [
        channel.name[2:] if channel.name.startswith(("x_", "y_", "z_")) else f" {channel.name}" for channel in channels
    ]
    numbers = {name: number for number, name in enumerate(dict.fromkeys(names))}
    return np.array([numbers[name] for name in names], np.intp)


def meshes(grid: Path, cache: Path | None) -> dict[str, Array]:
    """Return the face mesh of every frame of the clips, px [each shape=(T, 478, 3)]."""
    if cache is None or not cache.exists():
        found = {path.stem: mesh(path) for path in sorted((grid / "clips").glob("*.mkv"))}
        if cache is None:
            return found
        np.savez(cache, allow_pickle=False, **found)
    with np.load(cache, allow_pickle=False) as stored:
        return {name: stored[name] for name in stored}


def mesh(path: Path) -> Array:
    """Return all points of the face mesh in the frames that show a face."""
    rows = []
    with warnings.catch_warnings(), av.open(str(path)) as file, quiet_stderr():
        warnings.simplefilter("ignore")
        with import_face_mesh().FaceMesh(max_num_faces=1, refine_landmarks=True) as finder:
            for frame in file.decode(video=0):
                image = frame.to_ndarray(format="rgb24")
                height, width = image.shape[:2]
                faces = finder.process(image).multi_face_landmarks
                if faces:
                    rows.append(np.array([(p.x, p.y, p.z) for p in faces[0].landmark]) * (width, height, width))
    return np.array(rows, np.float32)


def paper_scale(clips: dict[str, Array], minutes: float) -> tuple[Array, float, float, Array, list[Any]]:
    """Return motion of 2,000 vertices, its rate, the tolerance, the points, and the range of each clip.

    The 468 points of the face mesh, tracked in real clips, without head motion, go from 25 to 30 Hz by the spline of
    the models. The other 1,532 vertices lie at random places in the triangles of the mesh: mixtures of three points
    that are weighted by their place. Such mixtures are smoother than tracked points; so each has noise of its own,
    white in time, as strong as the part of the tracked points' noise that their neighbours do not share: second
    differences over time of a point minus the mean of its neighbours. After the last clip the first follows, with other
    noise.
    """
    draw = np.random.default_rng(0)
    edges = [tuple(edge) for edge in import_face_mesh().FACEMESH_TESSELATION]
    near = np.zeros((POINTS, POINTS), bool)
    for one, two in edges:
        near[one, two] = near[two, one] = True
    triangles = [(a, b, int(c)) for a, b in edges if a < b for c in np.flatnonzero(near[a] & near[b]) if c > b]
    chosen = draw.integers(0, len(triangles), VERTICES - POINTS)
    shares = draw.dirichlet((1, 1, 1), VERTICES - POINTS).astype(np.float32)
    mixing = np.zeros((VERTICES, POINTS), np.float32)
    mixing[np.arange(POINTS), np.arange(POINTS)] = 1
    for row, (triangle, share) in enumerate(zip(chosen, shares, strict=True), POINTS):
        mixing[row, list(triangles[triangle])] = share
    heads = [without_head_motion(points * (1.0, -1, -1), range(478))[:, :POINTS] for points in clips.values()]
    rough = near / near.sum(axis=1, keepdims=True)
    shown = heads[:40]
    own = np.concatenate([np.diff(h - np.einsum("pq,tqc->tpc", rough, h), 2, axis=0) for h in shown])
    noise = np.sqrt(np.square(own).mean(axis=0) / 6 / (1 + 1 / near.sum(axis=1))[:, None])
    spread = np.sqrt(np.square(mixing) @ np.square(noise))  # of the mixtures
    added = np.sqrt(np.maximum(np.square(mixing @ noise) - np.square(spread), 0)).astype(np.float32)
    curves: list[Array] = []
    while sum(map(len, curves)) < minutes * 60 * PAPER_HZ:
        head = heads[len(curves) % len(heads)].reshape(-1, POINTS * 3)
        frames = int(len(head) / VIDEO_HZ * PAPER_HZ)
        moved = to_model_frames(head, np.ones(len(head), bool), VIDEO_HZ, frames, PAPER_HZ)[0].astype(np.float32)
        vertices = np.einsum("vp,tpc->tvc", mixing, moved.reshape(-1, POINTS, 3), optimize=True)
        vertices += draw.standard_normal(vertices.shape, np.float32) * added
        curves.append(vertices.reshape(frames, VERTICES * 3))
    widths = [np.linalg.norm(h[:, CORNERS[0]] - h[:, CORNERS[1]], axis=1) for h in heads]
    tolerance = 0.005 * float(np.median(np.concatenate(widths)))
    show({"paper": "noise", "added, % of lip width": percent(np.median(added[POINTS:]), tolerance)})
    return np.concatenate(curves), PAPER_HZ, tolerance, np.repeat(np.arange(VERTICES), 3), ranges(curves)


def report(case: str, values: Array, rate_hz: float, tolerance: float, groups: Array, kept: list[Any]) -> None:
    """Print sizes, errors and times of one table of motion."""
    start = time.perf_counter()
    store = compress(values, rate_hz, tolerance, groups=groups, kept=kept)
    encode_s = time.perf_counter() - start
    size = archived(motion_store_arrays(store))
    zipped = deflated(values, np.float32)
    start, distances = time.perf_counter(), []
    for first in range(0, len(values), 2000):
        restored = store.rows(slice(first, first + 2000))
        distances.append(point_distances(restored - values[first : first + 2000], store.groups).astype(np.float32))
    decode_s = time.perf_counter() - start
    errors = np.concatenate(distances)
    layout = store.table.code.layout
    show(
        {
            "case": case,
            "frames": len(values),
            "channels": values.shape[1],
            "float32": values.nbytes,
            "gzip": zipped,
            "float16, gzip": deflated(values, np.float16),
            "store": size,
            "gzip / store": round(zipped / size, 1),
            "in memory": store.nbytes,
            "bytes a second": round(size / (len(values) / rate_hz)),
            "components": len(store.table.basis),
            "knots, Hz": round(store.rate_hz / layout.spacing, 2),
            "block": layout.length,
            "error, % of lip width": {
                "99th percentile": percent(np.percentile(errors, 99), tolerance),
                "of the worst point": percent(np.percentile(errors, 99, axis=0).max(), tolerance),
                "median": percent(np.median(errors), tolerance),
                "largest": percent(errors.max(), tolerance),
            },
            "encode, s": round(encode_s, 1),
            "decode all and compare, s": round(decode_s, 1),
            f"{PIECES} pieces of 100 ms, ms": round(1e3 * median_s(lambda: store.rows(scattered(kept, rate_hz))), 1),
        }
    )


def scattered(kept: list[Any], rate_hz: float) -> Array:
    """Return the frames of pieces at random places."""
    draw, length = np.random.default_rng(1), max(round(PIECE_S * rate_hz), 1)
    spans = [kept[n] for n in draw.integers(0, len(kept), PIECES)]
    starts = [int(draw.integers(first, stop - length)) for first, stop in spans]
    return np.concatenate([np.arange(start, start + length) for start in starts])


def median_s(work: Callable[[], Any]) -> float:
    """Return the median seconds of five runs."""
    times = []
    for _ in range(5):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return float(np.median(times))


def deflated(values: Array, dtype: Any) -> int:
    """Return the bytes that gzip -6 makes of an array, frame by frame, without its header of 18."""
    packer = zlib.compressobj(6)
    return sum(len(packer.compress(part)) for part in _bytes(values, dtype)) + len(packer.flush())


def _bytes(values: Array, dtype: Any) -> Iterator[bytes]:
    for first in range(0, len(values), 500):
        yield values[first : first + 500].astype(dtype).tobytes()


def archived(arrays: dict[str, Array]) -> int:
    """Return the bytes of a file with these arrays."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "store"
        write_archive(path, {}, arrays)
        return path.stat().st_size


def ranges(curves: list[Array]) -> list[tuple[int, int]]:
    """Return the first row of each of some tables and the one after its last, when they follow each other."""
    ends = np.cumsum([len(table) for table in curves]).tolist()
    return list(zip([0, *ends[:-1]], ends, strict=True))


def percent(distance: Any, tolerance: float) -> float:
    """Return a distance in per cent of the lip width, of which the tolerance is 0.5."""
    return round(0.5 * float(distance) / tolerance, 3)


def show(figures: dict[str, Any]) -> None:
    print(json.dumps(figures), flush=True)


if __name__ == "__main__":
    main()
