from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lipmotion.pipeline.model import Model
from lipmotion.speech.features import speaker_similarity as module
from lipmotion.speech.features.analysed_audio import analysed
from lipmotion.speech.features.mfcc import mfcc
from lipmotion.speech.features.speaker_similarity import WARPS, speaker_similarity
from lipmotion.stats.mixture import QuadraticForm
from lipmotion.testing.toy import toy_sentences
from lipmotion.types import Audio


def test_a_warped_voice_is_warped_back(toy_model: Model) -> None:
    """Its spectra are those of the known voice, stretched."""
    audio = toy_sentences(3)[0].audio
    before = speaker_similarity(toy_model.phones, analysed(audio)).score
    for factor, expected in ((1.12, 0.88), (0.89, 1.12)):
        positions = np.arange(0, len(audio.samples) - 1, factor)
        other = Audio(np.interp(positions, np.arange(len(audio.samples)), audio.samples).astype(np.float32), 16_000)
        similarity = speaker_similarity(toy_model.phones, analysed(other))
        assert abs(similarity.warp - expected) < 0.07
        assert similarity.score < before


def test_the_warp_chosen_is_the_most_similar(toy_model: Model) -> None:
    draw = np.random.default_rng(3)
    audio = Audio(draw.normal(0, 0.1, 16_000).astype(np.float32), 16_000)
    similarity = speaker_similarity(toy_model.phones, analysed(audio))
    fits = {warp: toy_model.phones.fit(mfcc(audio, warp).values) for warp in WARPS}
    assert similarity.warp == max(fits, key=lambda warp: fits[warp])
    assert similarity.score == pytest.approx(max(fits.values()) - toy_model.phones.typical_fit)


def test_a_long_recording_is_judged_by_its_loudest_stretch(toy_model: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    spoken = toy_sentences(3)[0].audio.samples
    quiet = np.zeros(5 * 16_000, np.float32)
    long = Audio(np.concatenate([quiet, spoken, quiet]), 16_000)
    monkeypatch.setattr(module, "JUDGED_FRAMES", len(spoken) // 160)
    judged = []

    def log_likelihood(_: QuadraticForm, values: np.ndarray) -> np.ndarray:
        judged.append(len(values))
        return np.zeros((len(values), 1))

    monkeypatch.setattr(QuadraticForm, "log_likelihood", log_likelihood)
    speaker_similarity(replace(toy_model.phones), analysed(long))
    assert set(judged) == {len(spoken) // 160 + 1}
    stretch = analysed(long).loudest_stretch(len(spoken) // 160)
    assert np.abs(stretch.samples).sum() > 0.95 * np.abs(spoken).sum()
