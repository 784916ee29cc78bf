"""Acoustic conditions: noise at a stated ratio; and for training, rooms, telephones, other voices."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from lipmotion.errors import InputError
from lipmotion.hmm.loudness import find_loud_frames
from lipmotion.speech.features.mfcc import HOP, WINDOW, check_samples, log_energy, spectrum
from lipmotion.speech.sound.analysed_audio import analysed
from lipmotion.types import SPEECH_RATE_HZ, Audio, ConditionSpectrum

NOISE_KINDS = ("white", "babble")
MIN_TALKERS = 2  # one other talker is an interruption, not a babble
SILENT_RMS = 1e-6  # speech of a lower root mean square, full scale 1, is silence


def mix_noise(audio: Audio, kind: str, snr_db: float, talkers: Sequence[Audio] = (), seed: int = 0) -> Audio:
    """Return a recording with noise of a kind, scaled to a signal-to-noise ratio, added from start to end.

    kind    : one of ``NOISE_KINDS``
    snr_db  : 10 · log10 of the mean power of the recording over that of the noise, both over the samples of speech
              (``mark_spoken``); noise that the recording already has counts as speech there
    talkers : recordings of the babble's talkers, other people than the one in ``audio``; white noise does not use them
    The samples are not clipped: beyond full scale they are exact for features, not for sound files of integers.
    Raises InputError: another kind, a ratio not finite, a talker that is the recording itself; as ``make_babble``.
    """
    if kind not in NOISE_KINDS or not np.isfinite(snr_db):
        raise InputError(f"{kind!r} noise at {snr_db} dB; required {' or '.join(NOISE_KINDS)}, and a finite ratio")
    if any(np.array_equal(talker.samples, audio.samples) for talker in talkers):
        raise InputError("the recording is one of the talkers of its own babble; leave its speaker out of the talkers")
    spoken = mark_spoken(audio)
    if kind == "white":
        noise = np.random.default_rng(seed).standard_normal(len(audio.samples), np.float32)
    else:
        noise = make_babble(talkers, len(audio.samples), seed)
    noise_power = float(np.square(noise[spoken], dtype=float).mean())
    gain = np.sqrt(_measure_power(audio, spoken) / noise_power) * 10 ** (-snr_db / 20)
    return Audio((audio.samples + gain * noise).astype(np.float32), audio.rate_hz)


def make_babble(voices: Sequence[Audio], samples: int, seed: int = 0) -> NDArray[np.float32]:
    """Return the sum of several talkers, each with the same power [shape=(samples,)].

    voices : at least ``MIN_TALKERS`` recordings at 16 kHz, none of them of the speaker to whom they are added
    Every recording starts at a random sample and loops. All have mean power 1 over their speech.
    Raises InputError: too few recordings, another rate, or a recording too short or silent.
    """
    if len(voices) < MIN_TALKERS:
        raise InputError(f"a babble of {len(voices)} talkers; required at least {MIN_TALKERS}")
    rng = np.random.default_rng(seed)
    total = np.zeros(samples)
    for voice in voices:
        level = np.sqrt(_measure_power(voice, mark_spoken(voice)))
        start = int(rng.integers(len(voice.samples)))
        total += np.resize(np.roll(voice.samples, -start), samples) / level
    return total.astype(np.float32)


def mark_spoken(audio: Audio) -> NDArray[np.bool_]:
    """Return which samples are speech [shape=(N,)]: the 10 ms around each frame that is loud for this recording.

    Which frames are loud says ``hmm.loudness.find_loud_frames``. Pauses do not count, so that a signal-to-noise ratio
    does not depend on how long they are.
    Raises InputError: not one channel of finite samples at 16 kHz, shorter than 25 ms, or silent.
    """
    samples = check_samples(audio)
    loud = find_loud_frames(log_energy(samples))
    if not loud.any():  # a steady tone has no quiet frames
        loud = np.ones_like(loud)
    nearest = np.minimum((np.arange(len(samples)) + HOP // 2) // HOP, len(loud) - 1)
    spoken: NDArray[np.bool_] = loud[nearest]
    level = np.sqrt(_measure_power(audio, spoken))
    if level < SILENT_RMS:
        raise InputError(f"the recording is silent (root mean square {level:.1g}); give one in which something is said")
    return spoken


def _measure_power(audio: Audio, spoken: NDArray[np.bool_]) -> float:
    return float(np.square(audio.samples[spoken], dtype=float).mean())


LARGEST_WARP, LARGEST_TEMPO = 0.16, 0.22
"""Natural logarithms of the largest factors: of the frequencies alone, and of frequencies and tempo together."""
WARP_PROBABILITY, TEMPO_PROBABILITY, CLEAN_PROBABILITY = 0.7, 0.6, 0.2
ROOM_PROBABILITY, NOISE_PROBABILITY, BABBLE_PROBABILITY = 0.4, 0.75, 0.55
FILTER_PROBABILITY, TELEPHONE_PROBABILITY, CLIPPING_PROBABILITY = 0.6, 0.25, 0.1  # fmt: skip
"""Probabilities of the conditions. Noise is babble or coloured noise; a filter is smooth, or that of a telephone."""
SNR_DB = (3.0, 30.0)
ROOM_S, ROOM_DB = (0.15, 0.9), (-12.0, 0.0)
"""Reverberation times, and energies of the reverberation relative to the direct sound."""
MAX_TALKERS = 7
MIN_DISTORTION_DB = -30.0
"""Noise and reverberation this far under the speech count as no distortion; as loud as the speech, as 1."""
MU = 255.0

Samples = NDArray[np.float64]


def list_conditions(audio: Audio, voices: Sequence[Audio], count: int, seed: Sequence[int]) -> list[ConditionSpectrum]:
    """Return spectrum and encoding of a recording as it is, and in ``count`` - 1 random conditions.

    voices : other recordings, whose voices, at other speeds, make the babble
    Raises InputError: as ``spectrum``.
    """
    result = [ConditionSpectrum(spectrum(audio).astype(np.float16), analysed(audio).encoding, 1.0, 0.0)]
    for number in range(1, count):
        rng = np.random.default_rng([*seed, number])
        warp = float(np.exp(rng.uniform(-LARGEST_WARP, LARGEST_WARP))) if rng.random() < WARP_PROBABILITY else 1.0
        tempo = float(np.exp(rng.uniform(-LARGEST_TEMPO, LARGEST_TEMPO))) if rng.random() < TEMPO_PROBABILITY else 1.0
        sped = audio  # played ``tempo`` times as fast: tempo, pitch and formants change together
        if tempo != 1.0 and len(samples := _resample(audio.samples, tempo)) >= WINDOW:
            sped = Audio(samples.astype(np.float32), audio.rate_hz)
        varied, distortion = apply_condition(sped, voices, rng)
        warped = spectrum(varied, warp).astype(np.float16)
        result.append(ConditionSpectrum(warped, analysed(varied).encoding, tempo, distortion))
    return result


def apply_condition(audio: Audio, voices: Sequence[Audio], rng: np.random.Generator) -> tuple[Audio, float]:
    """Return a recording in a random acoustic condition, and its distortion, 0 to 1.

    Rooms are exponentially decaying noise, filters are smooth random curves or the band of a telephone. In one of five
    cases nothing is changed; nor is a recording without sound.
    """
    samples, level = audio.samples.astype(float), 0.0
    with suppress(InputError):  # a recording without sound
        level = _measure_power(audio, mark_spoken(audio))
    if level <= 0 or rng.random() < CLEAN_PROBABILITY:
        return audio, 0.0
    added = 0.0
    if rng.random() < ROOM_PROBABILITY:
        from scipy.signal import fftconvolve

        share = 10 ** (rng.uniform(*ROOM_DB) / 10)
        response = rng.standard_normal(int(rng.uniform(*ROOM_S) * SPEECH_RATE_HZ))
        response *= 10 ** (-3 * np.arange(len(response)) / len(response))
        response *= np.sqrt(share / np.square(response).sum())
        samples, added = samples + fftconvolve(samples, response)[: len(samples)], share
    if rng.random() < NOISE_PROBABILITY:
        share = 10 ** (-rng.uniform(*SNR_DB) / 10)
        is_babble = voices and rng.random() < BABBLE_PROBABILITY
        noise = _mix_voices(voices, len(samples), rng) if is_babble else _make_noise(len(samples), rng)
        samples, added = samples + noise * np.sqrt(level * share), added + share
    if rng.random() < FILTER_PROBABILITY:
        samples = _filter(samples, rng)
    if rng.random() < CLIPPING_PROBABILITY:
        limit = np.abs(samples).max() * rng.uniform(0.2, 0.7)
        samples = np.clip(samples, -limit, limit)
    distortion = 1 - 10 * np.log10(max(added, 1e-9)) / MIN_DISTORTION_DB
    return Audio(samples.astype(np.float32), audio.rate_hz), float(np.clip(distortion, 0, 1))


def _resample(samples: NDArray[np.floating], factor: float) -> Samples:
    count = max(int(len(samples) / factor), 1)
    return np.interp(np.arange(count) * factor, np.arange(len(samples)), samples)


def _mix_voices(voices: Sequence[Audio], count: int, rng: np.random.Generator) -> Samples:
    """Return voices at random speeds and levels, of power 1 in all [shape=(count,)]."""
    total = np.zeros(count)
    for _ in range(int(rng.integers(1, MAX_TALKERS + 1))):
        voice = _resample(voices[int(rng.integers(len(voices)))].samples, rng.uniform(0.75, 1.3))
        level = np.sqrt(np.square(voice).mean()) + 1e-9
        begun = np.resize(np.roll(voice, -int(rng.integers(len(voice)))), count)
        total += begun / level * 10 ** (rng.normal(0, 3) / 20)
    return total / (total.std() + 1e-9)


def _make_noise(count: int, rng: np.random.Generator) -> Samples:
    """Return noise of a random colour, sometimes with hum, of power 1 [shape=(count,)]."""
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


def _filter(samples: Samples, rng: np.random.Generator) -> Samples:
    """Return samples behind a smooth filter, or a telephone: a narrow band, coded in eight bits."""
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
