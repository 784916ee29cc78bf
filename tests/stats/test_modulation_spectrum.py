import numpy as np
import pytest

from lipmotion.stats.modulation_spectrum import measure_modulation_spectrum, window_frames


@pytest.mark.parametrize("rate_hz", [25.0, 100.0])
def test_a_wave_is_at_its_frequency(rate_hz: float) -> None:
    time_s = np.arange(round(4 * rate_hz)) / rate_hz
    frequencies, power = measure_modulation_spectrum([5 + np.sin(2 * np.pi * 6.25 * time_s)[:, None]], rate_hz)
    assert frequencies[power[:, 0].argmax()] == pytest.approx(6.25)
    assert frequencies[-1] == pytest.approx(rate_hz / 2)
    near = abs(frequencies - 6.25) < 2
    assert power[near].sum() > 0.999 * power.sum()


def test_it_is_the_mean_over_windows_and_level_does_not_matter() -> None:
    rng = np.random.default_rng(0)
    size = window_frames(25.0)
    clips = [rng.normal(size=(size, 2)) for _ in range(3)]
    whole = measure_modulation_spectrum(clips, 25.0)[1]
    assert whole == pytest.approx(np.mean([measure_modulation_spectrum([clip + 9], 25.0)[1] for clip in clips], axis=0))
    assert measure_modulation_spectrum([2 * clips[0]], 25.0)[1] == pytest.approx(
        4 * measure_modulation_spectrum(clips[:1], 25.0)[1]
    )


def test_a_short_clip_has_as_many_frequencies() -> None:
    frequencies, power = measure_modulation_spectrum([np.arange(4.0)[:, None]], 25.0)
    assert power.shape == (len(frequencies), 1)
    assert np.isfinite(power).all()
