"""Loudness and pitch of a recording, for faces that move with the voice."""

from __future__ import annotations

import numpy as np

from lipmotion.speech.features.f0 import log_f0
from lipmotion.speech.features.mfcc import HOP, checked_samples, frame_count
from lipmotion.speech.sound.audio_files import SPEECH_RATE_HZ
from lipmotion.types import Audio, Prosody

FLOOR = 1e-9
"""Power that is added to every frame's: digital silence is at -90 dB."""


def prosody_of(audio: Audio) -> Prosody:
    """Return loudness and pitch of a sound at 16 kHz. Raises InputError: as ``speech.features.mfcc`` says."""
    checked = checked_samples(audio)
    samples, frames = checked.astype(np.float64), frame_count(checked)
    power = np.concatenate([[0.0], np.cumsum(samples * samples)])
    centre = np.arange(frames) * HOP
    first, last = np.clip(centre - HOP, 0, len(samples)), np.clip(centre + HOP, 0, len(samples))
    mean = (power[last] - power[first]) / np.maximum(last - first, 1)
    return Prosody(10 * np.log10(mean + FLOOR), log_f0(Audio(audio.samples, SPEECH_RATE_HZ)))
