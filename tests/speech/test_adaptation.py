from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lipmotion.errors import ModelFormatError
from lipmotion.speech.features.analysed_audio import analysed
from lipmotion.speech.recognition.adaptation import (
    Adaptation,
    adaptation_arrays,
    adaptation_from_arrays,
    identity_adaptation,
)
from lipmotion.testing.toy import toy_sentences
from lipmotion.types import Audio


@pytest.fixture(scope="module")
def audio() -> Audio:
    return toy_sentences(3)[0].audio


def some() -> Adaptation:
    draw = np.random.default_rng(0)
    return Adaptation(1.06, 0.25, draw.normal(size=(39, 40)), draw.normal(size=(3, 13, 14)))


def test_no_adaptation_changes_nothing(audio: Audio) -> None:
    nothing = identity_adaptation(1.0, 0.5)
    assert np.array_equal(nothing.own_features(analysed(audio)), analysed(audio).mfcc().values)
    assert np.array_equal(nothing.general_features(analysed(audio)), analysed(audio).general_features)


def test_own_features_are_warped_then_transformed(audio: Audio) -> None:
    one = some()
    expected = analysed(audio).mfcc(1.06).values @ one.own[:, :-1].T + one.own[:, -1]
    np.testing.assert_allclose(one.own_features(analysed(audio)), expected, rtol=1e-4, atol=1e-3)


def test_general_features_are_transformed_stream_by_stream(audio: Audio) -> None:
    one, plain = some(), analysed(audio).general_features
    found = one.general_features(analysed(audio))
    for number in range(3):
        columns = slice(13 * number, 13 * number + 13)
        expected = plain[:, columns] @ one.general[number, :, :-1].T + one.general[number, :, -1]
        np.testing.assert_allclose(found[:, columns], expected, rtol=1e-3, atol=1e-3)


def test_arrays_and_back() -> None:
    one = some()
    again = adaptation_from_arrays(adaptation_arrays(one))
    assert (again.warp, again.own_weight) == (one.warp, one.own_weight)
    assert np.array_equal(again.own, one.own)
    assert np.array_equal(again.general, one.general)


def changed(values: np.ndarray, value: float) -> np.ndarray:
    values = values.copy()
    values.flat[3] = value
    return values


def test_damaged_arrays() -> None:
    for damage, says in (
        ({"own": None}, "own"),
        ({"general": np.zeros((13, 14))}, "general of shape"),
        ({"numbers": np.array([1.0, 1.5])}, "a warp of 1.0 and a weight of the own models of 1.5"),
        ({"numbers": np.array([0.0, 0.5])}, "a warp of 0.0"),
        ({"numbers": np.array(["a", "b"])}, "numbers holds <U1, required fractions"),
        ({"own": changed(np.eye(39, 40), np.nan)}, "own holds values that are not finite"),
    ):
        arrays = {key: value for key, value in (adaptation_arrays(some()) | damage).items() if value is not None}
        with pytest.raises(ModelFormatError, match=says) as caught:
            adaptation_from_arrays(arrays)
        assert "adapt the model again" in str(caught.value)


def test_a_warp_of_one_needs_no_other_features(audio: Audio, monkeypatch: pytest.MonkeyPatch) -> None:
    features = analysed(audio).mfcc()
    monkeypatch.setattr(
        "lipmotion.speech.features.analysed_audio.mfcc_of_warps", lambda *_: pytest.fail("computed twice")
    )
    assert replace(some(), warp=1.0).own_features(analysed(audio, features)).shape == features.values.shape
