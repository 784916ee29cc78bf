"""Acoustic conditions for training: recordings in noise, in rooms, over a telephone, from other voices."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.speech.features.mfcc import WINDOW, spectrum
from lipmotion.speech.sound.audio_files import SPEECH_RATE_HZ
from lipmotion.speech.sound.noise import spoken_samples
from lipmotion.types import Audio, ConditionSpectrum

LARGEST_WARP, LARGEST_TEMPO = 0.16, 0.22
"""Natural logarithms of the largest factors: of the frequencies alone, and of frequencies and tempo together."""
WARP_PROBABILITY, TEMPO_PROBABILITY, CLEAN_PROBABILITY = 0.7, 0.6, 0.2
ROOM_PROBABILITY, NOISE_PROBABILITY, BABBLE_PROBABILITY = 0.4, 0.75, 0.55
FILTER_PROBABILITY, TELEPHONE_PROBABILITY, CLIPPING_PROBABILITY = 0.6, 0.25, 0.1  # fmt: skip
"""Probabilities of the conditions. Noise is babble or coloured noise; a filter is smooth, or that of a telephone."""
NOISE_DB = (3.0, 30.0)
"""Signal-to-noise ratios."""
ROOM_S, ROOM_DB = (0.15, 0.9), (-12.0, 0.0)
"""Reverberation times, and energies of the reverberation relative to the direct sound."""
TALKERS = 7
"""Largest number of voices of a babble."""
LEAST_DISTORTION_DB = -30.0
"""Noise and reverberation this far under the speech count as no distortion; as loud as the speech, as 1."""
MU = 255.0

Samples = NDArray[np.float64]


def condition_spectra(
    audio: Audio, voices: Sequence[Audio], count: int, seed: Sequence[int]
) -> list[ConditionSpectrum]:
    """Return the spectrum of a recording as it is, and in ``count`` - 1 random conditions.

    voices : other recordings, whose voices, at other speeds, make the babble
    seed   : the same arguments give the same spectra
    Raises InputError: as ``spectrum``.
    """
    result = [ConditionSpectrum(spectrum(audio).astype(np.float16), 1.0, 0.0)]
    for number in range(1, count):
        rng = np.random.default_rng([*seed, number])
        warp = float(np.exp(rng.uniform(-LARGEST_WARP, LARGEST_WARP))) if rng.random() < WARP_PROBABILITY else 1.0
        tempo = float(np.exp(rng.uniform(-LARGEST_TEMPO, LARGEST_TEMPO))) if rng.random() < TEMPO_PROBABILITY else 1.0
        varied, distortion = in_condition(_sped(audio, tempo), voices, rng)
        result.append(ConditionSpectrum(spectrum(varied, warp).astype(np.float16), tempo, distortion))
    return result


def in_condition(audio: Audio, voices: Sequence[Audio], rng: np.random.Generator) -> tuple[Audio, float]:
    """Return a recording in a random acoustic condition, and its distortion, 0 to 1.

    Rooms are exponentially decaying noise, filters are smooth random curves or the band of a telephone. In one of five
    cases nothing is changed; nor is a recording without sound.
    """
    samples, level = audio.samples.astype(float), _speech_power(audio)
    if level <= 0 or rng.random() < CLEAN_PROBABILITY:
        return audio, 0.0
    added = 0.0
    if rng.random() < ROOM_PROBABILITY:
        share = 10 ** (rng.uniform(*ROOM_DB) / 10)
        from scipy.signal import fftconvolve

        duration_s = rng.uniform(*ROOM_S)
        response = rng.standard_normal(int(duration_s * SPEECH_RATE_HZ))
        response *= 10 ** (-3 * np.arange(len(response)) / len(response))
        response *= np.sqrt(share / np.square(response).sum())
        samples, added = samples + fftconvolve(samples, response)[: len(samples)], share
    if rng.random() < NOISE_PROBABILITY:
        share = 10 ** (-rng.uniform(*NOISE_DB) / 10)
        noise = (
            _babble(voices, len(samples), rng)
            if voices and rng.random() < BABBLE_PROBABILITY
            else _coloured(len(samples), rng)
        )
        samples, added = samples + noise * np.sqrt(level * share), added + share
    if rng.random() < FILTER_PROBABILITY:
        samples = _filtered(samples, rng)
    if rng.random() < CLIPPING_PROBABILITY:
        limit = np.abs(samples).max() * rng.uniform(0.2, 0.7)
        samples = np.clip(samples, -limit, limit)
    distortion = 1 - 10 * np.log10(max(added, 1e-9)) / LEAST_DISTORTION_DB
    return Audio(samples.astype(np.float32), audio.rate_hz), float(np.clip(distortion, 0, 1))


def _sped(audio: Audio, tempo: float) -> Audio:
    """Return a recording played ``tempo`` times as fast: tempo, pitch and formants change together."""
    if tempo == 1.0:
        return audio
    samples = _resampled(audio.samples, tempo)
    if len(samples) < WINDOW:
        return audio
    return Audio(samples.astype(np.float32), audio.rate_hz)


def _resampled(samples: NDArray[np.floating], factor: float) -> Samples:
    count = max(int(len(samples) / factor), 1)
    return np.interp(np.arange(count) * factor, np.arange(len(samples)), samples)


def _speech_power(audio: Audio) -> float:
    """Return the mean power over speech; 0 for a recording without sound."""
    try:
        return float(np.square(audio.samples[spoken_samples(audio)], dtype=float).mean())
    except InputError:
        return 0.0


def _babble(voices: Sequence[Audio], count: int, rng: np.random.Generator) -> Samples:
    """Return voices at random speeds and levels, of power 1 in all [shape=(count,)]."""
    total = np.zeros(count)
    for _ in range(int(rng.integers(1, TALKERS + 1))):
        voice = _resampled(voices[int(rng.integers(len(voices)))].samples, rng.uniform(0.75, 1.3))
        level = np.sqrt(np.square(voice).mean()) + 1e-9
        total += (
            np.resize(np.roll(voice, -int(rng.integers(len(voice)))), count) / level * 10 ** (rng.normal(0, 3) / 20)
        )
    return total / (total.std() + 1e-9)


def _coloured(count: int, rng: np.random.Generator) -> Samples:
    """Return noise of a random colour, sometimes with hum, of power 1 [shape=(count,)]."""
    from scipy.fft import irfft, next_fast_len, rfft

    size = next_fast_len(count, real=True)
    hertz = np.maximum(np.fft.rfftfreq(size, 1 / SPEECH_RATE_HZ), 50.0)
    shape = 10 ** (np.interp(hertz, np.linspace(0, 8000, 8), rng.normal(0, 4, 8) * rng.integers(2)) / 20)
    noise: Samples = irfft(rfft(rng.standard_normal(size)) * shape * hertz ** (rng.uniform(-2, 0.5) / 2), size)[:count]
    if rng.random() < 0.2:
        mains_hz, time_s = rng.choice([50.0, 60.0]), np.arange(count) / SPEECH_RATE_HZ
        for harmonic in range(1, 6):
            hum = np.sin(2 * np.pi * mains_hz * harmonic * time_s + rng.uniform(0, 6))
            noise += hum * rng.normal() * 2 * noise.std()
    return noise / (noise.std() + 1e-12)


def _filtered(samples: Samples, rng: np.random.Generator) -> Samples:
    """Return samples behind a smooth filter, or a telephone: a narrow band, coded in eight bits."""
    from scipy.fft import irfft, next_fast_len, rfft

    size = next_fast_len(len(samples), real=True)
    hertz = np.fft.rfftfreq(size, 1 / SPEECH_RATE_HZ)
    gain = 10 ** (np.interp(hertz, np.linspace(0, 8000, 7), rng.normal(0, 5, 7)) / 20)
    narrow = rng.random() < TELEPHONE_PROBABILITY
    if narrow:
        low, high = rng.uniform(200, 400), rng.uniform(3000, 4000)
        gain *= 1 / (1 + (low / np.maximum(hertz, 1)) ** 8) / (1 + (hertz / high) ** 16)
    result: Samples = irfft(rfft(samples, size) * gain, size)[: len(samples)]
    if narrow:
        peak = np.abs(result).max() + 1e-12
        coded = np.round(np.sign(result) * np.log1p(MU * np.abs(result) / peak) / np.log1p(MU) * 127) / 127
        result = np.sign(coded) * np.expm1(np.abs(coded) * np.log1p(MU)) / MU * peak
    return result
