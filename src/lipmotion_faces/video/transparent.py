"""Videos that may be transparent, ``.webm`` and ``.mov``, and numbered pictures, ``frame%05d.png``."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from fractions import Fraction
from heapq import merge
from itertools import chain
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import ExportError
from lipmotion.storage.files import atomic_file
from lipmotion.types import Audio
from lipmotion_faces.video.mp4 import frame_rate

Frame = NDArray[np.uint8]

SOUND_HZ = 48_000
_BT709, _LIMITED_RANGE = 1, 1


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
    Raises ExportError: another suffix, no frames, unsuitable frames, no sound, fps not positive, or the file cannot be
    written.
    """
    if path.suffix.lower() not in _CONTAINERS:
        raise ExportError(f"{path}: required one of: {' '.join(_CONTAINERS)}")
    if not 0 < fps < np.inf:
        raise ExportError(f"{path}: the frame rate is {fps}, required more than 0")
    if not len(audio.samples):
        raise ExportError(f"{path}: the sound has no samples")
    with atomic_file(path) as temporary:
        _encode(temporary, path, _checked(frames, path), frame_rate(fps), audio)


def write_pictures(path: Path, frames: Iterable[Frame]) -> None:
    """Write frames as numbered pictures; a name like ``frame%05d.png`` says where the number, from 0 on, is put.

    frames : RGB or RGBA with straight alpha [shape=(H, W, 3 or 4)], at least one; taken one at a time
    Each file is whole or not there. Raises ExportError: no frames, unsuitable frames, or a file cannot be written.
    """
    from PIL import Image

    for number, frame in enumerate(_checked(frames, path)):
        with atomic_file(path.with_name(path.name % number)) as temporary:
            Image.fromarray(frame).save(temporary, compress_level=4)


def _checked(frames: Iterable[Frame], path: Path) -> Iterator[Frame]:
    """Yield the frames. Raises ExportError: there are none, or one has another type or size than required."""
    shape: tuple[int, ...] | None = None
    for n, frame in enumerate(frames):
        shape = shape or frame.shape
        even = len(shape) == 3 and shape[2] in (3, 4) and not (shape[0] % 2 or shape[1] % 2)
        if frame.shape != shape or frame.dtype != np.uint8 or not even:
            raise ExportError(
                f"{path}: frame {n} is {frame.dtype} {frame.shape}, required uint8 RGB or RGBA of even sizes, all alike"
            )
        yield frame
    if shape is None:
        raise ExportError(f"{path}: there are no frames to write")


def _encode(temporary: Path, path: Path, frames: Iterator[Frame], rate: Fraction, audio: Audio) -> None:
    import av

    codecs, first = _CONTAINERS[path.suffix.lower()], next(frames)
    pixels = codecs.transparent if first.shape[2] == 4 else codecs.opaque
    try:
        with av.open(str(temporary), "w", format=codecs.container) as container:
            video = container.add_stream(codecs.video, rate=rate, options=codecs.video_options)
            video.height, video.width = first.shape[:2]
            video.pix_fmt = pixels
            context = video.codec_context
            context.time_base, context.thread_count = 1 / rate, os.cpu_count() or 1
            context.colorspace = context.color_primaries = context.color_trc = _BT709
            context.color_range = _LIMITED_RANGE
            sound = container.add_stream(codecs.sound, rate=SOUND_HZ, layout="mono")
            pictures = ((n / rate, video, _picture(f, n, rate, pixels)) for n, f in enumerate(chain([first], frames)))
            sounds = ((part.pts * part.time_base, sound, part) for part in _sound_parts(audio, codecs.sound_format))
            for _, stream, part in merge(pictures, sounds, key=itemgetter(0)):
                container.mux(stream.encode(part))
            for stream in (video, sound):
                container.mux(stream.encode(None))
    except av.FFmpegError as error:
        if isinstance(error, OSError):  # a full disk
            raise
        raise ExportError(f"{path}: cannot be encoded: {error}") from error


def _picture(frame: Frame, n: int, rate: Fraction, pixels: str) -> Any:
    from av import VideoFrame

    picture = VideoFrame.from_ndarray(np.ascontiguousarray(frame), format="rgba" if frame.shape[2] == 4 else "rgb24")
    picture = picture.reformat(format=pixels, dst_colorspace="itu709")
    picture.pts, picture.time_base = n, 1 / rate
    return picture


def _sound_parts(audio: Audio, kind: str) -> Iterator[Any]:
    """Yield the sound at ``SOUND_HZ`` in parts of a tenth of a second."""
    from av import AudioFrame, AudioResampler

    resampler = AudioResampler(format=kind, layout="mono", rate=SOUND_HZ)
    length = max(1, audio.rate_hz // 10)
    for start in range(0, len(audio.samples), length):
        samples = np.ascontiguousarray(audio.samples[None, start : start + length], dtype=np.float32)
        part = AudioFrame.from_ndarray(samples, format="fltp", layout="mono")
        part.rate, part.pts, part.time_base = audio.rate_hz, start, Fraction(1, audio.rate_hz)
        yield from resampler.resample(part)
    yield from resampler.resample(None)
