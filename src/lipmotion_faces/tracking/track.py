"""Tracking: a face followed through a video, its motion of lips and jaw, and its mouth pictures."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice, pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.types import Channel, Motion, Track
from lipmotion_faces.coded_video import MAX_DECODED_BYTES, FrameGroups
from lipmotion_faces.tracking import damaged_pictures
from lipmotion_faces.tracking.face_follower import FaceFollower
from lipmotion_faces.tracking.frames import (
    WHOLE,
    OpenVideo,
    VideoSpan,
    check_rate,
    count_frames,
    damage_notes,
    find_nearest,
    find_nominal_rate,
    open_video,
    resample_to_constant_rate,
)
from lipmotion_faces.tracking.head_pose import crop_mouth, map_eyes, map_face, remove_head_motion
from lipmotion_faces.tracking.image_similarity import find_occluded_mouths, is_cut, reduce_mouth, reduce_scene
from lipmotion_faces.tracking.trackers import DISTANCES, EYE_CORNERS, JAW_POINTS, LIP_POINTS, MEDIAPIPE, TRACKED_POINTS

Array = NDArray[np.float64]

UNSEEN_LIMIT = 0.2  # a clip is refused when more than this share of its frames shows no face
USABLE_SHARE = 0.5  # a clip is refused when its pictures cover less than this share of the duration that it states
SMALL_EYES_PX = 35.0
"""A smaller median distance between the eyes is reported. GRID clips made small and tracked have a correlation of the
opening with the clip as it was of 0.99 at 65 px, 0.98 at 40, 0.90 at 25."""
COMPARED_PX = 360
"""Pictures are thinned to fewer columns and rows than this before they are compared with the one before."""
TURNED_STEP = 50  # whether the face is upside down is asked once in so many pictures
STRETCH_LIMIT = 2.0  # a clip is refused when its time stamps span more than this many times the frames that it holds

COLUMN = {index: n for n, index in enumerate(TRACKED_POINTS)}
_EYES = [COLUMN[index] for index in EYE_CORNERS]
CHANNELS = tuple(
    Channel(name)
    for name in (*DISTANCES, *(f"{axis}_{index}" for index in (*LIP_POINTS, *JAW_POINTS) for axis in "xyz"))
)
"""``opening``, ``width``, ``outer``, then ``x_i, y_i, z_i`` for every lip and jaw point, in eye distances."""


def track(
    path: Path,
    *,
    crops: bool = True,
    span: VideoSpan = WHOLE,
    person: Sequence[NDArray[np.float64]] = (),
    tracker: str = MEDIAPIPE,
) -> Track:
    """Return the motion of lips and jaw in a video, without head motion, and the mouth pictures.

    path    : a video that shows one face, more or less from the front
    crops   : whether mouth pictures are wanted
    person  : thumbnails of the face that is wanted, of ``VideoScan``; without any, the one with the most frames
    tracker : name of the tracker that finds the face and its points (``trackers``)
    Returns a Track at the video's nominal frame rate, frame n at n / rate seconds after the start of the container, or
    of the span, not smoothed. Frames that were dropped or damaged, show no face or another one, or in which the mouth
    is occluded, are interpolated, False in ``seen``, and have the mouth picture of the nearest frame that is seen. Of
    several people the largest and most central is followed. ``notes``: damage, cuts, other faces, a very small face.
    Raises InputError: not a video, damaged, cut short before its half, too few frames with the face; no such tracker.
    Raises MissingDependencyError: MediaPipe, or what another tracker needs, or OpenCV is not installed.
    """
    return make_track(path, span, track_frames(path, span, person, tracker), crops=crops)


def make_track(path: Path, span: VideoSpan, frames: TrackedFrames, *, crops: bool) -> Track:
    """Return the motion of lips and jaw in tracked frames of a video, as ``track`` does."""
    mouths = None
    if crops:  # decoded once more: the head pose depends on all frames, and the frames do not fit into memory
        maps = iter(map_face(frames.points))
        with open_video(path, span) as video:
            shown = zip(frames.seen, video.frames, strict=False)
            mouths = np.stack([crop_mouth(frame.image, next(maps)) for seen, frame in shown if seen])
    times_s = frames.seen_s
    values = resample_to_constant_rate(times_s, measure_motion(frames.points), frames.rate_hz, frames.count)
    wanted_s = np.arange(frames.count) / frames.rate_hz
    index = find_nearest(times_s, wanted_s)
    seen = np.abs(times_s[index] - wanted_s) * frames.rate_hz <= 0.5
    nearest = None if mouths is None else mouths[index]
    return Track(Motion(values, frames.rate_hz, CHANNELS), seen, nearest, frames.notes)


def measure_motion(points: Array) -> Array:
    """Return ``CHANNELS`` [shape=(T, len(CHANNELS))] of points in px, y down, z away [shape=(T, N, 3)]."""
    unit = measure_distance(points, EYE_CORNERS)
    distances = np.stack([measure_distance(points, pair) / unit for pair in DISTANCES.values()], axis=1)
    head = remove_head_motion(points * (1, -1, -1))
    moving = head[:, [COLUMN[index] for index in (*LIP_POINTS, *JAW_POINTS)]]
    return np.concatenate([distances, moving.reshape(len(points), -1)], axis=1)


@dataclass(frozen=True, eq=False)
class TrackedFrames:
    """The pictures of a video, as they were decoded, and the points of the face that was followed.

    times_s : the time of every picture, since the start of the container or of the span, rising, s [shape=(S,)]
    seen    : whether the picture shows the person, and nothing covers the mouth [shape=(S,)]
    points  : ``TRACKED_POINTS`` in the pictures that are seen, px, x to the right, y down, z away from the camera
              [shape=(seen.sum(), N, 3)]
    sizes   : the sizes of the pictures, (H, W); most videos have only one
    cuts    : pictures before which the camera changes, or the picture changes to or from somebody else, rising
    rate_hz : nominal frame rate
    notes   : remarks on damage, cuts, other faces, a covered mouth, a small face
    """

    times_s: Array
    seen: NDArray[np.bool_]
    points: Array
    sizes: frozenset[tuple[int, int]]
    cuts: tuple[int, ...]
    rate_hz: float
    notes: tuple[str, ...]

    @property
    def seen_s(self) -> Array:
        """The times of the pictures that are seen, s [shape=(seen.sum(),)]."""
        return self.times_s[self.seen]

    @property
    def count(self) -> int:
        """The number T of frames at the constant rate, frame n at n / rate_hz seconds."""
        return count_frames(self.times_s, self.rate_hz)


def track_frames(path: Path, span: VideoSpan, person: Sequence[Array], tracker: str = MEDIAPIPE) -> TrackedFrames:
    """Return the pictures of a video, decoded once, and where one person's face is in them; no picture is kept."""
    time_s, has_face, changes, sizes = list[float](), list[bool](), list[float](), set[tuple[int, int]]()
    points, mouths = list[Array](), list[NDArray[np.uint8]]()
    before: NDArray[np.int16] | None = None
    turned = list[bool]()
    with open_video(path, span) as video, FaceFollower(person, tracker) as follower:
        for frame in video.frames:
            image, face = frame.image, follower.follow(frame.image)
            step = 1 + max(image.shape) // COMPARED_PX
            now = image[::step, ::step].astype(np.int16)
            like = before if before is not None and before.shape == now.shape else None
            changes.append(np.inf if like is None else float(np.abs(now - like).mean()))
            before = now
            time_s.append(frame.time_s)
            sizes.add((image.shape[0], image.shape[1]))
            has_face.append(face is not None)
            if face is not None:
                if len(points) % TURNED_STEP == 0:
                    turned.append(follower.is_upside_down(image, face))
                points.append(face)
                mouths.append(reduce_mouth(crop_mouth(image, map_eyes(face[_EYES, :2]))))
    if not time_s:
        raise InputError(f"{path}: no picture from {span.start_s:.2f} to {span.end_s:.2f} s; give a whole video")
    if 2 * sum(turned) > len(turned):
        raise InputError(f"{path}: the face is upside down, required upright; turn the video by 180 degrees")
    times_s, cuts, with_face = np.array(time_s), tuple(follower.list_cuts()), np.flatnonzero(has_face)
    rows = np.flatnonzero(follower.mark_person()[with_face])  # of the points: those of the person
    others = len(with_face) - len(rows)
    covered = find_occluded_mouths(np.stack(mouths)[rows]) if len(rows) else np.zeros(0, bool)
    rows = rows[~covered]
    rate_hz = find_nominal_rate(times_s, video.stated_rates_hz)
    repeated, frozen = damaged_pictures.find_repeated(changes, rate_hz)
    is_clear = np.isin(np.arange(len(times_s)), with_face[rows])
    rows = rows[~repeated[with_face[rows]]]
    tracked = np.array(points).reshape(-1, len(TRACKED_POINTS), 3)[rows]
    notes = (
        *damage_notes(video, times_s, rate_hz),
        *(f"cut at {times_s[index]:.2f} s" for index in cuts),
        *([f"another face, or one that is not recognised, in {others} frames"] if others else []),
        *([f"the mouth is covered, or the picture damaged, in {covered.sum()} frames"] if covered.any() else []),
        *damaged_pictures.describe_damage({"frozen": frozen}, times_s),
        *([f"{doubled} pictures are doubled"] if (doubled := int((repeated & ~frozen).sum())) > 1 else []),
    )
    if len(tracked):
        unit_px = float(np.median(measure_distance(tracked, EYE_CORNERS)))
        if unit_px < SMALL_EYES_PX:
            wanted = f"{SMALL_EYES_PX:.0f} give a good track; film closer"
            notes = (*notes, f"the face is small: {unit_px:.0f} px between the eyes, {wanted}")
    _check(path, times_s, is_clear & ~frozen, video, rate_hz, notes)
    seen = np.isin(np.arange(len(times_s)), with_face[rows])
    return TrackedFrames(times_s, seen, tracked, frozenset(sizes), cuts, rate_hz, notes)


def measure_distance(points: Array, pair: tuple[int, int]) -> Array:
    """Return the distance in the image between two face-mesh points in every frame, px [shape=(T,)]."""
    between = points[:, COLUMN[pair[0]], :2] - points[:, COLUMN[pair[1]], :2]
    return np.linalg.norm(between, axis=1)


def _check(
    path: Path, times_s: Array, seen: NDArray[np.bool_], video: OpenVideo, rate_hz: float, notes: tuple[str, ...]
) -> None:
    check_rate(rate_hz, path)
    count = count_frames(times_s, rate_hz)
    noted = f" ({'; '.join(notes)})" if notes else ""
    if count < USABLE_SHARE * video.stated_s * rate_hz:
        raise InputError(
            f"{path}: pictures for {count / rate_hz:.1f} of {video.stated_s:.1f} s; required at least half{noted}; "
            "export the video again"
        )
    unseen = int((~seen).sum())
    if unseen > UNSEEN_LIMIT * len(seen):
        raise InputError(
            f"{path}: no face in {unseen} of {len(seen)} frames{noted}; required: a face in at least "
            f"{1 - UNSEEN_LIMIT:.0%} of them, one person, from the front"
        )
    if count > STRETCH_LIMIT * len(seen):
        raise InputError(
            f"{path}: {len(seen)} frames span {count / rate_hz:.1f} s, {count} were expected at {rate_hz:g} Hz; "
            "convert the video to a constant frame rate"
        )


LOOK_PX = 640  # pictures are reduced to this while they are converted
FACE_STEP_S = 2.0  # how often faces are looked for
ALONE_SHARE = 0.9  # somebody whose face is in this share of the pictures with a face is taken to be the only person
REPORT_STEP = 250


@dataclass(frozen=True, eq=False)
class VideoScan:
    """The pictures of a video.

    times_s : their times, rising, s
    cuts_s  : the times of those before which the camera changes, s
    person  : thumbnails of the face that is seen most, where other people are seen too; else none
    damage  : remarks on pictures that cannot be decoded, or are missing at the end
    """

    times_s: NDArray[np.float64]
    cuts_s: NDArray[np.float64]
    rate_hz: float
    person: tuple[NDArray[np.float64], ...] = ()
    damage: tuple[str, ...] = ()

    @property
    def end_s(self) -> float:
        """End of the last picture, s."""
        return float(self.times_s[-1]) + 1 / self.rate_hz


def scan_video(path: Path, reached: Callable[[float], None] = lambda _: None, tracker: str = MEDIAPIPE) -> VideoScan:
    """Return the times and cuts of a video, and the person in it; every picture is decoded once, at a small size.

    Raises InputError: as ``open_video``, an impossible frame rate, or no tracker of that name.
    Raises MissingDependencyError: OpenCV or MediaPipe is not installed.
    """
    times_s: list[float] = []
    cuts_s: list[float] = []
    before = None
    with open_video(path, longest_px=LOOK_PX) as video, FaceFollower(tracker=tracker) as follower:
        for frame in video.frames:
            picture = reduce_scene(frame.image)
            if is_cut(before, picture):
                cuts_s.append(frame.time_s)
            if int(frame.time_s / FACE_STEP_S) != (int(times_s[-1] / FACE_STEP_S) if times_s else -1):
                follower.follow(frame.image)
            before = picture
            times_s.append(frame.time_s)
            if len(times_s) % REPORT_STEP == 0 and video.stated_s:
                reached(min(frame.time_s / video.stated_s, 1.0))
        rate_hz = find_nominal_rate(np.array(times_s), video.stated_rates_hz)
        damage = tuple(damage_notes(video, np.array(times_s), rate_hz))
    check_rate(rate_hz, path)
    return VideoScan(
        np.array(times_s),
        np.array(cuts_s),
        rate_hz,
        tuple([] if follower.measure_share() >= ALONE_SHARE else follower.list_thumbnails()),
        damage,
    )


SAME_TIME_S = 1e-4  # times of pictures that differ by less are those of one picture: containers count in whole ticks

GROUP = 32  # most frames of a video file that are decoded together


@dataclass(frozen=True, eq=False)
class Footage:
    """A video of one person, tracked. Frame n is at n / rate_hz seconds after the start of ``span``.

    path          : the video
    span          : the part of the video that was tracked
    track         : motion of the lips and jaw, T frames, and which of them are seen; as ``track.track`` finds it
    face_to_image : affine maps of ``head_pose.map_face``, from px of the face that looks ahead to
                    px of the frame [shape=(T, 2, 3)]; in frames that are not seen, interpolated within their scene
    pictures_s    : time of the picture that frame n shows, the one nearest to its time, s since the start of ``span``
                    [shape=(T,)]; equal times in a row are a picture shown again
    cuts          : the frames before which the camera changes, or the picture changes to or from somebody else, rising
    size          : height and width of the pictures, px
    rate_hz       : the video's nominal frame rate
    damaged       : frames that were found to be damaged, of those seen at first [shape=(T,)]; None: none
    """

    path: Path
    span: VideoSpan
    track: Track
    face_to_image: Array
    pictures_s: Array
    cuts: tuple[int, ...]
    size: tuple[int, int]
    rate_hz: float
    damaged: NDArray[np.bool_] | None = None

    def __len__(self) -> int:
        return len(self.pictures_s)


def track_footage(path: Path, span: VideoSpan = WHOLE, *, crops: bool = False) -> Footage:
    """Return a tracked video, and where the face is in every frame of it.

    path, span : as of ``track.track``
    crops      : whether mouth pictures are wanted, for which the video is decoded once more
    Raises InputError and MissingDependencyError: as ``track.track``; InputError also if the pictures of the
    video have several sizes.
    """
    frames = track_frames(path, span, ())
    if len(frames.sizes) > 1:
        several = " and ".join(f"{width} × {height}" for height, width in sorted(frames.sizes)[:3])
        raise InputError(f"{path}: pictures of {several} pixels in one video; export the video in one size")
    times_s, rate_hz, count = frames.seen_s, frames.rate_hz, frames.count
    cut_frames = {int(np.ceil(frames.times_s[cut] * rate_hz - 0.5)) for cut in frames.cuts}
    cuts = sorted(n for n in cut_frames if 0 < n < count)
    wanted_s = np.arange(count) / rate_hz
    maps = map_face(frames.points).reshape(-1, 6)
    result = maps[find_nearest(times_s, wanted_s)]  # in scenes in which the person is not seen
    for start, stop in pairwise([0, *cuts, count]):
        inside = (times_s * rate_hz >= start - 0.5) & (times_s * rate_hz < stop - 0.5)
        if inside.any():
            scene_s = times_s[inside] - start / rate_hz
            result[start:stop] = resample_to_constant_rate(scene_s, maps[inside], rate_hz, stop - start)
    return Footage(
        path,
        span,
        make_track(path, span, frames, crops=crops),
        result.reshape(-1, 2, 3),
        frames.times_s[find_nearest(frames.times_s, wanted_s)],
        tuple(cuts),
        next(iter(frames.sizes)),
        frames.rate_hz,
    )


def decode_footage(footage: Footage, start: int = 0, stop: int | None = None) -> Iterator[NDArray[np.uint8]]:
    """Yield frames of a tracked video, from ``start`` (included) to ``stop`` (excluded; None: to the last one).

    Each is a uint8 array [shape=(H, W, 3)], RGB: the picture whose time is nearest to that of the frame, which is shown
    again where pictures were dropped. One picture is in memory at a time; the file is open until the iterator is
    exhausted or closed. The beginning is sought in the file.
    Raises InputError: no such frames, or the video cannot be read or has changed since it was tracked.
    """
    stop = len(footage) if stop is None else stop
    if not 0 <= start <= stop <= len(footage):
        raise InputError(f"frames {start} to {stop} of {footage.path}, required within 0 to {len(footage)}")
    return _decode_between(footage, start, stop)


def open_footage(footage: Footage, max_bytes: int = MAX_DECODED_BYTES) -> FrameGroups:
    """Return access to the frames of a tracked video in any order, also backwards, in bounded memory.

    max_bytes : decoded frames that are kept
    Reading a frame raises InputError: the video cannot be read, or has changed since it was tracked.
    Cost: forwards each picture is decoded once; backwards, those between the video's own key frame and a group of up to
    ``GROUP`` frames are decoded again for every group. A video that is played backwards often is better copied into a
    ``coded_video.StoredVideo``.
    """
    frame_bytes = footage.size[0] * footage.size[1] * 3
    length = min(GROUP, max(1, max_bytes // (3 * frame_bytes)))
    starts = [*range(0, len(footage), length), len(footage)]
    return FrameGroups(_SequentialReader(footage), starts, max_bytes)


class _SequentialReader:
    def __init__(self, footage: Footage) -> None:
        self._footage = footage
        self._frames: Iterator[NDArray[np.uint8]] = iter(())
        self._next = -1

    def __call__(self, start: int, stop: int) -> list[NDArray[np.uint8]]:
        if start != self._next:
            self._frames = decode_footage(self._footage, start)
        self._next = stop
        return list(islice(self._frames, stop - start))


def _decode_between(footage: Footage, start: int, stop: int) -> Iterator[NDArray[np.uint8]]:
    if start == stop:
        return
    path, times_s = footage.path, footage.pictures_s
    is_first = times_s[start] - times_s[0] < SAME_TIME_S
    begin_s = 0.0 if is_first else float(times_s[start])
    span = footage.span if is_first else VideoSpan(footage.span.start_s + begin_s, footage.span.end_s)
    n, image = start, None
    with open_video(path, span) as video:
        for picture in video.frames:
            image = picture.image
            if image.shape[:2] != footage.size:
                height, width = footage.size
                raise InputError(f"{path}: a picture is not {width} × {height} as when it was tracked; track it again")
            while n < stop and times_s[n] < begin_s + picture.time_s + SAME_TIME_S:
                yield image
                n += 1
            if n == stop:
                return
    if image is None:
        raise InputError(f"{path}: no picture from {begin_s:.2f} s on, though it was tracked; track it again")
    for _ in range(n, stop):
        yield image


def read_video_frames(path: Path) -> tuple[Iterator[NDArray[np.uint8]], float]:
    """Return the frames of a video in constant order, and their rate; no face is looked for.

    Each is a uint8 array [shape=(H, W, 3)], RGB: the last picture that begins at or before the time of the frame. The
    video must be read to its end, or the iterator be closed.
    Raises InputError: no such video, or one that states no frame rate.
    """
    with open_video(path) as video:
        rates = [rate for rate in video.stated_rates_hz if rate > 0]
    if not rates:
        raise InputError(f"{path}: states no frame rate; convert it to a constant one")

    def decode() -> Iterator[NDArray[np.uint8]]:
        shown: NDArray[np.uint8] | None = None
        n = 0
        with open_video(path) as video:
            for picture in video.frames:
                while shown is not None and n / rates[0] < picture.time_s - SAME_TIME_S:
                    yield shown
                    n += 1
                shown = picture.image
        if shown is not None:
            yield shown

    return decode(), rates[0]
