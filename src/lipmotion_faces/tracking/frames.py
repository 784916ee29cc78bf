"""Decoding of a video into pictures with their times, and resampling of what is found in them to a constant rate."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.storage.sources import MAX_PIXELS, check_source, list_video, open_media, read_duration
from lipmotion_faces.tracking.packages import import_opencv


@dataclass(frozen=True, eq=False)
class VideoFrame:
    """A picture, RGB, upright, square pixels [shape=(H, W, 3)], and its time since the container's or span's start."""

    time_s: float
    image: NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class OpenVideo:
    """An open video."""

    frames: Iterator[VideoFrame]
    stated_rates_hz: tuple[float, ...]  # the frame rates that the container states, the most reliable first
    stated_s: float  # the duration that the container states, 0 if none
    damage: list[str]  # a reason for every packet or picture that was left out so far


@dataclass(frozen=True)
class VideoSpan:
    """A part of a video, from ``start_s`` (included) to ``end_s`` (excluded), s since the container's start."""

    start_s: float = 0.0
    end_s: float = float("inf")


WHOLE = VideoSpan()
SEEK_MARGIN_S = 1.0
"""Decoding starts at the key frame before the span by this much: containers that seek by the time of decoding are late
by the pictures that wait for others."""
REORDERED = ("h264", "hevc", "mpeg4")
"""Codecs that may store pictures in another order: an AVI holds no times to show them, and FFmpeg guesses wrong."""
ROUNDING_S = 1e-4  # a picture belongs to a span that begins this much later: times of the container are whole ticks
GOES_BACK = "times that go back, as in files joined end to end"
SHORT_S = 0.5  # pictures that end more than this before the stated duration are reported
MIN_SIDE_PX, LONGEST_SIDE_PX = 16, 8192
"""Bounds of a picture's width and height, px: a smaller one shows no face, a larger one fills the memory."""


@contextmanager
def open_video(path: Path, span: VideoSpan = WHOLE, *, longest_px: int | None = None) -> Iterator[OpenVideo]:
    """Open the first video stream of a file; memory use does not grow with its length.

    span       : the part that is wanted, which the times and the duration then refer to; it is sought in the file
    longest_px : reduce larger pictures to this while they are converted, for a quick look; decode in several threads
    Time 0 is the container's start, as in ``speech.sound.audio_files``, so sound and picture agree.
    Raises InputError: no such file, empty, not a video, no video stream, or no picture that can be decoded (in a span
    there may be none).
    Packets and pictures that are damaged later are left out, and listed in ``OpenVideo.damage``.
    """
    import av

    check_source(path, "video")
    try:
        container = open_media(path)
    except (av.FFmpegError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: not a readable video ({reason}); give a video file") from error
    with container:
        stream = next(iter(list_video(container)), None)
        if stream is None:
            raise InputError(f"{path}: has no video stream; give a video that shows the speaker's face")
        if stream.codec_context is None:
            raise InputError(f"{path}: its pictures are coded in an unknown way; export the video again")
        _check_size(path, stream.width, stream.height, float(stream.sample_aspect_ratio or 1))
        stream.codec_context.options = {"max_pixels": str(MAX_PIXELS)}
        rates = [float(rate) for rate in (stream.guessed_rate, stream.average_rate) if rate]
        damage: list[str] = []
        stated_s = read_duration(container, stream)
        if span != WHOLE:
            stated_s = max(min(stated_s, span.end_s) - span.start_s, 0.0)
        if longest_px is not None:
            stream.thread_type = "AUTO"
        frames = _decode_frames(container, stream, path, span, longest_px, damage)
        with closing(frames):  # decoding from a closed container would crash
            yield OpenVideo(frames, tuple(rates), stated_s, damage)


def read_stated_duration(path: Path) -> float:
    """Return the duration that a video states, s; 0 if it states none, has no pictures or cannot be read."""
    import av

    try:
        with open_media(path) as container:
            streams = list_video(container)
            return read_duration(container, streams[0]) if streams else 0.0
    except (av.FFmpegError, ValueError, OSError):
        return 0.0


def damage_notes(video: OpenVideo, times_s: NDArray[np.float64], rate_hz: float) -> list[str]:
    """Return notes on pictures that cannot be decoded or are missing at the end; ``video`` was read to its end."""
    notes = []
    end_s = float(times_s[-1]) + 1 / rate_hz
    if video.damage:
        expected = max(round(max(video.stated_s, end_s) * rate_hz), len(times_s) + video.damage.count(GOES_BACK))
        why = f" ({GOES_BACK})" if GOES_BACK in video.damage else ""
        notes.append(f"damaged: {len(times_s)} of about {expected} frames can be used{why}")
    if end_s < video.stated_s - SHORT_S:
        notes.append(f"cut short: pictures up to {end_s:.2f} s of {video.stated_s:.2f} s")
    return notes


def _decode_frames(
    container: Any, stream: Any, path: Path, span: VideoSpan, longest_px: int | None, damage: list[str]
) -> Generator[VideoFrame, None, None]:
    start_s = (container.start_time or 0) / 1e6
    pixel_shape = float(stream.sample_aspect_ratio or 1)
    last_s = float("-inf")
    for picture in _decode_pictures_from(container, stream, start_s + span.start_s - ROUNDING_S, damage):
        if picture.time is None or picture.time - start_s <= last_s:  # it has no time, or one that another picture has
            damage += [] if picture.time is None or picture.time - start_s > last_s - ROUNDING_S else [GOES_BACK]
            continue
        last_s = max(picture.time - start_s, span.start_s)
        if last_s >= span.end_s - ROUNDING_S:
            break
        _check_size(path, picture.width, picture.height, pixel_shape)
        width, height = round(picture.width * pixel_shape), picture.height
        if longest_px is not None and max(width, height) > longest_px:
            scale = longest_px / max(width, height)
            width, height = max(1, round(width * scale)), max(1, round(height * scale))
        image: NDArray[np.uint8] = picture.to_ndarray(format="rgb24", width=width, height=height)
        if quarter_turns := round(picture.rotation / 90) % 4:
            cv2 = import_opencv()
            turns = cv2.ROTATE_90_COUNTERCLOCKWISE, cv2.ROTATE_180, cv2.ROTATE_90_CLOCKWISE
            image = cv2.rotate(image, turns[quarter_turns - 1])
        yield VideoFrame(last_s - span.start_s, image)
    if last_s == float("-inf") and span == WHOLE:
        raise InputError(f"{path}: holds no picture that can be decoded; export the video again")


def _decode_pictures_from(container: Any, stream: Any, first_s: float, damage: list[str]) -> Iterator[Any]:
    """Yield the pictures from a time of the container's clock on; ``damage`` lists what is damaged from there on."""
    start_s = (container.start_time or 0) / 1e6
    if first_s <= start_s:
        yield from _decode_pictures(container, stream, damage)
        return
    for from_s in (max(first_s - SEEK_MARGIN_S, start_s), start_s):  # where seeking ends too late, from the beginning
        container.seek(int(from_s / stream.time_base), stream=stream)
        pictures = _decode_pictures(container, stream, damage)
        picture = next(pictures, None)
        if picture is not None and picture.time is not None and picture.time <= first_s:
            break
    while picture is not None and (picture.time is None or picture.time < first_s):
        picture = next(pictures, None)
    damage.clear()
    if picture is not None:
        yield picture
        yield from pictures


def _decode_pictures(container: Any, stream: Any, damage: list[str]) -> Iterator[Any]:
    import av

    packets, times = container.demux(stream), deque[int]()
    is_counted = container.format.name == "avi" and stream.codec_context.name in REORDERED
    while True:
        try:
            packet = next(packets)
            times += [packet.dts] if is_counted and packet.size and packet.dts is not None else []
            for picture in packet.decode():
                if times:
                    picture.pts = times.popleft()
                if picture.is_corrupt:
                    damage.append("a damaged picture")
                else:
                    yield picture
        except (StopIteration, av.EOFError):
            return
        except av.FFmpegError as error:
            times = deque(islice(times, 1, None))
            damage.append(str(error.strerror))


def _check_size(path: Path, width: int, height: int, pixel_shape: float) -> None:
    """Raise InputError for pictures that are too small or too large; ``pixel_shape``: width of a pixel over height."""
    if not width or not height:  # FFmpeg gives no size for pictures that it refuses
        raise InputError(f"{path}: pictures of no size, or of more than {MAX_PIXELS} pixels; scale the video")
    shown = round(width * pixel_shape)
    if not (MIN_SIDE_PX <= shown <= LONGEST_SIDE_PX and MIN_SIDE_PX <= height <= LONGEST_SIDE_PX):
        sides = f"{MIN_SIDE_PX} to {LONGEST_SIDE_PX}"
        raise InputError(f"{path}: pictures of {shown} × {height} pixels, required {sides}; scale the video")
    if shown * height > MAX_PIXELS:
        required = f"at most {MAX_PIXELS} in all"
        raise InputError(f"{path}: pictures of {shown} × {height} pixels, required {required}; scale the video")


Array = NDArray[np.float64]

RATE_TOLERANCE = 0.05
"""A frame rate that the container states is used when it differs from that of the time stamps by this share or less."""
TIME_TOLERANCE = 0.05
"""A frame this close to its nominal time, in frames, counts as on time: time stamps are often rounded to 1 ms."""
CUBIC_GAP = 4.0
"""Gaps of up to this many frames are interpolated by a cubic spline; in longer ones it could overshoot: linearly."""
RATE_WHEN_UNKNOWN_HZ = 25.0
LOWEST_HZ, HIGHEST_HZ = 1.0, 1000.0
"""Lowest and highest frame rate: lip motion needs more than the lowest, no camera is faster than the highest."""


def find_nominal_rate(times_s: Array, stated_rates_hz: Sequence[float]) -> float:
    """Return the constant rate of time stamps, though frames were dropped: the stated one that fits, or the median."""
    if len(times_s) < 2:
        return stated_rates_hz[0] if stated_rates_hz else RATE_WHEN_UNKNOWN_HZ
    measured = 1.0 / float(np.median(np.diff(times_s)))
    fitting = [rate for rate in stated_rates_hz if abs(rate / measured - 1) <= RATE_TOLERANCE]
    return fitting[0] if fitting else measured


def check_rate(rate_hz: float, path: Path) -> None:
    """Raise InputError for a frame rate that no video of a face has: its time stamps are wrong."""
    if not LOWEST_HZ <= rate_hz <= HIGHEST_HZ:
        raise InputError(
            f"{path}: {rate_hz:g} pictures a second, required {LOWEST_HZ:g} to {HIGHEST_HZ:g}; export the video again"
        )


def count_frames(times_s: Array, rate_hz: float) -> int:
    """Return how many frames at a constant rate, the first at 0 s, there are up to the last time."""
    return round(float(times_s[-1]) * rate_hz) + 1


def find_nearest(times_s: Array, wanted_s: Array) -> NDArray[np.intp]:
    """Return the index of the time nearest to each wanted time [shape=(len(wanted_s),)]."""
    after = np.clip(np.searchsorted(times_s, wanted_s), 1, max(len(times_s) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(times_s) - 1)
    return np.where(wanted_s - times_s[before] <= times_s[after] - wanted_s, before, after)


def resample_to_constant_rate(times_s: Array, values: Array, rate_hz: float, count: int) -> Array:
    """Return the values at the times n / rate_hz.

    times_s : array [shape=(S,)], rising
    values  : array [shape=(S, P)]
    count   : of frames returned
    Returns array [shape=(count, P)]: frames that are on time unchanged, others by a cubic spline through all (linear in
    long gaps), constant before the first and after the last.
    """
    from scipy.interpolate import CubicSpline

    wanted_s = np.clip(np.arange(count) / rate_hz, times_s[0], times_s[-1])
    index = find_nearest(times_s, wanted_s)
    result: Array = values[index].copy()
    after = np.clip(np.searchsorted(times_s, wanted_s), 1, max(len(times_s) - 1, 1))
    moved = np.abs(times_s[index] - wanted_s) * rate_hz > TIME_TOLERANCE
    if not moved.any():
        return result
    wide = moved & ((times_s[after] - times_s[after - 1]) * rate_hz > CUBIC_GAP)
    result[moved] = CubicSpline(times_s, values)(wanted_s[moved])
    share = ((wanted_s - times_s[after - 1]) / (times_s[after] - times_s[after - 1]))[wide, None]
    result[wide] = (1 - share) * values[after[wide] - 1] + share * values[after[wide]]
    return result
