import numpy as np
import pytest

from lipmotion.speech.sound.breaths import find_breaths
from lipmotion.types import Audio
from speech.made_voices import RATE_HZ, noise, pulses, recording, said, vowels

PHRASE = (0.5, vowels(pulses(1.5, 120)))
"""One and a half seconds of plain voice."""


@pytest.mark.parametrize(
    ("hertz", "is_breath"), [((700, 4500), True), ((4500, 7500), False), ((60, 500), False)], ids=("h", "s", "rumble")
)
def test_noise_in_a_pause_is_a_breath_if_it_has_the_spectrum_of_one(hertz: tuple[float, float], is_breath: bool):
    breath = 0.05 * noise(0.4, *hertz) * np.hanning(round(0.4 * RATE_HZ))
    audio = recording(PHRASE, (2.5, breath), (3.2, PHRASE[1]))
    breaths = find_breaths(audio, said(5.2, (0.5, 2.0), (3.2, 4.7)))
    assert len(breaths) == is_breath
    for start_s, end_s in breaths:
        assert 2.45 < start_s < 2.7 < end_s < 2.95


@pytest.mark.parametrize("level", [0.0, 0.01])
def test_silence_and_hiss_say_nothing(level: float):
    samples = level * np.random.default_rng(0).standard_normal(32_000)
    assert not find_breaths(Audio(samples.astype(np.float32), RATE_HZ), said(2.0))
