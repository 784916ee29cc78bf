"""Pictures coded as H.264 in memory: a few of them in little room, of which any can be read again, in any order."""

from __future__ import annotations

import io
from collections import OrderedDict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import ExportError
from lipmotion.storage.media import LARGEST_BLOCK, MOST_PIXELS, bound_allocations, video_streams

Picture = NDArray[np.uint8]
Kind = Literal["video", "stills"]
"""``video``: frames in turn, colours at half the resolution, as cameras store them; ``stills``: full colours."""

GROUP = 12
"""Frames in a group that is decoded as a whole."""
GROUPS_IN_MEMORY = 2
"""Groups that are kept decoded: turning round at the end of a video decodes each of them once."""
SETTINGS: dict[Kind, tuple[str, str, str, str]] = {
    "video": ("libx264", "yuv420p", "14", "medium"),
    "stills": ("libx264rgb", "rgb24", "10", "slow"),
}
"""Encoder, format of the pictures, constant rate factor and preset (docs/results/video.md: size and PSNR)."""
RATE_HZ = 25
"""Pictures have numbers, not times; the container needs some rate."""
MOST_PICTURES = 20_000
"""More would fill the memory of whoever reads them all."""


@dataclass(frozen=True, eq=False)
class CodedVideo:
    """Pictures of one size.

    data  : an MP4 file with one stream of H.264 [shape=(B,)], uint8
    count : number of the pictures
    size  : their height and width, px; even in a ``video``
    """

    data: Picture
    count: int
    size: tuple[int, int]

    def __len__(self) -> int:
        return self.count

    def pictures(self) -> Picture:
        """Return all pictures [shape=(N, H, W, 3)], RGB. Raises ValueError: the data are damaged."""
        result = np.empty((self.count, *self.size, 3), np.uint8)
        for number, picture in enumerate(self.frames(range(self.count))):
            result[number] = picture
        return result

    def frames(self, order: Iterable[int]) -> Iterator[Picture]:
        """Yield pictures [shape=(H, W, 3)] in any order, by their numbers; they may repeat, and are not to be changed.

        ``GROUPS_IN_MEMORY`` · ``GROUP`` of them are in memory. Raises ValueError: no such number, or damaged data.
        """
        import av

        bound_allocations()
        groups: OrderedDict[int, list[Picture]] = OrderedDict()
        try:
            with av.open(io.BytesIO(self.data.tobytes()), format="mp4", options=_OPTIONS) as container:
                stream = next(iter(video_streams(container)), None)
                if stream is None or stream.codec_context is None or stream.codec_context.name != "h264":
                    raise ValueError("no pictures of H.264")
                stream.thread_type = "AUTO"
                for number in order:
                    if not 0 <= number < self.count:
                        raise ValueError(f"picture {number} of {self.count}")
                    group = number // GROUP
                    if group not in groups:
                        groups[group] = self._group(container, stream, group)
                    groups.move_to_end(group)
                    while len(groups) > GROUPS_IN_MEMORY:
                        groups.popitem(last=False)
                    yield groups[group][number % GROUP]
        except av.FFmpegError as error:
            raise ValueError(f"pictures cannot be decoded ({error.strerror})") from error

    def _group(self, container: Any, stream: Any, group: int) -> list[Picture]:
        """Return the pictures of one group. Raises ValueError: there are fewer, or of another size."""
        first, last = group * GROUP, min((group + 1) * GROUP, self.count)
        container.seek(_ticks(first, stream), stream=stream)
        found: list[Picture] = []
        for frame in container.decode(stream):
            number = first if frame.time is None else round(frame.time * RATE_HZ)
            if number < first:
                continue
            if (frame.height, frame.width) != self.size or number != first + len(found) or frame.is_corrupt:
                raise ValueError(f"picture {number} is damaged, or of {frame.width} × {frame.height} pixels")
            found.append(frame.to_ndarray(format="rgb24"))
            if len(found) == last - first:
                return found
        raise ValueError(f"{first + len(found)} pictures, required {self.count}")


_OPTIONS = {"max_pixels": str(MOST_PIXELS), "enable_drefs": "0", "protocol_whitelist": ""}


def encode_video(pictures: Iterable[Picture], kind: Kind) -> CodedVideo:
    """Return coded pictures; they are taken one at a time.

    pictures : of one size [each shape=(H, W, 3)], uint8, RGB; in a ``video`` of even height and width
    The same pictures give the same bytes on the same machine.
    Raises ExportError: no pictures, pictures of several sizes, or more than ``MOST_PICTURES``.
    """
    import av

    codec, pixels, factor, preset = SETTINGS[kind]
    file, count, size = io.BytesIO(), 0, (0, 0)
    options = {"crf": factor, "preset": preset, "bf": "0", "g": str(GROUP), "sc_threshold": "0", "threads": "1"}
    with av.open(file, "w", format="mp4") as container:
        stream = container.add_stream(codec, rate=RATE_HZ, options=options)
        stream.pix_fmt = pixels
        for count, picture in enumerate(pictures, 1):
            if count == 1:
                size = picture.shape[0], picture.shape[1]
                stream.height, stream.width = size
            if picture.shape != (*size, 3) or picture.dtype != np.uint8 or count > MOST_PICTURES:
                raise ExportError(
                    f"picture {count} is {picture.dtype} {picture.shape}, required uint8 {(*size, 3)}, at most "
                    f"{MOST_PICTURES} of them"
                )
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")
            frame.pts = count - 1
            container.mux(stream.encode(frame))
        if not count:
            raise ExportError("there are no pictures to store")
        container.mux(stream.encode(None))
    return CodedVideo(np.frombuffer(file.getvalue(), np.uint8), count, size)


LARGEST_CODED = LARGEST_BLOCK
"""Most bytes of coded pictures."""


def _ticks(number: int, stream: Any) -> int:
    return int(number / RATE_HZ / stream.time_base)
