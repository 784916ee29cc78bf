"""The background sequence: which part of the footage it is, and in which order its frames are shown."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import chain, pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.motion.eigenlips import EYE_DISTANCE_PX, MOUTH_CORNER, MOUTH_HEIGHT
from lipmotion.stats.pca import choose_evenly
from lipmotion_faces.appearance import looping, lower_face
from lipmotion_faces.appearance.person import Appearance
from lipmotion_faces.appearance.placing import cut, feather, invert_map
from lipmotion_faces.coded_video import FrameGroups, encode_video
from lipmotion_faces.filmed.face import StoredBackground
from lipmotion_faces.filmed.renderer import Background
from lipmotion_faces.tracking.frames import WHOLE, VideoSpan
from lipmotion_faces.tracking.steadying import REGISTERED_NOISE_PX, register_maps, steady_maps
from lipmotion_faces.tracking.track import Footage, decode_footage, open_footage, track_footage

LOG = logging.getLogger("lipmotion")

MAX_BACKGROUND_S, MAX_PART_S = 20.0, 10.0
"""Longest background that is kept in the file of a face, and the longest part of it."""
HEAD_PX = -75.0, -80.0, 75.0, 150.0
"""Left, top, right and bottom of a head, px of the face, from the point between the eyes."""
CHIN = "y_152"  # the tip of the chin
SMOOTHING_FRAMES = 0.7  # standard deviation of the smoothing of its place, frames: the tracker trembles
ALIGNED_PX = -125.0, -135.0, 125.0, 155.0
"""The part around a head in which heads are laid upon one another where one frame fades into another."""
ALIGNED_EDGE_PX = 25.0  # width of the edge of that part
MAX_PARTS = 24  # parts of the footage that are tried as backgrounds
COMPARED_STEP = 3  # only every third frame of the parts is compared
SHOWN_S = 60.0  # how long they are shown then
SHORT_S, SHORT_COST = 3.0, 2.0  # shorter parts would repeat too soon: they cost more, in proportion to what is missing
COMPARED_SHARE = 0.9  # a part of this share of ``SHORT_S`` is still compared
MAX_TRACKED_S = 120.0  # seconds of a video that are used as a background
LONGEST_GAP_S = 0.2
"""Where the face is not seen for so short a time, as where pictures were dropped, its interpolated place will do."""


@dataclass(frozen=True, eq=False)
class BackgroundSequence:
    """Footage that can be shown for any length.

    face_to_frame : affine maps from px of the face to px of the frame [shape=(T, 2, 3)]
    chin_px       : how far the tip of the chin is below the eyes, px of the face [shape=(T,)]
    usable        : frames in which the face is seen [shape=(T,)]
    cuts          : frames before which the camera changes
    in_time       : whether it is the video of the speech, so that every frame is shown at its own time, also those
                    without a face, and the last one stays
    """

    groups: Callable[[], FrameGroups]
    rate_hz: float
    face_to_frame: NDArray[np.float64]
    chin_px: NDArray[np.float64]
    usable: NDArray[np.bool_]
    cuts: tuple[int, ...] = ()
    in_time: bool = False

    @property
    def face_box(self) -> tuple[float, float, float, float]:
        """The part of the frames in which the face is at any time: left, top, right and bottom, px."""
        corners = np.array([[x, y, 1.0] for x in HEAD_PX[::2] for y in HEAD_PX[1::2]])
        places = (self.face_to_frame @ corners.T).swapaxes(1, 2).reshape(-1, 2)
        low, high = places.min(axis=0), places.max(axis=0)
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])

    def enlarge(self, zoom: float) -> BackgroundSequence:
        """Return the same background, on which a mouth is ``zoom`` times as large, in the same place."""
        middle = np.array([0.0, MOUTH_CORNER[1] + MOUTH_HEIGHT / 2])
        maps = self.face_to_frame.copy()
        maps[:, :, 2] += maps[:, :, :2] @ middle * (1 - zoom)
        maps[:, :, :2] *= zoom
        return replace(self, face_to_frame=maps)

    def decode(self, count: int, rate_hz: float) -> Iterator[Background]:
        """Yield ``count`` frames at a rate, in ``find_order``."""
        groups = self.groups()
        shown = np.floor(np.arange(count) * (self.rate_hz / rate_hz) + 0.5).astype(int)
        order = self.find_order(groups, int(shown[-1]) + 1)
        for first, second, weight in zip(order.first[shown], order.second[shown], order.weight[shown], strict=True):
            both = []
            for number in (int(first), int(second)):
                frame = groups.decode(number)
                height, width = (length // 2 * 2 for length in frame.shape[:2])
                has_face, chin_px = bool(self.usable[number]), float(self.chin_px[number])
                both.append(Background(frame[:height, :width], self.face_to_frame[number], chin_px, has_face))
            yield both[0] if weight == 0 else mix_frames(both[0], both[1], float(weight))

    def find_order(self, groups: FrameGroups, count: int) -> looping.LoopOrder:
        """Return which frames are shown, at the background's own rate.

        They are the first ones, if these are as many and show the face without a cut; else in ``find_loop_order``,
        which shows no frame without a face.
        """
        total = len(self.chin_px)
        is_whole = count <= total and self.usable[:count].all() and not any(0 < cut < count for cut in self.cuts)
        if self.in_time or is_whole:
            shown = np.minimum(np.arange(count), total - 1)
            return looping.LoopOrder(shown, shown, np.zeros(count), ())
        descriptors = looping.describe_frames((groups.decode(number) for number in range(total)), self.face_to_frame)
        return looping.find_loop_order(descriptors, count, self.rate_hz, usable=self.usable, cuts=self.cuts)


def find_best_background(footages: Sequence[Footage]) -> StoredBackground:
    """Return the parts of some footage that can be shown one after the other with the least visible joins.

    ``MAX_PARTS`` parts of one size, spread evenly, are compared. They last at most ``MAX_PART_S``, show the face in
    all frames, and have no cut. Parts much shorter than ``SHORT_S`` are compared only if there are no longer ones. The
    first is the one that could best be shown alone for a minute; each next one has a frame that is most like one of
    those before, up to ``MAX_BACKGROUND_S`` and as long as jumps lead there.
    """
    chosen = _order_parts(choose_parts(footages))
    height, width = (length // 2 * 2 for length in chosen[0][0].size)
    frames = (frame[:height, :width] for part in chosen for frame in decode_footage(*part))
    video = encode_video(frames, chosen[0][0].rate_hz)
    maps, chins = (
        np.concatenate([of(footage)[start:stop] for footage, start, stop in chosen]) for of in (steady_face, find_chin)
    )
    return StoredBackground(video, maps, chins, tuple(start for start, _ in _list_spans(chosen)[1:]))


_Part = tuple[Footage, int, int]


def choose_parts(footages: Sequence[Footage]) -> list[_Part]:
    """Return the parts that are compared, those whose pictures have the size and rate of most of the footage."""
    parts = [part for footage in footages for part in divide_footage(footage)]
    lengths: dict[tuple[tuple[int, int], float], float] = {}
    for part in parts:
        kind = part[0].size, part[0].rate_hz
        lengths[kind] = lengths.get(kind, 0.0) + _measure_duration(part)
    most_common = max(lengths, key=lambda kind: lengths[kind])
    parts = [part for part in parts if (part[0].size, part[0].rate_hz) == most_common]
    min_s = COMPARED_SHARE * min(SHORT_S, max(map(_measure_duration, parts)))
    parts = [part for part in parts if _measure_duration(part) >= min_s]
    return [parts[number] for number in choose_evenly(MAX_PARTS, len(parts))]


def _list_spans(parts: Sequence[_Part]) -> list[tuple[int, int]]:
    """Return the first frame of each part, and the one after its last, where they follow one another."""
    return list(pairwise(np.cumsum([0, *(stop - start for _, start, stop in parts)]).tolist()))


def _order_parts(parts: Sequence[_Part]) -> list[_Part]:
    """Return the parts that are shown, the best one first."""
    rate_hz, scenes = parts[0][0].rate_hz, _list_spans(parts)
    shown = chain.from_iterable(decode_footage(*part) for part in parts)
    maps = np.concatenate([footage.face_to_image[start:stop] for footage, start, stop in parts])
    descriptors = looping.describe_frames(shown, maps)
    blemishes = []
    for scene in scenes:  # how visible the worst join is if a part is shown for a minute; short ones are worse
        order = looping.find_loop_order(descriptors.select(*scene), round(SHOWN_S * rate_hz), rate_hz)
        missing = max(0.0, 1 - (scene[1] - scene[0]) / rate_hz / SHORT_S)
        blemishes.append(max((join.cost for join in order.joins), default=0.0) + SHORT_COST * missing)
    part_of = np.repeat(np.arange(len(parts)), [stop - start for start, stop in scenes])[::COMPARED_STEP]
    distances = looping.compare_rows(descriptors.standardise(scenes, looping.count_fade(rate_hz))[::COMPARED_STEP])
    chosen = [int(np.argmin(blemishes))]
    while True:
        nearest = distances[np.isin(part_of, chosen)].min(axis=0)
        left_s = MAX_BACKGROUND_S - sum(_measure_duration(parts[number]) for number in chosen)
        apart = {
            number: float(nearest[part_of == number].min())
            for number in range(len(parts))
            if number not in chosen and _measure_duration(parts[number]) <= left_s
        }
        best = min(apart, key=lambda number: apart[number], default=-1)
        if best < 0 or apart[best] > looping.JUMP_LIMIT:
            return [parts[number] for number in chosen]
        chosen.append(best)


def divide_footage(footage: Footage) -> list[_Part]:
    """Return the parts of some footage that show the face without a cut: first frame, and the one after the last."""
    longest = max(1, round(MAX_PART_S * footage.rate_hz))
    parts = []
    for first, last in looping.list_scenes(_mark_usable(footage), footage.cuts):
        count = -(-(last - first) // longest)
        ends = np.linspace(first, last, count + 1).astype(int).tolist()
        parts += [(footage, start, stop) for start, stop in pairwise(ends)]
    return parts


def _measure_duration(part: _Part) -> float:
    footage, start, stop = part
    return (stop - start) / footage.rate_hz


def _mark_usable(footage: Footage) -> NDArray[np.bool_]:
    """Return the frames that show the face undamaged, and those of gaps up to ``LONGEST_GAP_S`` [shape=(T,)]."""
    usable = np.array(footage.track.seen)
    for start, stop in looping.list_scenes(~usable, ()):
        if start > 0 and stop < len(usable) and stop - start <= LONGEST_GAP_S * footage.rate_hz:
            usable[start:stop] = True
    return usable if footage.damaged is None else usable & ~footage.damaged


def open_stored_background(background: StoredBackground) -> BackgroundSequence:
    """Return the background in the file of a face."""
    video = background.video
    usable = np.ones(len(video), bool)
    maps, chins = background.face_to_frame, background.chin_px
    return BackgroundSequence(video.open_groups, video.rate_hz, maps, chins, usable, background.cuts)


def open_background(path: Path, appearance: Appearance | None = None, *, in_time: bool = False) -> BackgroundSequence:
    """Return a video as a background; warn where it is not ``appearance``'s. Raises InputError: no video, no face."""
    footage = track_footage(path, WHOLE if in_time else VideoSpan(0.0, MAX_TRACKED_S))
    if appearance is not None:
        frame = int(np.flatnonzero(footage.track.seen)[0])
        shown = next(decode_footage(footage, frame, frame + 1))
        to_frame = lower_face.map_region(footage.face_to_image[frame], 1)
        picture = cut(shown, to_frame, (lower_face.HEIGHT, lower_face.WIDTH))
        recorded = appearance.jaw.mean.T.reshape(lower_face.HEIGHT, lower_face.WIDTH, 3)
        likely = lower_face.compare_faces(lower_face.find_signature(picture), lower_face.find_signature(recorded))
        if likely < lower_face.SAME_PERSON_LIKENESS:
            wrong = "seems to show somebody else than the face (likeness %.2f, of one person at least %.2f)"
            required = lower_face.SAME_PERSON_LIKENESS
            LOG.warning(f"%s: {wrong}; give footage of the same person", footage.path, likely, required)
    groups, maps = partial(open_footage, footage), steady_face(footage)
    return BackgroundSequence(
        groups, footage.rate_hz, maps, find_chin(footage), _mark_usable(footage), footage.cuts, in_time
    )


def find_chin(footage: Footage) -> NDArray[np.float64]:
    """Return how far the tip of the chin is below the eyes in every frame, px of the face [shape=(T,)]."""
    from scipy.ndimage import gaussian_filter1d

    return -EYE_DISTANCE_PX * gaussian_filter1d(np.asarray(footage.track.motion[CHIN], np.float64), SMOOTHING_FRAMES)


def steady_face(footage: Footage) -> NDArray[np.float64]:
    """Return where the face is in every frame of some footage, without the noise of tracking [shape=(T, 2, 3)]."""
    return steady_maps(register_maps(footage), footage.rate_hz, footage.cuts, noise_px=REGISTERED_NOISE_PX)


def mix_frames(one: Background, other: Background, weight: float) -> Background:
    """Return a frame between two, of which the second has some weight; its head is at a place between theirs."""
    share = round(256 * weight)
    levels = np.uint16(256 - share) * one.frame + np.uint16(share) * other.frame
    frame = ((levels + np.uint16(128)) >> np.uint16(8)).astype(np.uint8)
    between = (1 - weight) * one.face_to_frame + weight * other.face_to_frame
    has_face = one.has_face and other.has_face
    if has_face:
        scale = max(1, round(4 * float(np.sqrt(abs(np.linalg.det(between[:, :2])))))) / 4
        edge = _feather_head(scale)
        x, y = between[:, 2].tolist()
        left, top = round(x + scale * ALIGNED_PX[0]), round(y + scale * ALIGNED_PX[1])
        rows, columns = (
            slice(min(max(first, 0), length), min(max(first + wide, 0), length))
            for first, wide, length in ((top, edge.shape[0], frame.shape[0]), (left, edge.shape[1], frame.shape[1]))
        )
        edge = edge[rows.start - top : rows.stop - top, columns.start - left : columns.stop - left]
        corner = np.array([columns.start, rows.start]) + 0.5
        back = invert_map(between)
        heads = []
        for each in (one, other):
            turn = each.face_to_frame[:, :2] @ back[:, :2]
            start = turn @ corner + each.face_to_frame[:, :2] @ back[:, 2] + each.face_to_frame[:, 2] - 0.5
            heads.append(cut(each.frame, np.column_stack([turn, start]), edge.shape))
        part = frame[rows, columns]
        aligned = heads[0] + np.float32(weight) * (heads[1] - heads[0])
        part[...] = np.clip(np.rint(part + edge[..., None] * (aligned - part)), 0, 255)
    return Background(frame, between, (1 - weight) * one.chin_px + weight * other.chin_px, has_face)


@cache
def _feather_head(scale: float) -> NDArray[np.float32]:
    """Return the weights of ``ALIGNED_PX`` with some samples a px of the face [shape=(h, w)]."""
    left, top, right, bottom = ALIGNED_PX
    height, width = round((bottom - top) * scale), round((right - left) * scale)
    return feather(np.ones((height, width), bool), max(1.0, ALIGNED_EDGE_PX * scale))
