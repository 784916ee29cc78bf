"""Loudness and pitch of what is said, for movements of brows and head."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np

from lipmotion.articulation.delivery import Delivery
from lipmotion.pipeline.outputs.output import Performance
from lipmotion.speech.features.analysed_audio import AnalysedAudio
from lipmotion.speech.features.mfcc import WINDOW
from lipmotion.speech.features.prosody import prosody_of
from lipmotion.speech.sound.audio_files import SPEECH_RATE_HZ, read_audio
from lipmotion.speech.sound.decimation import decimated
from lipmotion.types import Audio, Prosody


def measure_prosody(speech: str | Path | Audio) -> Prosody:
    """Return loudness and pitch of a recording or a sound, for movements of brows and head.

    A sound that is shorter than one frame of speech is followed by silence. One that keeps its features keeps this.

    Raises InputError: the recording cannot be read.
    """
    if isinstance(speech, AnalysedAudio):
        return speech.once("prosody", lambda: _prosody(speech))
    return _prosody(speech if isinstance(speech, Audio) else read_audio(Path(speech), SPEECH_RATE_HZ, warn=False))


def _prosody(sound: Audio) -> Prosody:
    ratio = Fraction(SPEECH_RATE_HZ, int(sound.rate_hz))
    samples = sound.samples.astype(np.float32)
    if ratio.numerator == 1:
        samples = decimated(samples, ratio.denominator)
    else:
        from scipy.signal import resample_poly

        samples = resample_poly(samples, ratio.numerator, ratio.denominator).astype(np.float32)
    missing = max(WINDOW - len(samples), 0)
    return prosody_of(Audio(np.pad(samples, (0, missing)), SPEECH_RATE_HZ))


def shift_prosody(prosody: Prosody, delivery: Delivery) -> Prosody:
    """Return loudness and pitch on the timeline of files: later by the offset."""
    frames = round(delivery.offset_ms / 10)
    if frames <= 0:
        return Prosody(prosody.level_db[-frames:], prosody.log_f0[-frames:])
    quiet = np.full(frames, prosody.level_db.min(initial=0.0))
    return Prosody(np.concatenate([quiet, prosody.level_db]), np.concatenate([quiet * np.nan, prosody.log_f0]))


def measure_recorded_prosody(performance: Performance) -> Prosody | None:
    """Return loudness and pitch of what is performed, on the timeline of files; None: there is no sound."""
    speech = performance.speech
    return None if speech is None else shift_prosody(measure_prosody(speech), performance.settings.delivery)
