"""Video files: ``.mp4`` (H.264, AAC), which all players play; ``.webm``, ``.mov`` and pictures, also transparent."""

from __future__ import annotations

import os
import struct
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from fractions import Fraction
from heapq import merge
from itertools import chain
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import ExportError
from lipmotion.storage.files import as_text, atomic_file
from lipmotion.types import Audio
from lipmotion_faces.coded_video import read_x264

XMP_UUID = bytes.fromhex("be7acfcb97a942e89c71999491e3afac")
"""What says that a box of type ``uuid`` holds XMP (Adobe, XMP Specification Part 3)."""
LARGEST_PACKET_BYTES = 1 << 24  # most bytes of a packet, which programs read into the memory as a whole


def append_xmp(path: Path, packet: str) -> None:
    """Append a packet to an mp4 file; nothing in the file moves, so all its offsets remain valid.

    Raises ExportError: the file does not consist of whole boxes, or the packet is too large.
    """
    content = packet.encode()
    if len(content) > LARGEST_PACKET_BYTES:
        raise ExportError(f"{path}: XMP metadata of {len(content)} bytes, at most {LARGEST_PACKET_BYTES} are possible")
    with path.open("r+b") as file:
        size, end = file.seek(0, os.SEEK_END), 0
        while end + 8 <= size:  # the outermost boxes
            file.seek(end)
            (length,) = struct.unpack(">I4x", file.read(8))
            if length == 1 and end + 16 <= size:
                length = struct.unpack(">Q", file.read(8))[0]
            if length < file.tell() - end:  # 0: until the end of the file, so nothing may follow; others: damaged
                break
            end += length
        if not end or end != size:
            raise ExportError(f"{path}: {size} bytes that are not whole boxes of an mp4 file; write the video again")
        file.seek(size)
        file.write(struct.pack(">I4s", 24 + len(content), b"uuid") + XMP_UUID + content)


Frame = NDArray[np.uint8]

SOUND_HZ = 48_000
"""Sampling rate. AAC begins with 1,024 samples of silence, which some players do not skip: 21 ms at this rate."""
TAGS = frozenset(
    "title artist album_artist composer album date comment genre copyright grouping lyrics description synopsis show "
    "episode_id network keywords".split()
)
"""Tags that an mp4 file can hold; FFmpeg would leave out all others without a word."""
_BT601, _BT709, _LIMITED_RANGE = 6, 1, 1
_ENCODER = {"preset": "superfast", "crf": "18", "threads": "4", "x264-params": "mbtree=1:rc-lookahead=10:bframes=0"}
"""Chosen by measuring (docs/results/video.md): half of the time of ``veryfast`` at the same PSNR and SSIM. Frames that
are predicted from both sides (bframes) smooth what changes from frame to frame. The number of threads is fixed because
the bytes depend on it: so they do not depend on the number of processors."""


def write_mp4(
    path: Path,
    frames: Iterable[Frame],
    *,
    fps: float,
    audio: Audio,
    tags: Mapping[str, str] | None = None,
    xmp: str | None = None,
) -> None:
    """Write a video with sound; frame n is shown at ``n / fps`` seconds, the sound starts at 0.

    frames : RGB [shape=(H, W, 3)], even sizes, at least one; taken one at a time
    fps    : 23.976, 29.97 and 59.94 stand for 24000/1001, 30000/1001 and 60000/1001
    tags   : metadata that players show, by names of ``TAGS``
    xmp    : metadata for programs, as an XMP packet (``synthetic_mark``)
    Neither stream is cut to the length of the other. After a failure there is no partial file. The same input gives
    the same bytes on the same machine, with the same version of FFmpeg.
    Raises ExportError: no frames, frames of odd or different sizes, no sound, fps not positive, an unknown tag, or the
    file cannot be written.
    """
    import av

    rate = check_rate_and_sound(path, fps, audio)
    if unknown := set(tags or ()) - TAGS:
        raise ExportError(f"{path}: unknown tags {', '.join(sorted(unknown))}; known: {', '.join(sorted(TAGS))}")
    converter = av.video.reformatter.VideoReformatter()  # to make one for every frame takes as long as to use it

    def convert(frame: Frame) -> Any:
        picture = av.VideoFrame.from_ndarray(np.ascontiguousarray(frame), format="rgb24")
        return converter.reformat(picture, format="yuv420p", dst_colorspace="itu601")

    with atomic_file(path) as temporary:
        checked = check_frames(frames, path, (3,))
        first = next(checked)
        with open_output(temporary, path, format="mp4", options={"movflags": "+faststart"}) as container:
            container.metadata.update({name: as_text(text) for name, text in (tags or {}).items()})
            options = _ENCODER | {"x264-params": _ENCODER["x264-params"] + read_x264()}
            video = container.add_stream("libx264", rate=rate, options=options)
            video.height, video.width = first.shape[:2]
            video.pix_fmt = "yuv420p"
            context = video.codec_context
            context.time_base = 1 / rate
            context.colorspace, context.color_range = _BT601, _LIMITED_RANGE
            context.color_primaries = context.color_trc = _BT709
            sound = container.add_stream("aac", rate=SOUND_HZ, layout="mono", bit_rate=128_000)
            mux_streams(container, video, map(convert, chain([first], checked)), rate, sound, cut_sound(audio))
        if xmp is not None:
            append_xmp(temporary, xmp)


def check_rate_and_sound(path: Path, fps: float, audio: Audio) -> Fraction:
    """Return the exact frame rate. Raises ExportError: not positive, or there is no sound."""
    if not 0 < fps < np.inf:
        raise ExportError(f"{path}: the frame rate is {fps}, required more than 0")
    if not len(audio.samples):
        raise ExportError(f"{path}: the sound has no samples")
    return find_frame_rate(fps)


def find_frame_rate(fps: float) -> Fraction:
    """Return the exact frame rate that a decimal number stands for: 29.97 is 30000/1001."""
    for whole in (24, 30, 48, 60, 120):
        if abs(fps - whole / 1.001) < 0.005:
            return Fraction(whole * 1000, 1001)
    return Fraction(fps).limit_denominator(1001)


def check_frames(frames: Iterable[Frame], path: Path, channels: tuple[int, ...] = (3, 4)) -> Iterator[Frame]:
    """Yield the frames. Raises ExportError: none, or one of another type or size, or of odd sizes."""
    shape: tuple[int, ...] | None = None
    for n, frame in enumerate(frames):
        shape = shape or frame.shape
        is_even = len(shape) == 3 and shape[2] in channels and not (shape[0] % 2 or shape[1] % 2)
        if frame.shape != shape or frame.dtype != np.uint8 or not is_even:
            required = f"required uint8 {'RGB' if channels == (3,) else 'RGB or RGBA'} of even sizes, all alike"
            raise ExportError(f"{path}: frame {n} is {frame.dtype} {frame.shape}, {required}")
        yield frame
    if shape is None:
        raise ExportError(f"{path}: there are no frames to write")


@contextmanager
def open_output(temporary: Path, path: Path, **settings: Any) -> Iterator[Any]:
    """Open a file to encode into with settings of ``av.open``. Raises ExportError, naming ``path``: it fails."""
    import av

    try:
        with av.open(str(temporary), "w", **settings) as container:
            yield container
    except av.FFmpegError as error:
        if isinstance(error, OSError):  # a full disk
            raise
        raise ExportError(f"{path}: cannot be encoded: {error}") from error


def mux_streams(
    container: Any, video: Any, pictures: Iterable[Any], rate: Fraction, sound: Any, parts: Iterable[Any]
) -> None:
    """Encode pictures, numbered at a rate, and parts of sound into two streams, in the order of their times."""

    def number(n: int, picture: Any) -> tuple[Fraction, Any, Any]:
        picture.pts, picture.time_base = n, 1 / rate
        return n / rate, video, picture

    numbered = (number(n, picture) for n, picture in enumerate(pictures))
    timed = ((part.pts * part.time_base, sound, part) for part in parts)
    for _, stream, part in merge(numbered, timed, key=itemgetter(0)):
        container.mux(stream.encode(part))
    for stream in (video, sound):
        container.mux(stream.encode(None))


def cut_sound(audio: Audio) -> Iterator[Any]:
    """Yield the sound in parts of a tenth of a second, so that it is stored in the file near its frames."""
    from av import AudioFrame

    length = max(1, audio.rate_hz // 10)
    for start in range(0, len(audio.samples), length):
        samples = np.ascontiguousarray(audio.samples[None, start : start + length], dtype=np.float32)
        part = AudioFrame.from_ndarray(samples, format="fltp", layout="mono")
        part.rate, part.pts, part.time_base = audio.rate_hz, start, Fraction(1, audio.rate_hz)
        yield part


class _Codecs(NamedTuple):
    """How a container is encoded; pixel formats of opaque and of transparent pictures."""

    container: str
    video: str
    opaque: str
    transparent: str
    video_options: dict[str, str]
    sound: str
    sound_format: str


_WEBM = {"crf": "24", "b": "0", "deadline": "realtime", "cpu-used": "6", "row-mt": "1", "auto-alt-ref": "0"}
_CONTAINERS = {
    ".webm": _Codecs("webm", "libvpx-vp9", "yuv420p", "yuva420p", _WEBM, "libopus", "flt"),
    ".mov": _Codecs("mov", "prores_ks", "yuv444p10le", "yuva444p10le", {"profile": "4444"}, "pcm_s16le", "s16"),
}
"""VP9 with its transparency as a second stream, as browsers and OBS play it; ProRes 4444, as editors take it."""


def write_with_alpha(path: Path, frames: Iterable[Frame], *, fps: float, audio: Audio) -> None:
    """Write a ``.webm`` (VP9, Opus) or ``.mov`` (ProRes 4444, PCM); frame n is shown at ``n / fps`` seconds.

    frames : RGB or RGBA with straight alpha [shape=(H, W, 3 or 4)], even sizes, at least one; taken one at a time
    After a failure there is no partial file.
    Raises ExportError: another suffix; no or unsuitable frames; no sound; fps not positive; the file cannot be written.
    """
    from av import AudioResampler, VideoFrame

    codecs = _CONTAINERS.get(path.suffix.lower())
    if codecs is None:
        raise ExportError(f"{path}: required one of: {' '.join(_CONTAINERS)}")
    rate, checked = check_rate_and_sound(path, fps, audio), check_frames(frames, path)
    with atomic_file(path) as temporary:
        first = next(checked)
        has_alpha = first.shape[2] == 4
        pixels = codecs.transparent if has_alpha else codecs.opaque

        def convert(frame: Frame) -> Any:
            picture = VideoFrame.from_ndarray(np.ascontiguousarray(frame), format="rgba" if has_alpha else "rgb24")
            return picture.reformat(format=pixels, dst_colorspace="itu709")

        with open_output(temporary, path, format=codecs.container) as container:
            video = container.add_stream(codecs.video, rate=rate, options=codecs.video_options)
            video.height, video.width = first.shape[:2]
            video.pix_fmt = pixels
            context = video.codec_context
            context.time_base, context.thread_count = 1 / rate, os.cpu_count() or 1
            context.colorspace = context.color_primaries = context.color_trc = _BT709
            context.color_range = _LIMITED_RANGE
            sound = container.add_stream(codecs.sound, rate=SOUND_HZ, layout="mono")
            resampler = AudioResampler(format=codecs.sound_format, layout="mono", rate=SOUND_HZ)
            parts = (part for cut in chain(cut_sound(audio), [None]) for part in resampler.resample(cut))
            mux_streams(container, video, map(convert, chain([first], checked)), rate, sound, parts)


def write_pictures(path: Path, frames: Iterable[Frame]) -> None:
    """Write frames as numbered pictures; a name like ``frame%05d.png`` says where the number, from 0 on, is put.

    frames : RGB or RGBA with straight alpha [shape=(H, W, 3 or 4)], at least one; taken one at a time
    Each file is whole or not there. Raises ExportError: no frames, unsuitable frames, or a file cannot be written.
    """
    from PIL import Image

    for number, frame in enumerate(check_frames(frames, path)):
        with atomic_file(path.with_name(path.name % number)) as temporary:
            Image.fromarray(frame).save(temporary, compress_level=4)
