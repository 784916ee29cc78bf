"""Opening of recordings with FFmpeg, restricted to the one file."""

from __future__ import annotations

import ctypes
import re
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

MEDIA_FORMATS = (
    # sound
    "aac ac3 aiff amr amrnb amrwb ape au caf dsf dts dtshd eac3 flac g722 gsm ircam loas mlp mp3 mpc mpc8 nistsphere "
    "ogg oma pvf qcp qoa rso sds sln sox spdif tak truehd tta voc w64 wav wavarc wv xwma "
    # video, most of them with sound
    "apng asf asf_o avi dv dvd flv gif gxf h264 hevc ivf live_flv m4v matroska mjpeg mov mpeg mpegts mpegvideo mxf "
    "nut obu rm smjpeg wtv yuv4mpegpipe"
).split()
"""FFmpeg's names of the container formats whose content is in the file itself. All others are refused before they
open anything: playlists (hls, concat, dash, imf), indexes (vobsub), numbered pictures (image2), addresses (sdp, rtsp),
devices."""
LARGEST_BLOCK_BYTES = 1 << 28
"""Most bytes that FFmpeg may allocate at a time: three pictures of ``MAX_PIXELS`` with four channels of 16 bits."""
DURATION = re.compile(r"(\d{1,6}):(\d\d):(\d\d(?:\.\d{1,9})?)")
MAX_PIXELS = 4096 * 2304
"""Most pixels of a picture: slightly more than 4K. A decoder may keep sixteen pictures."""


@cache
def x264_instructions() -> str:
    """Return the parameter of x264 that limits its instructions, after a colon; empty on processors without AVX-512.

    With AVX-512 it writes other bytes now and then for pictures under 100 px (3 videos of 100), with AVX2 it does not,
    at the same speed, and for larger pictures in the same bytes.
    """
    import numpy as np

    features = np.show_config(mode="dicts")["SIMD Extensions"]["found"]
    return ":asm=avx2" if any(name.startswith(("AVX512", "X86_V4")) for name in features) else ""


def open_media(path: Path, *, content: Any = None) -> Any:
    """Return an open PyAV container, which the caller closes.

    content : an open file to read in its place, with its ``name``
    The name is always that of a file (in ``12:30.wav`` there is no protocol), and no other file is opened, whatever the
    content: FFmpeg itself refuses all other protocols, and all formats but ``MEDIA_FORMATS``.
    Raises ValueError: another format, or damaged. Raises the errors of PyAV.
    """
    import av

    bound_allocations()
    options = {
        "protocol_whitelist": "file",
        "format_whitelist": ",".join(MEDIA_FORMATS),
        "enable_drefs": "0",
        "max_pixels": str(MAX_PIXELS),
    }
    try:
        return av.open(f"file:{path}" if content is None else content, options=options)
    except av.ArgumentError as error:
        raise ValueError(
            "damaged, or of a format that is not read; playlists and indexes of other files are not followed"
        ) from error


@cache
def bound_allocations() -> None:
    """Limit FFmpeg's allocations to ``LARGEST_BLOCK_BYTES``, in the whole process: it trusts the sizes in headers."""
    import av._core

    with suppress(OSError, AttributeError):  # on systems where the module does not export the libraries' functions
        ctypes.CDLL(av._core.__file__).av_max_alloc(ctypes.c_size_t(LARGEST_BLOCK_BYTES))


def video_streams(container: Any) -> list[Any]:
    """Return the video streams of an open container, without album covers."""
    import av

    cover = av.stream.Disposition.attached_pic
    return [stream for stream in container.streams.video if not stream.disposition & cover]


def has_video(path: Path) -> bool:
    """Return whether a file can be opened and has a video stream."""
    import av

    try:
        with open_media(path) as container:
            return bool(video_streams(container))
    except (av.FFmpegError, ValueError, OSError):
        return False


def stated_duration_s(container: Any, stream: Any) -> float:
    """Return the duration of a stream that an open container states, in seconds; 0 if it states none.

    A stream without a duration of its own has that of the container; but as subtitles may last longer than sound and
    video, in a container with subtitles it has the longest duration of sound and video.
    """
    if stream.duration:
        return float(stream.duration * stream.time_base)
    if not container.streams.subtitles:
        return (container.duration or 0) / 1e6
    return max(map(_tagged_s, (*container.streams.video, *container.streams.audio)))


def _tagged_s(stream: Any) -> float:
    """Return the duration of a Matroska stream, which is stored as text, in seconds; 0 if there is none."""
    match = DURATION.fullmatch(stream.metadata.get("DURATION", ""))
    hours, minutes, seconds = map(float, match.groups()) if match else (0.0, 0.0, 0.0)
    return 3600 * hours + 60 * minutes + seconds
