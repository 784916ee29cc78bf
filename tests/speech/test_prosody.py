import numpy as np
import pytest

from lipmotion.speech.features.f0 import prosody_of
from lipmotion.types import Audio


def test_level_and_pitch_of_a_tone_that_rises_and_gets_louder():
    time_s = np.arange(32_000) / 16_000
    hz, gain = np.where(time_s < 1, 120.0, 180.0), np.where(time_s < 1, 0.1, 0.4)
    phase = 2 * np.pi * np.cumsum(hz) / 16_000
    samples = gain * sum(np.sin(k * phase) / k for k in range(1, 6))
    voice = prosody_of(Audio(samples.astype(np.float32), 16_000))
    assert len(voice.level_db) == len(voice.log_f0) == 201
    assert voice.level_db[120:180].mean() - voice.level_db[20:80].mean() == pytest.approx(20 * np.log10(4), abs=0.3)
    assert np.exp(np.nanmedian(voice.log_f0[20:80])) == pytest.approx(120, rel=0.03)
    assert np.exp(np.nanmedian(voice.log_f0[120:180])) == pytest.approx(180, rel=0.03)


def test_silence_is_quiet_and_without_pitch():
    voice = prosody_of(Audio(np.zeros(16_000, np.float32), 16_000))
    assert voice.level_db.max() < -80
    assert not np.isfinite(voice.log_f0).any()


def test_a_level_is_the_mean_power_of_10_ms_before_and_after() -> None:
    samples = np.random.default_rng(4).normal(0, 0.1, 1_650).astype(np.float32)
    levels = prosody_of(Audio(samples, 16_000)).level_db
    around = [samples[max(160 * n - 160, 0) : 160 * n + 160].astype(float) for n in range(11)]
    assert levels == pytest.approx([10 * np.log10(np.mean(part**2) + 1e-9) for part in around])
