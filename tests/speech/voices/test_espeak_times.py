"""Where espeak-ng's library is wrong about the start of a phone."""

from __future__ import annotations

import numpy as np

from lipmotion.speech.voices.espeak import corrected_phone_times
from lipmotion.types import Audio

RATE_HZ = 16_000


def sound(*silences: tuple[float, float], duration_s: float = 1.0) -> Audio:
    """Return a tone with holes."""
    samples = np.sin(np.arange(round(duration_s * RATE_HZ)) * 0.2 + 1).astype(np.float32)
    samples[np.abs(samples) < 0.1] = 0.1
    for start_s, end_s in silences:
        samples[round(start_s * RATE_HZ) : round(end_s * RATE_HZ)] = 0
    return Audio(samples, RATE_HZ)


def starts(labels: list[tuple[str, float]], audio: Audio) -> list[float]:
    return [round(span.start_s, 4) for span in corrected_phone_times(labels, audio)]


def test_a_stop_begins_with_its_closure() -> None:
    for stop in ("p", "t2", "k", "tS", "b", "d", "g", "dZ"):
        assert starts([("a", 0.1), (stop, 0.4), ("i:", 0.5)], sound((0.35, 0.42))) == [0.1, 0.35, 0.5]


def test_a_long_silence_is_not_all_closure() -> None:
    assert starts([("a", 0.1), ("p", 0.4)], sound((0.2, 0.4))) == [0.1, 0.34]


def test_other_silences_stay() -> None:
    for before, label in (("a", "s"), ("a", "m"), ("_:", "p"), ("_", "k")):
        assert starts([(before, 0.1), (label, 0.4)], sound((0.35, 0.4))) == [0.1, 0.4]


def test_a_closure_never_reaches_past_the_phone_before() -> None:
    assert starts([("a", 0.1), ("s", 0.38), ("t", 0.4)], sound((0.35, 0.4))) == [0.1, 0.38, 0.38]


def test_a_stop_without_silence_or_at_the_start_stays() -> None:
    assert starts([("a", 0.1), ("b", 0.4)], sound()) == [0.1, 0.4]
    assert starts([("a", 0.0), ("b", 0.0)], sound()) == [0.0, 0.0]


def test_an_l_that_is_late_gets_its_share_of_the_vowel() -> None:
    assert starts([("OI", 0.1), ("l", 0.29), ("d", 0.3)], sound()) == [0.1, 0.21, 0.3]
    assert starts([("OI", 0.1), ("l", 0.2), ("d", 0.3)], sound()) == [0.1, 0.2, 0.3]
    assert starts([("t", 0.1), ("l", 0.29), ("d", 0.3)], sound()) == [0.1, 0.29, 0.3]


def test_the_last_lasts_to_the_end() -> None:
    phones = corrected_phone_times([("a", 0.1), ("s", 0.5)], sound())
    assert [(span.label, span.end_s) for span in phones] == [("a", 0.5), ("s", 1.0)]


def test_silence_is_closed_everywhere() -> None:
    assert starts([("a", 0.1), ("p", 0.5)], Audio(np.zeros(RATE_HZ, np.float32), RATE_HZ)) == [0.1, 0.5]
