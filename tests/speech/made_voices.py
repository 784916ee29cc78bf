"""Sounds that are made: pulses or noise through resonances, laughter, phones in time for them, a scene in a room."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, lfilter, sosfilt

from lipmotion.types import Audio, Span, Timeline, Unit
from testing.toy import toy_sentences

RATE_HZ = 16_000
Samples = NDArray[np.float64]


def noise(duration_s: float, low_hz: float = 500, high_hz: float = 6000) -> Samples:
    sections = butter(2, [low_hz, high_hz], "band", fs=RATE_HZ, output="sos")
    return sosfilt(sections, np.random.default_rng(3).standard_normal(round(duration_s * RATE_HZ)))


def hiss(seconds: float, units: float = 0.0) -> NDArray[np.float32]:
    """Return noise of so many units of 16 bits; 0: digital silence."""
    values = np.random.default_rng(0).uniform(-units, units, round(seconds * RATE_HZ))
    return (values / 32768).astype(np.float32)


def spoken(number: int) -> NDArray[np.float32]:
    """Return a sentence of the toy corpus, in whole frames."""
    samples = toy_sentences(12)[number].audio.samples
    return samples[: len(samples) // 160 * 160]


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


ROOM_S, DECAY_S, ROOM_LEVEL = 0.25, 0.35, 0.04
"""The room in which one scene is recorded twice: by a camera there, and by a recorder at the mouth."""


def clap(chance: np.random.Generator) -> np.ndarray:
    """Return noise that decays within a few milliseconds."""
    count = int(0.03 * RATE_HZ)
    return 0.7 * chance.normal(size=count) * np.exp(-np.arange(count) / (0.003 * RATE_HZ))


def room(chance: np.random.Generator) -> np.ndarray:
    """Return the response of a room: what arrives straight, and as much energy again in echoes."""
    count = int(ROOM_S * RATE_HZ)
    echoes = ROOM_LEVEL * chance.normal(size=count) * np.exp(-6.9 * np.arange(count) / (DECAY_S * RATE_HZ))
    echoes[: RATE_HZ // 500] = 0
    echoes[0] = 1
    return echoes


def recorded_twice(
    scene: np.ndarray, chance: np.random.Generator, camera_cut: int, recorder_before: int, noise_db: float = 20.0
) -> tuple[Audio, Audio, float]:
    """Return what camera and recorder have of a scene, and by how many seconds the recorder's is late.

    camera_cut      : samples of the scene that the camera misses at its beginning
    recorder_before : samples that the recorder runs before the scene begins
    noise_db        : level of the scene above the noise, in the camera
    """
    far = 0.3 * np.convolve(scene, room(chance))[camera_cut : len(scene)]
    far = far + 10 ** (-noise_db / 20) * np.sqrt(np.mean(far**2)) * chance.normal(size=len(far))
    near = np.concatenate([np.zeros(recorder_before), scene])
    near = near + 1e-3 * chance.normal(size=len(near))
    late_s = (recorder_before + camera_cut) / RATE_HZ
    return Audio(far.astype(np.float32), RATE_HZ), Audio(near.astype(np.float32), RATE_HZ), late_s


def speech_like(chance: np.random.Generator, seconds: float) -> np.ndarray:
    """Return noise in syllables and pauses, with the spectrum of a voice in rough."""
    count = int(seconds * RATE_HZ)
    voice = np.convolve(chance.normal(size=count), np.exp(-np.arange(40) / 8.0), "same")
    edges = np.cumsum(chance.uniform(0.06, 0.3, int(seconds * 12)))
    syllables = np.interp(np.arange(count) / RATE_HZ, edges, chance.uniform(0, 1, len(edges)) ** 2)
    return 0.03 * voice * syllables
