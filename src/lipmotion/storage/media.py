"""Recordings opened by FFmpeg: one file, and nothing else."""

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
"""FFmpeg's names of the containers that hold what they play. All other formats are refused before they open anything:
playlists (hls, concat, dash, imf), indexes (vobsub), numbered pictures (image2), addresses (sdp, rtsp), devices."""
LARGEST_BLOCK = 1 << 28
"""Bytes that FFmpeg may allocate at a time: three times a picture of ``MOST_PIXELS`` in 16 bits and four channels."""
DURATION = re.compile(r"(\d{1,6}):(\d\d):(\d\d(?:\.\d{1,9})?)")
MOST_PIXELS = 4096 * 2304
"""Pixels of one picture: a little more than 4K has. A decoder may keep sixteen of them."""


def open_media(path: Path) -> Any:
    """Return an open PyAV container; close it. Raises what PyAV raises.

    The name is taken as a file's whatever is in it (``12:30.wav`` is no protocol), and nothing but this file is
    opened, whatever the content says: FFmpeg itself refuses every other protocol, and what is not in ``MEDIA_FORMATS``.
    Raises ValueError: of another format, or damaged.
    """
    import av

    _bound_allocations()
    options = {
        "protocol_whitelist": "file",
        "format_whitelist": ",".join(MEDIA_FORMATS),
        "enable_drefs": "0",
        "max_pixels": str(MOST_PIXELS),
    }
    try:
        return av.open(f"file:{path}", options=options)
    except av.ArgumentError as error:
        raise ValueError(
            "damaged, or of a format that is not read; playlists and indexes of other files are not followed"
        ) from error


@cache
def _bound_allocations() -> None:
    """Let FFmpeg refuse blocks over ``LARGEST_BLOCK``, for the whole process: it trusts sizes that headers state."""
    import av._core

    with suppress(OSError, AttributeError):  # where a module does not show what the libraries behind it export
        ctypes.CDLL(av._core.__file__).av_max_alloc(ctypes.c_size_t(LARGEST_BLOCK))


def video_streams(container: Any) -> list[Any]:
    """Return the video streams of an open container that are not the cover of an album."""
    import av

    cover = av.stream.Disposition.attached_pic
    return [stream for stream in container.streams.video if not stream.disposition & cover]


def stated_duration_s(container: Any, stream: Any) -> float:
    """Return the duration that an open container states for one of its streams, 0 if none.

    Where the stream has none of its own, that of the container stands for it. Subtitles may last longer than what they
    belong to: beside them it is the longest of the sound and the pictures.
    """
    if stream.duration:
        return float(stream.duration * stream.time_base)
    if not container.streams.subtitles:
        return (container.duration or 0) / 1e6
    return max(map(_tagged_s, (*container.streams.video, *container.streams.audio)))


def _tagged_s(stream: Any) -> float:
    """Return the duration of a stream of Matroska, which keeps it as text."""
    found = DURATION.fullmatch(stream.metadata.get("DURATION", ""))
    hours, minutes, seconds = map(float, found.groups()) if found else (0.0, 0.0, 0.0)
    return 3600 * hours + 60 * minutes + seconds
