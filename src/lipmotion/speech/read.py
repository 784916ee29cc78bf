"""Any common container, or the sound track of a video, to one channel at 16 kHz."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.files import check_source
from lipmotion.types import Audio

SPEECH_RATE_HZ = 16_000
SHORTEST_S = 0.1
"""Recordings under this hold no sentence; the features need 25 ms around every frame."""


def read_audio(path: Path, rate_hz: int = SPEECH_RATE_HZ) -> Audio:
    """Return the first sound track of a file, the mean of its channels.

    path    : audio or video file, anything FFmpeg decodes
    rate_hz : rate to resample to
    Time 0 is the start of the container, so sound and picture of a video agree: a track that starts later
    is preceded by silence, one that starts earlier is cut.
    Raises InputError: no such file, empty, not a recording, no sound track, too short, or samples not finite.
    """
    import av

    check_source(path, "recording")
    try:
        with av.open(str(path)) as container:
            if not container.streams.audio:
                raise InputError(f"{path}: has no sound track; give a recording with sound")
            pieces, start_s = _decode(container, rate_hz)
    except (av.FFmpegError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: not a readable recording ({_reason(error)}); give an audio or video file") from error
    samples = _from_time_zero(np.concatenate(pieces) if pieces else np.zeros(0, np.float32), start_s, rate_hz)
    return _checked(path, Audio(samples, rate_hz))


def _decode(container: Any, rate_hz: int) -> tuple[list[NDArray[np.float32]], float]:
    import av

    stream = container.streams.audio[0]
    resampler = av.AudioResampler(format="fltp", rate=rate_hz)
    pieces: list[NDArray[np.float32]] = []
    start_s: float | None = None
    for frame in container.decode(stream):
        if start_s is None and frame.pts is not None:
            start_s = float(frame.pts * frame.time_base) - (container.start_time or 0) / 1e6
        frame.pts = None
        pieces += [resampled.to_ndarray().mean(axis=0) for resampled in resampler.resample(frame)]
    if start_s is not None:
        pieces += [resampled.to_ndarray().mean(axis=0) for resampled in resampler.resample(None)]
    return pieces, start_s or 0.0


def _from_time_zero(samples: NDArray[np.float32], start_s: float, rate_hz: int) -> NDArray[np.float32]:
    offset = round(start_s * rate_hz)
    if offset < 0:
        return samples[-offset:]
    return np.concatenate([np.zeros(offset, np.float32), samples]) if offset else samples


def _checked(path: Path, audio: Audio) -> Audio:
    if audio.duration_s < SHORTEST_S:
        raise InputError(f"{path}: holds {audio.duration_s * 1000:.0f} ms of sound, required at least 100 ms")
    if not np.isfinite(audio.samples).all():
        raise InputError(f"{path}: holds samples that are not finite (NaN or infinite); export the recording again")
    return audio


def _reason(error: Exception) -> str:
    return str(getattr(error, "strerror", None) or error)
