"""Acoustic conditions: the same draws give the same sound, distortion grows with noise, silence stays silence."""

from __future__ import annotations

import numpy as np
import pytest

from lipmotion.speech.features.mfcc import spectrum
from lipmotion.speech.sound.acoustic_conditions import condition_spectra, in_condition
from lipmotion.testing.toy import toy_sentences
from lipmotion.types import SPECTRUM_BANDS, Audio


@pytest.fixture(scope="module")
def voices() -> list[Audio]:
    """Three sentences."""
    return [sentence.audio for sentence in toy_sentences(3)]


def test_the_same_seed_gives_the_same_spectra_and_another_does_not(voices: list[Audio]) -> None:
    one, same, other = (condition_spectra(voices[0], voices, 4, [seed]) for seed in (7, 7, 8))
    for a, b in zip(one, same, strict=True):
        np.testing.assert_array_equal(a.values, b.values)
    assert any(
        a.values.shape != b.values.shape or not np.allclose(a.values, b.values) for a, b in zip(one, other, strict=True)
    )


def test_the_length_follows_the_tempo(voices: list[Audio]) -> None:
    frames = len(spectrum(voices[0]))
    for version in condition_spectra(voices[0], voices, 8, [1]):
        assert len(version.values) == pytest.approx(frames / version.tempo, abs=2)


def test_conditions_leave_speech_recognisable_and_finite(voices: list[Audio]) -> None:
    found = [in_condition(voices[0], voices, np.random.default_rng(seed)) for seed in range(20)]
    assert all(np.isfinite(audio.samples).all() and len(audio.samples) == len(voices[0].samples) for audio, _ in found)
    distortions = np.array([distortion for _, distortion in found])
    assert distortions.min() == 0
    assert distortions.max() > 0.5
    quiet = np.mean([np.abs(spectrum(audio) - spectrum(voices[0])).mean() for audio, d in found if d < 0.2])
    covered = np.mean([np.abs(spectrum(audio) - spectrum(voices[0])).mean() for audio, d in found if d > 0.5])
    assert covered > 1.5 * quiet


def test_silence_stays_as_it_is(voices: list[Audio]) -> None:
    silence = Audio(np.zeros(16_000, np.float32), 16_000)
    for seed in range(5):
        audio, distortion = in_condition(silence, voices, np.random.default_rng(seed))
        assert not audio.samples.any()
        assert distortion == 0


def test_bands_are_normalised(voices: list[Audio]) -> None:
    bands = spectrum(voices[0])
    assert bands.shape[1] == SPECTRUM_BANDS
    assert np.abs(bands.mean(axis=0)).max() < 1e-3
    assert 0.5 < bands.std() < 1.5
    louder = spectrum(Audio(voices[0].samples * 4, 16_000))
    np.testing.assert_allclose(louder, bands, atol=2e-2)
