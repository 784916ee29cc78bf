"""Voices that are made: pulses or noise through resonances, laughter, and phones in time for them."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, lfilter, sosfilt

from lipmotion.types import Audio, Span, Timeline, Unit

RATE_HZ = 16_000
Samples = NDArray[np.float64]


def noise(duration_s: float, low_hz: float = 500, high_hz: float = 6000) -> Samples:
    sections = butter(2, [low_hz, high_hz], "band", fs=RATE_HZ, output="sos")
    return sosfilt(sections, np.random.default_rng(3).standard_normal(round(duration_s * RATE_HZ)))


def vowels(source: Samples, tilt: float = 0.0) -> Samples:
    """Return a source through resonances of 600 and 1500 Hz, in syllables of 0.25 s; tilt: how bright, 0 to 1."""
    for hertz in (600, 1500):
        angle = 2 * np.pi * hertz / RATE_HZ
        source = lfilter([1], [1, -1.9 * np.cos(angle), 0.9025], source)
    source = lfilter([1, -tilt], [1], source)
    time_s = np.arange(len(source)) / RATE_HZ
    return source / np.abs(source).max() * (0.15 + np.sin(np.pi * time_s / 0.25) ** 2)


def pulses(duration_s: float, hertz: float | Samples) -> Samples:
    phase = np.arange(round(duration_s * RATE_HZ)) * hertz / RATE_HZ
    return np.diff(np.floor(phase), prepend=0.0)


def laugh(calls: int = 8, apart_s: float = 0.2) -> Samples:
    """Return calls of 80 ms, the voice falling, with breath between them."""
    found = 0.03 * noise(calls * apart_s)
    for number in range(calls):
        first = round(number * apart_s * RATE_HZ)
        call = vowels(pulses(0.08, 320 - 8 * number))
        found[first : first + len(call)] += call * np.hanning(len(call)) * 0.93**number
    return found


def recording(*parts: tuple[float, Samples]) -> Audio:
    """Return sounds at their times, in a faint hiss, up to 0.5 s after the last one."""
    length = max(round(at_s * RATE_HZ) + len(samples) for at_s, samples in parts) + RATE_HZ // 2
    sound = 3e-4 * np.random.default_rng(0).standard_normal(length)
    for at_s, samples in parts:
        sound[round(at_s * RATE_HZ) : round(at_s * RATE_HZ) + len(samples)] += 0.3 * samples
    return Audio(sound.astype(np.float32), RATE_HZ)


def said(end_s: float, *spoken: tuple[float, float], confidence: float | None = None) -> Timeline[Unit]:
    """Return vowels of 0.25 s in some spans, silence elsewhere."""
    spans, at_s = [], 0.0
    for first_s, last_s in spoken:
        spans.append(Span(at_s, first_s, Unit("sil", confidence=confidence)))
        for start_s in np.arange(first_s, last_s - 1e-9, 0.25).tolist():
            spans.append(Span(start_s, min(start_s + 0.25, last_s), Unit("aa", confidence=confidence)))
        at_s = last_s
    return Timeline((*spans, Span(at_s, end_s, Unit("sil", confidence=confidence))))
