"""Pictures in an array of an archive: H.264 without a container, of which any group can be decoded alone."""

from __future__ import annotations

from bisect import bisect_right
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, cached_property
from itertools import chain, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, ModelFormatError
from lipmotion.storage.schema import Arrays, ArraySpec, check_arrays, format_errors, refuse_undeclared
from lipmotion.storage.sources import MAX_PIXELS, bound_allocations

Frame = NDArray[np.uint8]
Stream = NDArray[np.uint8]
ReadFrames = Callable[[int, int], Iterable[Frame]]

MAX_DECODED_BYTES = 160 * 2**20
"""Decoded frames that are kept, bytes; those of two groups are kept however large they are."""


class FrameGroups:
    """Any frame of a video that is decoded group by group; the groups used last are kept.

    read   : returns the frames of a group, from the first (included) to the last (excluded), in order
    starts : first frame of each group, rising from 0, and the number of all frames at the end
    max_bytes : decoded frames that are kept, beside those of the last two groups
    Not for several threads.
    """

    def __init__(self, read: ReadFrames, starts: Sequence[int], max_bytes: int = MAX_DECODED_BYTES) -> None:
        self._read = read
        self._starts = list(starts)
        self._max_bytes = max_bytes
        self._groups: OrderedDict[int, list[Frame]] = OrderedDict()

    def __len__(self) -> int:
        return self._starts[-1]

    @property
    def nbytes(self) -> int:
        """Bytes of the decoded frames that are kept."""
        return sum(frame.nbytes for group in self._groups.values() for frame in group)

    def decode(self, index: int) -> Frame:
        """Return a frame: uint8 array [shape=(H, W, 3)], which is not to be changed.

        Raises IndexError: there is no such frame. Raises the errors of reading.
        """
        if not 0 <= index < len(self):
            raise IndexError(f"frame {index} of {len(self)}")
        group = bisect_right(self._starts, index) - 1
        if group not in self._groups:
            while len(self._groups) > 1:
                largest = max(sum(frame.nbytes for frame in frames) for frames in self._groups.values())
                if (len(self._groups) + 1) * largest <= self._max_bytes:
                    break
                self._groups.popitem(last=False)
            self._groups[group] = list(self._read(self._starts[group], self._starts[group + 1]))
        self._groups.move_to_end(group)
        return self._groups[group][index - self._starts[group]]


VIDEO_CRF = 18.0  # quality of a stored background: x264's constant rate factor, 0 (lossless) to 51; smaller is better
PICTURES_CRF = 12.0  # quality of stored pictures of mouths
GROUP = 8  # frames of a stored video that are decoded together
PICTURE_GROUP = 250  # pictures of a stack, all of which are decoded at once, that are coded together at most
MAX_FRAMES = 100_000  # most frames of a stored video: an hour
MAX_PICTURE_BYTES = 1 << 29  # most bytes of a stack of decoded pictures
_BT601, _LIMITED_RANGE = 5, 1
_DELIMITER, _PARAMETERS = 9, 7  # types of the unit that begins every frame, and of the one that begins every group


@dataclass(frozen=True, eq=False)
class StoredVideo:
    """A video in an array, frame n at n / rate_hz seconds.

    data    : a stream of H.264 in bytes (ITU-T H.264, annex B); every frame begins with a delimiter, every group with
              parameters, and frames are coded in the order in which they are shown [shape=(bytes,)]
    rate_hz : frame rate
    size    : height and width, px
    count   : number of frames
    Raises ModelFormatError: not such a stream, or of another number of frames.
    """

    data: Stream
    rate_hz: float
    size: tuple[int, int]
    count: int

    def __post_init__(self) -> None:
        with format_errors("the stored video", _REMEDY):
            count = len(self._layout[0]) - 1
            if count != self.count or not 1 <= self.count <= MAX_FRAMES:
                raise ValueError(f"{count} frames, required {self.count}, at least 1 and at most {MAX_FRAMES}")

    def __len__(self) -> int:
        return self.count

    @cached_property
    def _layout(self) -> tuple[list[int], list[int]]:
        return _read_layout(self.data)

    def open_groups(self) -> FrameGroups:
        """Return access to any frame, each uint8 RGB [shape=(H, W, 3)]; memory does not grow with the video's length.

        Reading a frame raises ModelFormatError: it is damaged.
        """
        return FrameGroups(self._decode_range, self._layout[1])

    def decode(self, order: Iterable[int]) -> Iterator[Frame]:
        """Yield frames by their numbers, in any order; as ``open_groups``."""
        groups = self.open_groups()
        return (groups.decode(index) for index in order)

    def _decode_range(self, start: int, stop: int) -> list[Frame]:
        begins = self._layout[0]
        pictures = list(_decode(self.data, begins[start : stop + 1], self.size))
        if len(pictures) != stop - start:
            raise ModelFormatError(
                f"the stored video is damaged ({len(pictures)} of {stop - start} frames from {start} on can be "
                f"decoded); {_REMEDY}"
            )
        return pictures


def encode_video(frames: Iterable[Frame], rate_hz: float, *, crf: float = VIDEO_CRF, group: int = GROUP) -> StoredVideo:
    """Return a video whose frames can be read in any order.

    frames  : uint8 RGB [shape=(H, W, 3)], all of one size, at least one; taken one at a time
    crf     : quality, 0 (best) to 51
    group   : frames that are decoded together; fewer take more bytes and less time to reach one of them
    Colours are stored at half the resolution (4:2:0), as in almost every video that a camera wrote.
    Raises InputError: no frames, frames of several sizes, no such quality.
    """
    if not 0 < rate_hz < float("inf"):
        raise InputError(f"a video of {rate_hz} frames a second, required more than 0")
    iterator = iter(frames)
    first = next(iterator, None)
    if first is None:
        raise InputError("a video of no frames, required at least one")
    parts = list(_encode(chain([first], iterator), crf, group, "yuv420p"))
    data = np.frombuffer(b"".join(parts), np.uint8)
    return StoredVideo(data, float(rate_hz), (first.shape[0], first.shape[1]), len(parts))


def encode_pictures(pictures: Frame, crf: float = PICTURES_CRF) -> Stream:
    """Return a stack of pictures in few bytes [shape=(bytes,)].

    pictures : uint8 RGB [shape=(N, H, W, 3)], at least one; each is smaller where it resembles the one before
    crf      : quality, 0 (best) to 51
    Colours are stored at full resolution (4:4:4).
    Raises InputError: not pictures, or no such quality.
    """
    if pictures.ndim != 4 or not len(pictures):
        raise InputError(f"pictures of shape {pictures.shape}, required (N, H, W, 3), at least one")
    if pictures.nbytes > MAX_PICTURE_BYTES:
        raise InputError(f"pictures of {pictures.nbytes} bytes, required at most {MAX_PICTURE_BYTES}; give fewer")
    return np.frombuffer(b"".join(_encode(pictures, crf, PICTURE_GROUP, "yuv444p")), np.uint8)


def decode_pictures(data: Stream) -> Frame:
    """Return the pictures of ``encode_pictures`` [shape=(N, H, W, 3)]. Raises ModelFormatError: they are damaged."""
    with format_errors("the stored pictures", _REMEDY, verb="are"):
        begins, _ = _read_layout(data)
        decoded = _decode(data, begins, None)
        first = next(decoded, None)
        count = len(begins) - 1
        if first is None or count * first.nbytes > MAX_PICTURE_BYTES:
            raise ValueError(f"{count} pictures of {first.nbytes if first is not None else 0} bytes")
        pictures = np.empty((count, *first.shape), np.uint8)
        decoded_count = 0
        for picture in chain([first], decoded):
            if decoded_count == count or picture.shape != first.shape:
                raise ValueError("pictures of several sizes, or more of them than begin")
            pictures[decoded_count] = picture
            decoded_count += 1
        if decoded_count != count:
            raise ValueError(f"{decoded_count} of {count} pictures can be decoded")
        return pictures


def stored_video_to_arrays(video: StoredVideo) -> dict[str, NDArray[Any]]:
    """Serialise a video."""
    return {
        "data": video.data,
        "rate_hz": np.array(video.rate_hz),
        "size": np.array(video.size),
        "count": np.array(video.count),
    }


def stored_video_from_arrays(arrays: Arrays) -> StoredVideo:
    """Deserialise a video. Raises ModelFormatError: an array is missing, unknown, or has a wrong shape or range."""
    with format_errors("the stored video", _REMEDY):
        refuse_undeclared(arrays, STORED_VIDEO)
        stored = check_arrays(arrays, STORED_VIDEO)
        height, width = stored["size"].tolist()
        if height * width > MAX_PIXELS:
            raise ValueError(f"frames of {width} × {height} pixels, required at most {MAX_PIXELS} in all")
        return StoredVideo(stored["data"], float(stored["rate_hz"]), (height, width), int(stored["count"]))


STORED_VIDEO = {
    "data": ArraySpec(np.uint8, "B", 0, 255),
    "rate_hz": ArraySpec(np.float64, "", 1, 1000),
    "size": ArraySpec(np.intp, "2", 1, 10_000),
    "count": ArraySpec(np.intp, "", 1, MAX_FRAMES),
}
"""The arrays of a stored video."""

_REMEDY = "build the file again, or download it again"


@cache
def read_x264() -> str:
    """Return the parameter of x264 that limits its instructions, after a colon; empty on processors without AVX-512.

    With AVX-512 it writes other bytes now and then for pictures under 100 px (3 videos of 100), with AVX2 it does not,
    at the same speed, and for larger pictures in the same bytes.
    """
    features = np.show_config(mode="dicts")["SIMD Extensions"]["found"]
    return ":asm=avx2" if any(name.startswith(("AVX512", "X86_V4")) for name in features) else ""


def _encode(frames: Iterable[Frame], crf: float, group: int, pixel_format: str) -> Iterator[bytes]:
    import av

    if not 0 <= crf <= 51 or group < 1:
        raise InputError(f"quality {crf:g} and groups of {group}, required 0 to 51, and at least 1")
    context: Any = None
    shape: tuple[int, ...] = ()
    for n, frame in enumerate(frames):
        if context is None:
            shape = frame.shape
            if frame.ndim != 3 or shape[2] != 3 or not frame.size:
                raise InputError(f"a picture of shape {shape}, required (H, W, 3)")
            if shape[0] * shape[1] > MAX_PIXELS:
                raise InputError(f"a picture of shape {shape}, required at most {MAX_PIXELS} pixels; scale the video")
            context = av.CodecContext.create("libx264", "w")
            step = 2 if pixel_format == "yuv420p" else 1
            context.height, context.width = (-(-side // step) * step for side in shape[:2])
            context.pix_fmt, context.time_base = pixel_format, Fraction(1, 25)
            context.colorspace, context.color_range = _BT601, _LIMITED_RANGE
            groups = f"keyint={group}:min-keyint={group}:scenecut=0:bframes=0:aud=1:repeat-headers=1:threads=1"
            context.options = {"crf": f"{crf:g}", "preset": "medium", "x264-params": groups + read_x264()}
        if frame.shape != shape or frame.dtype != np.uint8:
            raise InputError(f"frame {n} is {frame.dtype} {frame.shape}, required uint8 {shape} as the first")
        rest = (context.height - shape[0], context.width - shape[1])
        padded = np.pad(frame, ((0, rest[0]), (0, rest[1]), (0, 0)), mode="edge") if any(rest) else frame
        picture = av.VideoFrame.from_ndarray(np.ascontiguousarray(padded), format="rgb24")
        picture = picture.reformat(format=pixel_format, dst_colorspace=_BT601, dst_color_range=_LIMITED_RANGE)
        picture.pts = n
        yield from map(bytes, context.encode(picture))
    yield from map(bytes, context.encode(None))


def _read_layout(data: Stream) -> tuple[list[int], list[int]]:
    """Return where each frame begins, and the end; and the first frame of each group, and the number of frames."""
    if data.ndim != 1 or data.dtype != np.uint8 or len(data) < 8:
        raise ValueError(f"a stream of shape {data.shape} and type {data.dtype}, required bytes")
    starts = np.flatnonzero((data[:-3] == 0) & (data[1:-2] == 0) & (data[2:-1] == 1))
    types = data[starts + 3] & 31
    frames = starts[types == _DELIMITER]
    parameters = starts[types == _PARAMETERS]
    if not len(frames) or not len(parameters) or starts[0] > 1 or types[0] != _DELIMITER or parameters[0] > 64:
        raise ValueError("no stream of H.264 with delimiters and parameters")
    begins = np.maximum(frames - 1, 0)  # a start code may have a zero before it
    groups = np.unique(np.searchsorted(frames, parameters, side="right") - 1)
    return [*begins.tolist(), len(data)], [*groups.tolist(), len(frames)]


def _decode(data: Stream, begins: Sequence[int], size: tuple[int, int] | None) -> Iterator[Frame]:
    """Yield the frames of some groups. ``size`` : the size required. Raises ModelFormatError: they are damaged."""
    import av

    bound_allocations()
    context: Any = av.CodecContext.create("h264", "r")
    context.options = {"max_pixels": str(MAX_PIXELS), "err_detect": "explode"}
    context.thread_count = 1
    try:
        for packet in chain((av.Packet(data[start:stop].tobytes()) for start, stop in pairwise(begins)), [None]):
            for picture in context.decode(packet):
                height, width = size or (picture.height, picture.width)
                if picture.is_corrupt or not (0 <= picture.height - height <= 1 and 0 <= picture.width - width <= 1):
                    written = f"{picture.width} × {picture.height}"
                    raise ValueError(f"a picture of {written} pixels, required {width} × {height}")
                rgb = picture.reformat(format="rgb24", src_colorspace=_BT601, src_color_range=_LIMITED_RANGE)
                yield rgb.to_ndarray()[:height, :width]
    except (av.FFmpegError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ModelFormatError(f"the stored pictures are damaged ({reason}); {_REMEDY}") from error
