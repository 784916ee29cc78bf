"""Noise added to recordings: white noise, or the babble of other talkers, at a stated signal-to-noise ratio."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.hmm.loudness import find_loud_frames
from lipmotion.speech.features.mfcc import HOP, checked_samples, log_energy
from lipmotion.types import Audio

NOISE_KINDS = ("white", "babble")
FEWEST_TALKERS = 2
"""One other talker is an interruption, not a babble."""
SILENT_RMS = 1e-6
"""Speech of a lower root mean square, full scale 1, is silence."""

Samples = NDArray[np.float32]


def noisy_audio(audio: Audio, kind: str, snr_db: float, talkers: Sequence[Audio] = (), seed: int = 0) -> Audio:
    """Return a recording with noise of a kind added to it.

    kind    : one of ``NOISE_KINDS``
    snr_db  : as ``add_noise`` measures it
    talkers : recordings of the babble's talkers, other people than the one in ``audio``; white noise does not use them
    seed    : the same arguments give the same samples
    Raises InputError: another kind, a talker that is the recording itself, or as ``add_noise`` and ``babble_noise``.
    """
    if kind not in NOISE_KINDS:
        raise InputError(f"unknown noise {kind!r}; required one of: {', '.join(NOISE_KINDS)}")
    count = len(checked_samples(audio))
    if kind == "white":
        return add_noise(audio, white_noise(count, seed), snr_db)
    if any(np.array_equal(talker.samples, audio.samples) for talker in talkers):
        raise InputError("the recording is one of the talkers of its own babble; leave its speaker out of the talkers")
    return add_noise(audio, babble_noise(talkers, count, seed), snr_db)


def add_noise(audio: Audio, noise: NDArray[np.floating], snr_db: float) -> Audio:
    """Return a recording with noise, scaled to a signal-to-noise ratio, added from start to end.

    noise  : as many samples as the recording has [shape=(N,)], of any level
    snr_db : 10 · log10 of the mean power of the recording over that of the noise, both over the samples of speech
             (``spoken_samples``); noise that the recording already has counts as speech there
    The samples are not clipped: beyond full scale they are exact for features, not for sound files of integers.
    Raises InputError: the ratio is not finite, the lengths differ, the noise is silent or not finite, or there is no
    speech in the recording.
    """
    if not np.isfinite(snr_db):
        raise InputError(f"the signal-to-noise ratio is {snr_db} dB, required a finite number")
    spoken = spoken_samples(audio)
    if noise.shape != audio.samples.shape:
        raise InputError(f"the noise has shape {noise.shape}, required that of the recording, {audio.samples.shape}")
    noise_power = float(np.square(noise[spoken], dtype=float).mean())
    if not 0 < noise_power < np.inf:
        raise InputError(f"the noise has a mean power of {noise_power} in speech; required above 0 and finite")
    gain = np.sqrt(_power(audio, spoken) / noise_power) * 10 ** (-snr_db / 20)
    return Audio((audio.samples + gain * noise).astype(np.float32), audio.rate_hz)


def white_noise(samples: int, seed: int = 0) -> Samples:
    """Return Gaussian noise of variance 1 [shape=(samples,)]. Raises InputError: fewer than 1 sample."""
    _check_length(samples)
    return np.random.default_rng(seed).standard_normal(samples, np.float32)


def babble_noise(voices: Sequence[Audio], samples: int, seed: int = 0) -> Samples:
    """Return the sum of several talkers, each with the same power [shape=(samples,)].

    voices : at least ``FEWEST_TALKERS`` recordings at 16 kHz, none of them of the speaker to whom they are added
    Every recording begins at a random sample and is repeated from its start at its end. All have mean power 1 over
    their samples of speech.
    Raises InputError: too few recordings, another rate, a recording too short or silent, or fewer than 1 sample.
    """
    _check_length(samples)
    if len(voices) < FEWEST_TALKERS:
        raise InputError(f"a babble of {len(voices)} talkers; required at least {FEWEST_TALKERS}")
    rng = np.random.default_rng(seed)
    total = np.zeros(samples)
    for voice in voices:
        level = np.sqrt(_power(voice, spoken_samples(voice)))
        start = int(rng.integers(len(voice.samples)))
        total += np.resize(np.roll(voice.samples, -start), samples) / level
    return total.astype(np.float32)


def spoken_samples(audio: Audio) -> NDArray[np.bool_]:
    """Return which samples are speech [shape=(N,)]: the 10 ms around each frame that is loud for this recording.

    A frame is loud where its log energy (25 ms), averaged over 11 frames, lies above the middle between the 10th and
    the 95th percentile of the recording (``hmm.loudness.loud_frames``). Pauses do not count, so that a
    signal-to-noise ratio does not depend on how long they are.
    Raises InputError: not one channel of finite samples at 16 kHz, shorter than 25 ms, or silent.
    """
    samples = checked_samples(audio)
    loud = find_loud_frames(log_energy(samples))
    if not loud.any():  # a steady tone has no quiet frames
        loud = np.ones_like(loud)
    nearest = np.minimum((np.arange(len(samples)) + HOP // 2) // HOP, len(loud) - 1)
    spoken: NDArray[np.bool_] = loud[nearest]
    level = np.sqrt(_power(audio, spoken))
    if level < SILENT_RMS:
        raise InputError(f"the recording is silent (root mean square {level:.1g}); give one in which something is said")
    return spoken


def _power(audio: Audio, spoken: NDArray[np.bool_]) -> float:
    return float(np.square(audio.samples[spoken], dtype=float).mean())


def _check_length(samples: int) -> None:
    if samples < 1:
        raise InputError(f"{samples} samples of noise asked for, required at least 1")
