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
    samples = checked_samples(audio)
    frames = frame_count(samples)
    hops = samples[: (frames - 1) * HOP].reshape(-1, HOP)
    rest = samples[hops.size :].astype(np.float64)
    energy = np.append(np.einsum("ij,ij->i", hops, hops, dtype=np.float64), rest @ rest)  # from frame to frame
    centre = np.arange(frames) * HOP
    length = np.minimum(centre + HOP, len(samples)) - np.maximum(centre - HOP, 0)
    mean = (energy + np.concatenate([[0.0], energy[:-1]])) / np.maximum(length, 1)
    return Prosody(10 * np.log10(mean + FLOOR), log_f0(Audio(audio.samples, SPEECH_RATE_HZ)))
