"""Videos that may be transparent, ``.webm`` and ``.mov``, and numbered pictures, ``frame%05d.png``."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from fractions import Fraction
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import ExportError
from lipmotion.storage.files import atomic_file
from lipmotion.types import Audio
from lipmotion_faces.video.mp4 import SOUND_HZ, check_frames, frame_rate, mux_streams, open_output, sound_parts

Frame = NDArray[np.uint8]

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
        _encode(temporary, path, check_frames(frames, path, "RGB or RGBA", _is_even), frame_rate(fps), audio)


def write_pictures(path: Path, frames: Iterable[Frame]) -> None:
    """Write frames as numbered pictures; a name like ``frame%05d.png`` says where the number, from 0 on, is put.

    frames : RGB or RGBA with straight alpha [shape=(H, W, 3 or 4)], at least one; taken one at a time
    Each file is whole or not there. Raises ExportError: no frames, unsuitable frames, or a file cannot be written.
    """
    from PIL import Image

    for number, frame in enumerate(check_frames(frames, path, "RGB or RGBA", _is_even)):
        with atomic_file(path.with_name(path.name % number)) as temporary:
            Image.fromarray(frame).save(temporary, compress_level=4)


def _is_even(shape: tuple[int, ...]) -> bool:
    return len(shape) == 3 and shape[2] in (3, 4) and not (shape[0] % 2 or shape[1] % 2)


def _encode(temporary: Path, path: Path, frames: Iterator[Frame], rate: Fraction, audio: Audio) -> None:
    from av import AudioResampler, VideoFrame

    codecs, first = _CONTAINERS[path.suffix.lower()], next(frames)
    has_alpha = first.shape[2] == 4
    pixels = codecs.transparent if has_alpha else codecs.opaque
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

        def convert(frame: Frame) -> Any:
            picture = VideoFrame.from_ndarray(np.ascontiguousarray(frame), format="rgba" if has_alpha else "rgb24")
            return picture.reformat(format=pixels, dst_colorspace="itu709")

        parts = (part for sound_part in chain(sound_parts(audio), [None]) for part in resampler.resample(sound_part))
        mux_streams(container, video, map(convert, chain([first], frames)), rate, sound, parts)
