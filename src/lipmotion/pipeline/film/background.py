"""The background sequence: which part of the footage it is, and in which order its frames are shown."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.appearance.frame_descriptors import describe_frames
from lipmotion.appearance.identity import SAME_PERSON_LIKENESS, face_signature, likeness
from lipmotion.appearance.looping import LoopOrder, loop_order, scenes_of
from lipmotion.appearance.lower_face import HEIGHT as REGION_HEIGHT
from lipmotion.appearance.lower_face import WIDTH as REGION_WIDTH
from lipmotion.appearance.lower_face import region_map
from lipmotion.appearance.mouth_region import CORNER, EYE_DISTANCE_PX, HEIGHT
from lipmotion.appearance.person import Appearance
from lipmotion.appearance.placing import cut
from lipmotion.faces.filmed.face import StoredBackground
from lipmotion.faces.filmed.renderer import Background
from lipmotion.stats.pca import evenly_spaced
from lipmotion.storage.coded_video import encode_video
from lipmotion.storage.frame_groups import FrameGroups
from lipmotion.vision.footage import Footage, footage_frames, footage_groups, track_footage
from lipmotion.vision.frames import WHOLE, VideoSpan
from lipmotion.vision.steadying import REGISTERED_NOISE_PX, registered_maps, steady_maps

LOG = logging.getLogger("lipmotion")

MOST_BACKGROUND_S = 10.0
"""Longest background that is kept in the file of a face."""
HEAD_PX = -75.0, -80.0, 75.0, 150.0
"""Left, top, right and bottom of a head, px of the face, from the point between the eyes."""
CHIN = "y_152"
"""The tip of the chin."""
SMOOTHING_FRAMES = 0.7
"""Standard deviation of the smoothing of its place, frames: the tracker trembles."""
MOST_PARTS = 12
"""Parts of the footage that are tried as backgrounds."""
SHOWN_S = 60.0
"""How long they are shown then."""
SHORT_S, SHORT_COST = 3.0, 2.0
"""A part that is shorter costs so much more, in proportion to what is missing: it would repeat too soon."""
COMPARED_SHARE = 0.9
"""A part of this share of ``SHORT_S`` is still compared."""
MOST_TRACKED_S = 120.0
"""Seconds of a video that are used as a background."""
LONGEST_GAP_S = 0.2
"""Where the face is not seen for so short a time, as where pictures were dropped, its interpolated place will do."""


@dataclass(frozen=True, eq=False)
class BackgroundSequence:
    """Footage that can be shown for any length.

    groups        : returns access to its frames, in any order
    rate_hz       : frames a second
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
        least, most = places.min(axis=0), places.max(axis=0)
        return float(least[0]), float(least[1]), float(most[0]), float(most[1])

    def enlarged(self, zoom: float) -> BackgroundSequence:
        """Return the same background, on which a mouth is ``zoom`` times as large, in the same place."""
        middle = np.array([0.0, CORNER[1] + HEIGHT / 2])
        maps = self.face_to_frame.copy()
        maps[:, :, 2] += maps[:, :, :2] @ middle * (1 - zoom)
        maps[:, :, :2] *= zoom
        return replace(self, face_to_frame=maps)

    def frames(self, count: int, rate_hz: float) -> Iterator[Background]:
        """Yield ``count`` frames at a rate, in ``order``."""
        groups = self.groups()
        shown = np.floor(np.arange(count) * (self.rate_hz / rate_hz) + 0.5).astype(int)
        order = self.order(groups, int(shown[-1]) + 1)
        for first, second, weight in zip(order.first[shown], order.second[shown], order.weight[shown], strict=True):
            one, other = (self._frame(groups, int(number)) for number in (first, second))
            yield one if weight == 0 else _mixed(one, other, float(weight))

    def order(self, groups: FrameGroups, count: int) -> LoopOrder:
        """Return which frames are shown, at the background's own rate.

        They are the first ones, if these are as many and show the face without a cut; others are in ``loop_order``,
        which shows no frame without a face.
        """
        total = len(self.chin_px)
        is_whole = count <= total and self.usable[:count].all() and not any(0 < cut < count for cut in self.cuts)
        if self.in_time or is_whole:
            shown = np.minimum(np.arange(count), total - 1)
            return LoopOrder(shown, shown, np.zeros(count), ())
        descriptors = describe_frames((groups.frame(number) for number in range(total)), self.face_to_frame)
        return loop_order(descriptors, count, self.rate_hz, usable=self.usable, cuts=self.cuts)

    def _frame(self, groups: FrameGroups, number: int) -> Background:
        frame = groups.frame(number)
        height, width = (length // 2 * 2 for length in frame.shape[:2])
        place, chin_px = self.face_to_frame[number], float(self.chin_px[number])
        return Background(frame[:height, :width], place, chin_px, bool(self.usable[number]))


def best_background(footages: Sequence[Footage]) -> StoredBackground:
    """Return the part of some footage that can be shown for a minute with the least visible join.

    ``MOST_PARTS`` parts, spread evenly, are compared. They last at most ``MOST_BACKGROUND_S``, show the face in all
    frames, and have no cut. Parts much shorter than ``SHORT_S`` are compared only if there are no longer ones.
    """
    parts = [part for footage in footages for part in _parts(footage)]
    least_s = COMPARED_SHARE * min(SHORT_S, max(map(_duration_s, parts)))
    parts = [part for part in parts if _duration_s(part) >= least_s]
    tried = [parts[number] for number in evenly_spaced(MOST_PARTS, len(parts))]
    footage, start, stop = min(tried, key=_blemish)
    height, width = (length // 2 * 2 for length in footage.size)
    frames = (frame[:height, :width] for frame in footage_frames(footage, start, stop))
    video = encode_video(frames, footage.rate_hz)
    return StoredBackground(video, placed_maps(footage)[start:stop], chin_px(footage)[start:stop])


_Part = tuple[Footage, int, int]


def _parts(footage: Footage) -> list[_Part]:
    """Return the parts of some footage that show the face without a cut: first frame, and the one after the last."""
    longest = max(1, round(MOST_BACKGROUND_S * footage.rate_hz))
    parts = []
    for first, last in scenes_of(_usable(footage), footage.cuts):
        count = -(-(last - first) // longest)
        ends = np.linspace(first, last, count + 1).astype(int).tolist()
        parts += [(footage, start, stop) for start, stop in pairwise(ends)]
    return parts


def _duration_s(part: _Part) -> float:
    footage, start, stop = part
    return (stop - start) / footage.rate_hz


def _usable(footage: Footage) -> NDArray[np.bool_]:
    """Return the frames that show the face, and those of gaps of at most ``LONGEST_GAP_S`` [shape=(T,)]."""
    usable = np.array(footage.track.seen)
    for start, stop in scenes_of(~usable, ()):
        if start > 0 and stop < len(usable) and stop - start <= LONGEST_GAP_S * footage.rate_hz:
            usable[start:stop] = True
    return usable


def _blemish(part: _Part) -> float:
    """Return how visible the worst join is if a part is shown for a minute; short ones are worse."""
    footage, start, stop = part
    descriptors = describe_frames(footage_frames(footage, start, stop), footage.face_to_image[start:stop])
    order = loop_order(descriptors, round(SHOWN_S * footage.rate_hz), footage.rate_hz)
    worst = max((join.cost for join in order.joins), default=0.0)
    return worst + SHORT_COST * max(0.0, 1 - _duration_s(part) / SHORT_S)


def stored_sequence(background: StoredBackground) -> BackgroundSequence:
    """Return the background in the file of a face."""
    video = background.video
    usable = np.ones(len(video), bool)
    return BackgroundSequence(video.groups, video.rate_hz, background.face_to_frame, background.chin_px, usable)


def open_background(path: Path, appearance: Appearance | None = None, *, in_time: bool = False) -> BackgroundSequence:
    """Return a video as a background.

    appearance : of the person who should be in it: somebody else is warned about; None: it may be anybody
    in_time : as of ``BackgroundSequence``: all of the video is used; False: at most ``MOST_TRACKED_S`` of it
    Raises InputError: no video, or no face in it.
    """
    footage = track_footage(path, WHOLE if in_time else VideoSpan(0.0, MOST_TRACKED_S))
    if appearance is not None:
        _warn_of_somebody_else(footage, appearance)
    groups, maps = partial(footage_groups, footage), placed_maps(footage)
    return BackgroundSequence(groups, footage.rate_hz, maps, chin_px(footage), _usable(footage), footage.cuts, in_time)


def _warn_of_somebody_else(footage: Footage, appearance: Appearance) -> None:
    frame = int(np.flatnonzero(footage.track.seen)[0])
    shown = next(footage_frames(footage, frame, frame + 1))
    picture = cut(shown, region_map(footage.face_to_image[frame], 1), (REGION_HEIGHT, REGION_WIDTH))
    recorded = appearance.jaw.mean.T.reshape(REGION_HEIGHT, REGION_WIDTH, 3)
    found = likeness(face_signature(picture), face_signature(recorded))
    if found < SAME_PERSON_LIKENESS:
        LOG.warning(
            "%s: seems to show somebody else than the face (likeness %.2f, of one person at least %.2f); give "
            "footage of the same person",
            footage.path,
            found,
            SAME_PERSON_LIKENESS,
        )


def chin_px(footage: Footage) -> NDArray[np.float64]:
    """Return how far the tip of the chin is below the eyes in every frame, px of the face [shape=(T,)]."""
    from scipy.ndimage import gaussian_filter1d

    return -EYE_DISTANCE_PX * gaussian_filter1d(np.asarray(footage.track.motion[CHIN], np.float64), SMOOTHING_FRAMES)


def placed_maps(footage: Footage) -> NDArray[np.float64]:
    """Return where the face is in every frame of some footage, without the noise of tracking [shape=(T, 2, 3)]."""
    return steady_maps(registered_maps(footage), footage.rate_hz, footage.cuts, noise_px=REGISTERED_NOISE_PX)


def _mixed(one: Background, other: Background, weight: float) -> Background:
    """Return a frame between two, of which the second has some weight."""
    frame = np.rint((1 - weight) * one.frame + weight * other.frame).astype(np.uint8)
    place = (1 - weight) * one.face_to_frame + weight * other.face_to_frame
    chin_px = (1 - weight) * one.chin_px + weight * other.chin_px
    return Background(frame, place, chin_px, one.has_face and other.has_face)
