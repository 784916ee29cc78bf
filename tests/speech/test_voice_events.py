import numpy as np
import pytest
from scipy.signal import find_peaks

from lipmotion.speech.sound.voice_events import find_risen_peaks, find_voice_events, silence_units
from lipmotion.types import Audio, Timeline, Unit
from lipmotion.types.audio import BREATH, LAUGHTER, SHOUT, WHISPER
from speech.made_voices import RATE_HZ, laugh, noise, pulses, recording, said, vowels


def found(audio: Audio, units: Timeline[Unit]) -> list[tuple[str, float, float]]:
    return [(event.kind, event.start_s, event.end_s) for event in find_voice_events(audio, units)]


PHRASE = (0.5, vowels(pulses(1.5, 120)))
"""One and a half seconds of plain voice."""


def test_laughter_is_heard_by_its_calls_and_phones_recognised_in_it_become_silence():
    audio = recording(PHRASE, (2.6, laugh()))
    units = said(4.7, (0.5, 2.0), (2.6, 4.1), confidence=0.1)
    (event,) = find_voice_events(audio, units)
    assert event.kind == LAUGHTER
    assert event.strength > 0.7
    assert (event.start_s, event.end_s) == pytest.approx((2.6, 4.1), abs=0.12)
    times_s, loud = zip(*event.calls, strict=True)
    assert times_s == pytest.approx(2.64 + 0.2 * np.arange(8), abs=0.03)
    assert loud[0] == max(loud) == 1
    assert loud[-1] < 0.8
    left = silence_units(units, [(event.start_s, event.end_s)])
    assert [span.label.phone for span in left if span.start_s < 2.3] == ["sil", *["aa"] * 6, "sil"]
    assert {span.label.phone for span in left if span.start_s > 2.3} == {"sil"}
    for confidence in (None, 0.9):  # what has words is no laughter
        assert not found(audio, said(4.7, (0.5, 2.0), (2.6, 4.1), confidence=confidence))


def test_a_phrase_without_a_voice_is_whispered_and_one_with_a_voice_is_not():
    audio = recording(PHRASE, (2.6, vowels(noise(1.5))))
    (event,) = find_voice_events(audio, said(4.6, (0.5, 2.0), (2.6, 4.1)))
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


@pytest.mark.parametrize("prominence", [0.1, 1.0, 3.0])
@pytest.mark.parametrize("count", [3, 10, 500])
def test_peaks_are_those_of_scipy(count: int, prominence: float) -> None:
    for seed in range(5):
        curve = np.cumsum(np.random.default_rng(seed).normal(size=count))
        found = find_peaks(curve, prominence=prominence)[0]
        assert find_risen_peaks(curve, prominence).tolist() == found.tolist()
