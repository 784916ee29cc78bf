"""Recorded clips, and simple ways to give them another mouth: what ``video_face.py`` compares a renderer with."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.corpora import Corpus
from lipmotion.errors import InputError
from lipmotion.motion.eigenlips import MOUTH_CORNER, MOUTH_HEIGHT, MOUTH_WIDTH, Eigenlips, fit_eigenlips
from lipmotion.pipeline.model import load_model
from lipmotion.pipeline.request import Outputs
from lipmotion.pipeline.training.channels import PICTURES
from lipmotion.stats.pca import choose_evenly
from lipmotion.types import Motion, Timeline, Utterance
from lipmotion_faces.appearance import lower_face
from lipmotion_faces.appearance.candidates import square_distances
from lipmotion_faces.appearance.placing import invert_map, place
from lipmotion_faces.film import filmed_video
from lipmotion_faces.film.background import open_background, steady_face
from lipmotion_faces.film.filmed_video import FILM, make_film
from lipmotion_faces.filmed.face import FilmedFace
from lipmotion_faces.registry import make_face
from lipmotion_faces.tracking.track import decode_footage, track_footage
from lipmotion_faces.tracking.trackers import LIP_POINTS

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Pictures = NDArray[np.uint8]

AROUND_PX = 12  # what is seen around the lower face, so that skin beside what replaces it can be measured
LOWER_FACE = (lower_face.HEIGHT + 2 * AROUND_PX, lower_face.WIDTH + 2 * AROUND_PX)
"""Height and width of the aligned part of the face in which seams are measured, px; the eyes are 90 px apart."""
MOUTH = (slice(28, 28 + MOUTH_HEIGHT), slice(40, 40 + MOUTH_WIDTH))  # the mouth region in it
CROSSED = "crossed"  # what drives a way: the track of another clip
LIP_CHANNELS = tuple(f"{axis}_{index}" for index in LIP_POINTS for axis in "xy")
RIDGE = 1e-4
"""Share of the mean variance of the lip points that the ridge regression of eigenlips adds to each variance."""


@dataclass(eq=False)
class RecordedClip:
    """A recorded clip of a corpus with the frames of its video.

    utterance : of the corpus: its sound, its track, its mouth pictures
    path      : its video
    frames    : uint8 array [shape=(T, H, W, 3)], frame n at n / rate of the track
    maps      : affine maps [shape=(T, 2, 3)] from the plane of the lips to the image, without the noise of tracking
    """

    utterance: Utterance
    path: Path
    frames: Pictures
    maps: Array

    @property
    def name(self) -> str:
        """Name of the clip."""
        return self.utterance.name

    @property
    def rate_hz(self) -> float:
        """Frames a second."""
        return self.utterance.track.motion.rate_hz

    @cached_property
    def to_frame(self) -> Array:
        """The maps from pixels of the mouth region to their positions in the image [shape=(T, 2, 3)]."""
        return lower_face.map_region(np.asarray(self.maps), 1, MOUTH_CORNER)

    @cached_property
    def lower_face_to_frame(self) -> Array:
        """The same of pixels of ``LOWER_FACE`` [shape=(T, 2, 3)]."""
        first = -np.array([MOUTH[1].start, MOUTH[0].start])
        moved: Array = self.to_frame.copy()
        moved[:, :, 2] += self.to_frame[:, :, :2] @ first
        return moved

    @property
    def eyes_px(self) -> float:
        """Median distance between the outer eye corners in the image, px."""
        return float(90 * np.median(np.sqrt(np.abs(np.linalg.det(self.maps[:, :, :2])))))


@dataclass(frozen=True, eq=False)
class Way:
    """A way to make the frames of a clip.

    name   : what the table says
    motion : what drives it: ``tracked`` (the clip's own track), the name of an engine, ``CROSSED``, or None
    render : function of the clip and of the motion, which returns frames of the size of the recorded ones
    region : bool array of ``LOWER_FACE``, the region that is replaced; None: there is none
    motion_only : whether the frames show another face, so that pictures cannot be compared
    """

    name: str
    motion: str | None
    render: Callable[[RecordedClip, Motion | None], Iterator[Pictures]]
    region: Mask | None = None
    motion_only: bool = False


def recorded_clip(corpus: Corpus, name: str, path: Path) -> RecordedClip:
    """Return a clip of a corpus with the frames of its video, and the pose of the head in every frame."""
    footage = track_footage(path)
    frames = np.stack(list(decode_footage(footage)))
    utterance = corpus.utterance(name)
    if len(frames) != len(utterance.track.seen):
        raise InputError(f"{path}: {len(frames)} frames, required {len(utterance.track.seen)}, as in the corpus")
    return RecordedClip(utterance, path, frames, steady_face(footage))


def video_of(clips: Path, name: str) -> Path:
    """Return the video of an utterance in a folder."""
    return next(path for path in sorted(clips.glob(f"{name}.*")) if path.is_file())


@lru_cache(maxsize=48)
def training_video(path: Path) -> tuple[Pictures, Array]:
    """Return the frames of a video, and the maps from the mouth region to them."""
    footage = track_footage(path)
    maps = lower_face.map_region(footage.face_to_image, 1, MOUTH_CORNER)
    return np.stack(list(decode_footage(footage))), maps


class RecordedMouths:
    """The mouth pictures of a training list: what the simple ways are made of.

    corpus : of one speaker; all utterances have mouth pictures
    names  : the utterances
    clips  : the folder of their videos
    """

    def __init__(self, corpus: Corpus, names: Sequence[str], clips: Path) -> None:
        tracks = [corpus.utterance(name).track for name in names]
        self._names, self._clips = names, clips
        self._pictures = [track.crops for track in tracks]
        where = [(clip, frame) for clip, track in enumerate(tracks) for frame in np.flatnonzero(track.seen)]
        self.where = np.array(where)
        self.lips = np.concatenate([lips(track.motion)[track.seen] for track in tracks])

    def pictures(self, numbers: NDArray[np.intp]) -> Pictures:
        """Return some of the pictures [shape=(N, 56, 72, 3)]."""
        return np.stack([np.asarray(self._pictures[clip])[frame] for clip, frame in self.where[numbers]])

    def nearest(self, motion: Array) -> NDArray[np.intp]:
        """Return the number of the picture whose lip points are nearest, in each frame [shape=(T,)]."""
        found = square_distances(motion.astype(np.float32), self.lips.astype(np.float32)).argmin(axis=1)
        return np.asarray(found)

    def frame(self, number: int) -> tuple[Pictures, Array]:
        """Return the frame of the video that a picture is from, and the map from the mouth region to it."""
        clip, frame = self.where[number]
        frames, to_frame = training_video(video_of(self._clips, self._names[clip]))
        return frames[frame], to_frame[frame]

    @cached_property
    def chosen(self) -> Pictures:
        """The pictures that eigenlips are made from."""
        return self.pictures(choose_evenly(PICTURES, len(self.where)))

    @cached_property
    def eigenlips(self) -> Eigenlips:
        """Eigenlips of these pictures."""
        return fit_eigenlips(self.chosen)

    @cached_property
    def map(self) -> tuple[Array, Array]:
        """The matrix and the constant of the ridge regression from lip points to eigenlips."""
        numbers = np.arange(0, len(self.where), 4)
        x = self.lips[numbers]
        y = np.concatenate([self.eigenlips.project(self.pictures(part)) for part in np.array_split(numbers, 16)])
        centred = x - x.mean(axis=0)
        square = centred.T @ centred
        ridge = RIDGE * np.trace(square) / len(square)
        matrix = np.linalg.solve(square + ridge * np.eye(len(square)), centred.T @ (y - y.mean(axis=0)))
        return matrix, y.mean(axis=0) - x.mean(axis=0) @ matrix


def lips(motion: Motion) -> Array:
    """Return x and y of the lip points [shape=(T, 80)], eye distances."""
    return np.asarray(motion.values, float)[:, [motion.column(name) for name in LIP_CHANNELS]]


def on_frames(motion: Motion, clip: RecordedClip) -> Motion:
    """Return motion at the frames of a clip."""
    time_s = np.arange(len(clip.frames)) / clip.rate_hz
    return Motion(motion.at(time_s), clip.rate_hz, motion.channels)


def rectangle() -> Mask:
    """Return the mouth region in ``LOWER_FACE``, without its outermost pixels, which nothing is pasted on."""
    region = np.zeros(LOWER_FACE, bool)
    region[MOUTH] = np.pad(np.ones((MOUTH_HEIGHT - 2, MOUTH_WIDTH - 2), bool), 1)
    return region


def pasted(clip: RecordedClip, pictures: Pictures) -> Iterator[Pictures]:
    """Yield the frames of a clip with mouth pictures pasted in: hard edge, no cloning."""
    weight = rectangle()[MOUTH].astype(np.float32)
    for frame, picture, to_frame in zip(clip.frames, pictures, clip.to_frame, strict=True):
        made = frame.copy()
        place(made, picture, weight, to_frame)
        yield made


def mouth_in_frame(frame: Pictures, to_frame: Array) -> NDArray[np.float32]:
    """Return where the mouth region lies in a frame: 1 inside, 0 outside [shape=(H, W)]."""
    rows, columns = np.mgrid[: frame.shape[0], : frame.shape[1]]
    back = invert_map(to_frame)
    x, y = np.einsum("ij,jhw->ihw", back[:, :2], np.stack([columns, rows])) + back[:, 2, None, None]
    inside = (x > 0.5) & (x < MOUTH_WIDTH - 1.5) & (y > 0.5) & (y < MOUTH_HEIGHT - 1.5)
    return inside.astype(np.float32)


def composed(outer: Array, inner: Array) -> Array:
    """Return the affine map that applies ``inner``, then ``outer`` [shape=(2, 3)]."""
    return np.concatenate([outer[:, :2] @ inner[:, :2], outer[:, :2] @ inner[:, 2:] + outer[:, 2:]], axis=1)


def simple_ways(mouths: RecordedMouths, engines: Sequence[str]) -> list[Way]:
    """Return the simple alternatives.

    engines : what else than the clip's own track drives them; the first is used
    """

    def nearest(clip: RecordedClip, motion: Motion | None) -> Iterator[Pictures]:
        assert motion is not None
        return pasted(clip, mouths.pictures(mouths.nearest(lips(motion))))

    def from_video(clip: RecordedClip, motion: Motion | None) -> Iterator[Pictures]:
        assert motion is not None
        for number, frame, to_frame in zip(mouths.nearest(lips(motion)), clip.frames, clip.to_frame, strict=True):
            source, to_source = mouths.frame(int(number))
            made = frame.copy()
            place(made, source, mouth_in_frame(source, to_source), composed(to_frame, invert_map(to_source)))
            yield made

    def mapped(clip: RecordedClip, motion: Motion | None) -> Iterator[Pictures]:
        assert motion is not None
        matrix, constant = mouths.map
        return pasted(clip, mouths.eigenlips.restore(lips(motion) @ matrix + constant))

    def own(clip: RecordedClip, _: Motion | None) -> Iterator[Pictures]:
        crops = clip.utterance.track.crops
        assert crops is not None
        return pasted(clip, mouths.eigenlips.restore(mouths.eigenlips.project(np.asarray(crops))))

    def frozen(clip: RecordedClip, _: Motion | None) -> Iterator[Pictures]:
        mean = np.rint(mouths.chosen.mean(axis=0)).astype(np.uint8)
        return pasted(clip, np.broadcast_to(mean, (len(clip.frames), *mean.shape)))

    def drawn(clip: RecordedClip, motion: Motion | None) -> Iterator[Pictures]:
        assert motion is not None
        return make_face("portrait").render(motion, Timeline(()), fps=clip.rate_hz)

    region = rectangle()
    ways = [
        Way("original", None, lambda clip, _: iter(clip.frames), region),
        Way("frozen mouth", None, frozen, region),
        Way("eigenlips of the clip's own pictures, pasted", "tracked", own, region),
    ]
    for source in ("tracked", *engines[:1], CROSSED):
        ways.append(Way(f"nearest recorded mouth, {source}", source, nearest, region))
        if source != CROSSED:  # slow: the clips that it chooses from are tracked again
            ways.append(Way(f"nearest recorded mouth, from its video, {source}", source, from_video, region))
        ways.append(Way(f"eigenlips from lip points, pasted, {source}", source, mapped, region))
        ways.append(Way(f"drawn portrait, {source}", source, drawn, motion_only=True))
    return ways


def filmed_ways(face: FilmedFace, mouths: RecordedMouths, engines: Sequence[str]) -> list[Way]:
    """Return the ways of the renderer, each with the clip itself as background.

    engines : what else than the clip's own track drives them; all options are tried with the track and the first
    """
    filmed_video.open_background = lru_cache(maxsize=1)(open_background)  # every clip is tracked once, not once a way

    def way(name: str, source: str, options: Outputs, eigenlips: Eigenlips | None = None) -> Way:
        def render(clip: RecordedClip, motion: Motion | None) -> Iterator[Pictures]:
            shown = motion
            if eigenlips is not None:
                crops = np.asarray(clip.utterance.track.crops)
                shown = Motion(eigenlips.project(crops), clip.rate_hz, eigenlips.channels)
            assert shown is not None
            with_clip = replace(options, background=clip.path)
            sound = clip.utterance.audio
            model = None if eigenlips is None else replace(load_model(), eigenlips=eigenlips)
            return make_film(face, shown, sound=sound, model=model, options=with_clip).frames

        mask = lower_face.mark_mouth(1) if options.jaw == "none" else _replaced(face)
        return Way(f"filmed, {name}", source, render, np.pad(mask, AROUND_PX))

    ways = [way("own eigenlips", "tracked", FILM, mouths.eigenlips)]
    ways += [way(source, source, FILM) for source in ("tracked", *engines, CROSSED)]
    options = {
        "no jaw": Outputs(jaw="none"),
        "jaw by energy": Outputs(jaw="energy"),
        "refinement of the paper": Outputs(refinement="paper"),
    }
    ways += [
        way(f"{source}, {name}", source, option)
        for source in ("tracked", *engines[:1])
        for name, option in options.items()
    ]
    return [*ways, way(f"{CROSSED}, no jaw", CROSSED, options["no jaw"])]


def _replaced(face: FilmedFace) -> Mask:
    """Return the part of the lower face that is replaced."""
    return lower_face.mark_replaced(face.appearance.shape, 1)
