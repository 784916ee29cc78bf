"""Voice events in sounds that are made here: voices of pulses through resonances, noise, and silence with a faint hiss."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import butter, lfilter, sosfilt

from lipmotion.speech.features.voice_events import voice_events, without_laughter
from lipmotion.types import Audio, Span, Timeline, Unit
from lipmotion.types.voice_event import BREATH, LAUGHTER, SHOUT, WHISPER

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


def pulses(duration_s: float, hertz: float) -> Samples:
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


def found(audio: Audio, units: Timeline[Unit]) -> list[tuple[str, float, float]]:
    return [(event.kind, event.start_s, event.end_s) for event in voice_events(audio, units)]


PHRASE = (0.5, vowels(pulses(1.5, 120)))
"""One and a half seconds of plain voice."""


def test_laughter_is_heard_by_its_calls_and_phones_recognised_in_it_become_silence():
    audio = recording(PHRASE, (2.6, laugh()))
    units = said(4.7, (0.5, 2.0), (2.6, 4.1), confidence=0.1)
    (event,) = voice_events(audio, units)
    assert event.kind == LAUGHTER
    assert event.strength > 0.7
    assert (event.start_s, event.end_s) == pytest.approx((2.6, 4.1), abs=0.12)
    times_s, loud = zip(*event.calls, strict=True)
    assert times_s == pytest.approx(2.64 + 0.2 * np.arange(8), abs=0.03)
    assert loud[0] == max(loud) == 1
    assert loud[-1] < 0.8
    left = without_laughter(units, [event])
    assert [span.label.phone for span in left if span.start_s < 2.3] == ["sil", *["aa"] * 6, "sil"]
    assert {span.label.phone for span in left if span.start_s > 2.3} == {"sil"}


@pytest.mark.parametrize("confidence", [None, 0.9])
def test_what_has_words_is_no_laughter(confidence: float | None):
    audio = recording(PHRASE, (2.6, laugh()))
    assert not found(audio, said(4.7, (0.5, 2.0), (2.6, 4.1), confidence=confidence))


def test_a_phrase_without_a_voice_is_whispered_and_one_with_a_voice_is_not():
    audio = recording(PHRASE, (2.6, vowels(noise(1.5))))
    (event,) = voice_events(audio, said(4.6, (0.5, 2.0), (2.6, 4.1)))
    assert (event.kind, event.strength) == (WHISPER, 1)
    assert (event.start_s, event.end_s) == (2.6, 4.1)


def test_where_noise_may_hide_the_voice_nothing_is_whispered():
    audio = recording((0.0, 0.5 * noise(4.6)), (0.5, 0.3 * vowels(noise(1.5))))
    assert WHISPER not in {kind for kind, *_ in found(audio, said(4.6, (0.5, 2.0)))}


@pytest.mark.parametrize(
    ("hertz", "is_breath"), [((700, 4500), True), ((4500, 7500), False), ((60, 500), False)], ids=("h", "s", "rumble")
)
def test_noise_in_a_pause_is_a_breath_if_it_has_the_spectrum_of_one(hertz: tuple[float, float], is_breath: bool):
    breath = 0.05 * noise(0.4, *hertz) * np.hanning(round(0.4 * RATE_HZ))
    audio = recording(PHRASE, (2.5, breath), (3.2, PHRASE[1]))
    events = found(audio, said(5.2, (0.5, 2.0), (3.2, 4.7)))
    assert [kind for kind, *_ in events] == [BREATH] * is_breath
    for _, start_s, end_s in events:
        assert 2.45 < start_s < 2.7 < end_s < 2.95


def test_one_phrase_is_shouted_if_it_is_higher_brighter_and_louder():
    plain, bright = pulses(1.0, 120), vowels(pulses(1.0, 210), 0.95)
    spans = [(0.5 + 1.5 * number, 1.5 + 1.5 * number) for number in range(6)]
    for last, kinds in ((2.5 * bright, [SHOUT]), (bright, [])):
        sounds = [vowels(plain)] * 5 + [last]
        audio = recording(*((start_s, sound) for (start_s, _), sound in zip(spans, sounds, strict=True)))
        events = found(audio, said(10.0, *spans))
        assert [kind for kind, *_ in events] == kinds
        assert all(start_s == spans[-1][0] for _, start_s, _ in events)


@pytest.mark.parametrize("level", [0.0, 0.01])
def test_silence_and_hiss_say_nothing(level: float):
    samples = level * np.random.default_rng(0).standard_normal(32_000)
    assert not found(Audio(samples.astype(np.float32), RATE_HZ), said(2.0))
