"""How much footage a filmed face needs, and what normalising head pose and light is worth.

    python benchmarks/appearance.py [--grid ../shared/corpora/grid-s1] [--clips 1,2,4,8,16,32,64]

Faces are learned from the first clips of ``order.txt`` (all of ``train``), and judged on the clips of ``val``: the
mouth is made from the tracked motion of the same frame, and compared with the recorded one in the light of the face
(PSNR, dB; mean correlation of the 90 eigenlips). ``own`` is the PSNR of the recorded mouths' own eigenlips, the best
that can be.
The last rows: 64 clips, without the light normalised, and with the mouth cut out by two eye corners.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.types import Channel, Motion
from lipmotion_faces.appearance import person
from lipmotion_faces.appearance.lower_face import HEIGHT, WIDTH, cheek_light, face_shape, mouth_part, region_map, relit
from lipmotion_faces.appearance.person import Appearance, FootagePictures, learn_appearance
from lipmotion_faces.appearance.placing import cut
from lipmotion_faces.film.background import chin_px
from lipmotion_faces.film.build import JAW_ENDS, UNUSED_AXIS
from lipmotion_faces.tracking.footage import Footage, footage_frames, track_footage
from lipmotion_faces.tracking.frames import WHOLE
from lipmotion_faces.tracking.landmarks import EYE_CORNERS, TRACKED_POINTS
from lipmotion_faces.tracking.mouth_pictures import eyes_to_image
from lipmotion_faces.tracking.tracked_frames import tracked_frames

Pictures = NDArray[np.uint8]
EYES = [TRACKED_POINTS.index(point) for point in EYE_CORNERS]


@dataclass(frozen=True, eq=False)
class Clip:
    """One clip: its pictures, by the pose of the head and by two eye corners, and its motion."""

    footage: Footage
    posed: Pictures
    by_eyes: Pictures

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The channels that are used."""
        return tuple(each for each in self.footage.track.motion.channels if not each.name.startswith(UNUSED_AXIS))

    @property
    def motion(self) -> NDArray[np.float64]:
        """The motion in these channels."""
        motion = self.footage.track.motion
        return np.asarray(motion.values)[:, [motion.column(each.name) for each in self.channels]]


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--grid", type=Path, default=Path("../shared/corpora/grid-s1"))
    parser.add_argument("--clips", default="1,2,4,8,16,32,64")
    options = parser.parse_args()
    counts = [int(count) for count in options.clips.split(",")]
    train = clips_of(options.grid, "order.txt", max(counts))
    val = clips_of(options.grid, "val.txt", 100)
    print("| clips | seconds | PSNR | own | worst clip | ACC of 90 |\n|---|---|---|---|---|---|")
    for count in counts:
        seconds = sum(len(clip.posed) for clip in train[:count]) / 25
        print(f"| {count} | {seconds:.0f} | {row(train[:count], val)} |", flush=True)
    plain = vars(person)["cheek_light"]
    vars(person)["cheek_light"] = lambda mouths: np.full((len(mouths), 3), 128.0)
    print(f"| {max(counts)}, light as recorded | | {row(train, val, light=False)} |")
    vars(person)["cheek_light"] = plain
    print(f"| {max(counts)}, by two eye corners | | {row(by_eyes(train), by_eyes(val))} |")


def clips_of(grid: Path, listed: str, count: int) -> list[Clip]:
    """Return the first clips of a list in which the face is always seen."""
    clips: list[Clip] = []
    for name in (grid / listed).read_text().split():
        if len(clips) == count:
            break
        path = grid / "clips" / f"{name}.mkv"
        try:
            footage = track_footage(path)
        except InputError:
            continue
        if footage.track.seen.all() and len(tracked_frames(path, WHOLE, ()).seen_s) == len(footage):
            clips.append(Clip(footage, posed(footage, footage.face_to_image), posed(footage, eye_maps(path))))
    return clips


def eye_maps(path: Path) -> NDArray[np.float64]:
    """Return the maps of two eye corners, frame by frame [shape=(T, 2, 3)]."""
    points = tracked_frames(path, WHOLE, ()).points
    return np.stack([eyes_to_image(frame[EYES, :2]) for frame in points])


def posed(footage: Footage, maps: NDArray[np.float64]) -> Pictures:
    """Return pictures of the lower face."""
    size = HEIGHT, WIDTH
    levels = [cut(frame, to, size) for frame, to in zip(footage_frames(footage), region_map(maps, 1), strict=True)]
    return np.clip(np.rint(levels), 0, 255).astype(np.uint8)


def by_eyes(clips: Sequence[Clip]) -> list[Clip]:
    """Return clips whose pictures are those by two eye corners."""
    return [replace(clip, posed=clip.by_eyes) for clip in clips]


def row(train: Sequence[Clip], val: Sequence[Clip], *, light: bool = True) -> str:
    """Return the figures of a face that is learned from some clips."""
    appearance = learned(train)
    made, own, true_codes, made_codes = [], [], [], []
    for clip in val:
        mouths = np.ascontiguousarray(clip.posed[(slice(None), *mouth_part(1))])
        if light:
            mouths = relit(mouths, appearance.light / cheek_light(mouths))
        codes = appearance.of_motion(Motion(clip.motion, 25.0, clip.channels)).mouth
        true = appearance.mouth.project(mouths)
        made.append(np.square(appearance.mouth.expand(codes) - mouths).mean())
        own.append(np.square(appearance.mouth.expand(true) - mouths).mean())
        true_codes.append(true)
        made_codes.append(codes)
    true, codes = np.concatenate(true_codes), np.concatenate(made_codes)
    acc = np.mean([np.corrcoef(true[:, n], codes[:, n])[0, 1] for n in range(true.shape[1])])
    return " | ".join(f"{value:.2f}" for value in (psnr(np.mean(made)), psnr(np.mean(own)), psnr(max(made)), acc))


def learned(clips: Sequence[Clip]) -> Appearance:
    """Return the appearance of a person."""
    motion = np.concatenate([clip.motion for clip in clips])
    names = [channel.name for channel in clips[0].channels]
    right, left = (motion[:, names.index(name)] for name in JAW_ENDS)
    chin = np.concatenate([chin_px(clip.footage) for clip in clips])
    shape = face_shape(float(np.median(left - right)) / 2, chin)
    pictures = tuple(clip.posed for clip in clips)
    whole = np.concatenate(pictures)
    return learn_appearance(
        FootagePictures(
            pictures, motion, clips[0].channels, np.zeros(len(motion)), chin, shape, 1, lambda frames: whole[frames]
        )
    )


def psnr(power: float) -> float:
    """Return the peak signal-to-noise ratio of a mean square difference, dB."""
    return float(10 * np.log10(255**2 / power))


if __name__ == "__main__":
    main()
