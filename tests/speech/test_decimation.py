import numpy as np
import pytest
from scipy.signal import resample_poly

from lipmotion.speech.sound import resampling
from lipmotion.speech.sound.resampling import decimated


def test_it_is_what_scipy_computes():
    for factor, length in ((2, 1), (3, 5), (6, 100), (3, 2401)):
        sound = np.random.default_rng(length).normal(0, 0.1, length).astype(np.float32)
        found, expected = decimated(sound, factor), resample_poly(sound, 1, factor)
        assert found.dtype == np.float32
        assert found.shape == expected.shape
        assert found == pytest.approx(expected, abs=1e-6)


def test_a_sound_at_the_same_rate_stays():
    sound = np.arange(5, dtype=np.float32)
    assert np.array_equal(decimated(sound, 1), sound)
    assert not len(decimated(sound[:0], 3))


@pytest.mark.parametrize("length", [599, 600, 1_000])
def test_blocks_make_no_difference(length: int, monkeypatch: pytest.MonkeyPatch) -> None:
    sound = np.random.default_rng(7).normal(0, 0.1, length).astype(np.float32)
    whole = decimated(sound, 3)
    monkeypatch.setattr(resampling, "KEPT_BLOCK", 50)
    assert decimated(sound, 3) == pytest.approx(whole, abs=1e-7)
