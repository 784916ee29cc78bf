import numpy as np
import pytest
from scipy.signal import find_peaks

from lipmotion.speech.sound.voice_events import find_risen_peaks, find_voice_events, silence_units
from lipmotion.types import Audio, Timeline, Unit
from lipmotion.types.audio import BREATH, LAUGHTER
from speech.made_voices import RATE_HZ, laugh, noise, pulses, recording, said, vowels


def found(audio: Audio, units: Timeline[Unit]) -> list[tuple[str, float, float]]:
    return [(event.kind, event.start_s, event.end_s) for event in find_voice_events(audio, units)]


PHRASE = (0.5, vowels(pulses(1.5, 120)))  # one and a half seconds of plain voice


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
