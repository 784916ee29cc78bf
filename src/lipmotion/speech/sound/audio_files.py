"""Sound read from files: any common container, or the sound track of a video, to one channel at 16 kHz."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.speech.sound.audio_decoding import DecodedAudio, check_sound_format, decode_audio
from lipmotion.storage.files import check_source
from lipmotion.storage.media import open_media, stated_duration_s
from lipmotion.types import Audio

LOG = logging.getLogger("lipmotion")

SPEECH_RATE_HZ = 16_000
SHORTEST_S = 0.1
"""Shorter recordings hold no sentence; the features need 25 ms around every frame."""
CANCELLED_SHARE = 0.05
"""The mean of the channels must have this share of the loudest channel's energy; else they cancel one another."""
USABLE_SHARE = 0.5
"""A damaged recording is refused when less than this share of its sound can be decoded."""
LEAST_HOLES_S = 0.005
"""Holes that last less together are not mentioned: they would be rounded to 0."""
CUT_SHORT_SHARE = 0.9
"""A recording is called cut short when it holds less than this share of the duration that it states."""


def read_audio(path: Path, rate_hz: int = SPEECH_RATE_HZ, *, warn: bool = True) -> Audio:
    """Return the first sound track of a file, the mean of its channels.

    path    : audio or video file, anything FFmpeg decodes
    rate_hz : rate to resample to
    warn    : log warnings; False where the same file was read before, so that none is said twice
    Time 0 is the start of the container, so sound and picture of a video agree: a track that starts later
    is preceded by silence, one that starts earlier is cut. In a file without video it is the first sample.
    Holes in the sound (damage, lost packets) become silence, so that what follows keeps its time. Where the channels
    cancel one another, as with one of them inverted, the loudest is taken. Both are logged as warnings.
    Memory: the samples returned, and an eighth more.
    Raises InputError: no such file, empty, not a recording, no sound track, less than half of it decodable, too short,
    time stamps or a length that it cannot have, or samples not finite.
    """
    check_source(path, "recording")
    sound = _decoded(path, rate_hz, None)
    if sound.mean_energy < CANCELLED_SHARE * max(sound.energies, default=0.0):
        loudest = int(np.argmax(sound.energies))
        LOG.log(
            logging.WARNING if warn else logging.DEBUG,
            "%s: its %d channels cancel one another in their mean; channel %d, the loudest, is used",
            path,
            len(sound.energies),
            loudest + 1,
        )
        sound = _decoded(path, rate_hz, loudest)
    _check_damage(path, sound, logging.WARNING if warn else logging.DEBUG)
    return _checked(path, Audio(sound.samples, rate_hz))


def stated_length_s(path: Path) -> float:
    """Return the length that a recording states, in seconds; 0 if it states none, or cannot be read."""
    import av

    try:
        with open_media(path) as container:
            return stated_duration_s(container, container.streams.audio[0])
    except (av.FFmpegError, OSError, ValueError, IndexError):
        return 0.0


def _decoded(path: Path, rate_hz: int, channel: int | None) -> DecodedAudio:
    import av

    try:
        with open_media(path) as container:
            _first_track(path, container)
            return decode_audio(container, rate_hz, channel)
    except (av.FFmpegError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: not a readable recording ({_reason(error)}); give an audio or video file") from error


def _first_track(path: Path, container: Any) -> None:
    if not container.streams.audio:
        raise InputError(f"{path}: has no sound track; give a recording with sound")
    _check_stream(path, container.streams.audio[0])
    if len(container.streams.audio) > 1:
        LOG.info("%s: the first of %d sound tracks is used", path, len(container.streams.audio))


def _check_stream(path: Path, stream: Any) -> None:
    if stream.codec_context is None:
        raise InputError(f"{path}: its sound is coded in an unknown way; export it as .wav or .flac")
    check_sound_format(str(path), stream.rate or 0, stream.channels or 0)


def _check_damage(path: Path, sound: DecodedAudio, level: int) -> None:
    """Log damage at a level of ``logging``. Raises InputError: too little of the sound can be decoded."""
    held_s = len(sound.samples) / sound.rate_hz - sound.silence_s
    found = f"{sound.damaged} of {sound.packets} packets of sound cannot be decoded"
    if sound.damaged > (1 - USABLE_SHARE) * sound.packets:
        raise InputError(f"{path}: damaged: {found}; required: at least half of them; export the recording again")
    if sound.damaged or sound.silence_s >= SHORTEST_S:
        holes = f"; holes of {sound.silence_s:.2f} s became silence" if sound.silence_s >= LEAST_HOLES_S else ""
        LOG.log(level, "%s: damaged: %s%s", path, found, holes)
    if held_s < CUT_SHORT_SHARE * sound.stated_s:
        LOG.log(level, "%s: cut short: it states %.1f s of sound and holds %.1f s", path, sound.stated_s, held_s)


def _checked(path: Path, audio: Audio) -> Audio:
    if audio.duration_s < SHORTEST_S:
        raise InputError(f"{path}: holds {audio.duration_s * 1000:.0f} ms of sound, required at least 100 ms")
    if not _is_finite(audio.samples):
        raise InputError(f"{path}: holds samples that are not finite (NaN or infinite); export the recording again")
    return audio


def _is_finite(samples: NDArray[np.float32]) -> bool:
    """Return whether all samples are finite; their extremes tell, and need no further array."""
    return bool(np.isfinite(samples.min()) and np.isfinite(samples.max()))


def _reason(error: Exception) -> str:
    return str(getattr(error, "strerror", None) or error)
