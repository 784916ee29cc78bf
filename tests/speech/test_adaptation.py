from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from lipmotion import Model, errors, types
from lipmotion.speech.features.analysed_audio import analysed
from lipmotion.speech.recognition import adaptation
from lipmotion.speech.recognition.adaptation_estimation import EstimatedAdaptation, estimate_adaptation
from lipmotion.speech.recognition.recogniser import Recogniser
from lipmotion.stats.constrained_mllr import log_determinant
from lipmotion.units.phones import count_phone_edits
from testing.toy import toy_sentences


@pytest.fixture(scope="module")
def audio() -> types.Audio:
    return toy_sentences(3)[0].audio


def some() -> adaptation.Adaptation:
    draw = np.random.default_rng(0)
    return adaptation.Adaptation(1.06, 0.25, draw.normal(size=(39, 40)), draw.normal(size=(3, 13, 14)))


def test_own_features_are_warped_then_transformed_and_general_ones_stream_by_stream(audio: types.Audio) -> None:
    heard, nothing, one = analysed(audio), adaptation.identity_adaptation(1.0, 0.5), some()
    plain = heard.general_features
    assert np.array_equal(nothing.own_features(heard), heard.mfcc().values)
    assert np.array_equal(nothing.general_features(heard), plain)
    expected = heard.mfcc(1.06).values @ one.own[:, :-1].T + one.own[:, -1]
    np.testing.assert_allclose(one.own_features(heard), expected, rtol=1e-4, atol=1e-3)
    found = one.general_features(heard)
    for number, transform in enumerate(one.general):
        columns = slice(13 * number, 13 * number + 13)
        expected = plain[:, columns] @ transform[:, :-1].T + transform[:, -1]
        np.testing.assert_allclose(found[:, columns], expected, rtol=1e-3, atol=1e-3)


def test_arrays_and_back_and_damaged_arrays() -> None:
    one, broken = some(), np.eye(39, 40)
    again = adaptation.adaptation_from_arrays(adaptation.adaptation_arrays(one))
    assert (again.warp, again.own_weight) == (one.warp, one.own_weight)
    assert np.array_equal(again.own, one.own)
    assert np.array_equal(again.general, one.general)
    broken.flat[3] = np.nan
    for damage, says in (
        ({"own": None}, "own"),
        ({"general": np.zeros((13, 14))}, "general of shape"),
        ({"numbers": np.array([1.0, 1.5])}, "a warp of 1.0 and a weight of the own models of 1.5"),
        ({"numbers": np.array([0.0, 0.5])}, "a warp of 0.0"),
        ({"numbers": np.array(["a", "b"])}, "numbers holds <U1, required fractions"),
        ({"own": broken}, "own holds values that are not finite"),
    ):
        arrays = {
            key: value for key, value in (adaptation.adaptation_arrays(one) | damage).items() if value is not None
        }
        with pytest.raises(errors.ModelFormatError, match=f"{says}.*adapt the model again"):
            adaptation.adaptation_from_arrays(arrays)


def test_a_warp_of_one_takes_the_features_that_are_known(audio: types.Audio) -> None:
    features, one = replace(analysed(audio).mfcc(), values=np.ones((300, 39), np.float32)), replace(some(), warp=1.0)
    np.testing.assert_allclose(one.own_features(analysed(audio, features))[7], one.own.sum(axis=1), rtol=1e-4)


@pytest.fixture(scope="module")
def voice() -> list[types.Audio]:
    """Not those that the toy model was trained on, but of the same voice."""
    return [sentence.audio for sentence in toy_sentences(12)[8:]]


@pytest.fixture(scope="module")
def same_speaker(toy_model: Model, voice: list[types.Audio]) -> EstimatedAdaptation:
    return estimate_adaptation(toy_model.phones, voice)


def through_a_telephone(audio: types.Audio) -> types.Audio:
    samples = lfilter(*butter(2, [300 / 8000, 3000 / 8000], "band"), audio.samples)
    return types.Audio(np.asarray(samples, np.float32), audio.rate_hz)


def fit(model: Model, found: EstimatedAdaptation, audio: types.Audio) -> float:
    adapted = found.adaptation.own_features(analysed(audio))
    return model.phones.fit(adapted) + log_determinant(found.adaptation.own)


@pytest.mark.long
def test_the_speaker_of_the_training_has_full_weight_and_changes_little(
    toy_model: Model, voice: list[types.Audio], same_speaker: EstimatedAdaptation
) -> None:
    one = same_speaker.adaptation
    assert (one.warp, one.own_weight) == (1.0, 1.0)
    assert 0.3 < same_speaker.speech_s / sum(audio.duration_s for audio in voice) < 1
    before, after = (Recogniser(toy_model.phones, "own", how) for how in (None, one))
    for audio in voice:
        features = analysed(audio).mfcc()
        changed = one.own_features(analysed(audio)) - features.values
        assert np.sqrt(np.square(changed).mean()) < 0.5
        first, then = ([s.label.phone for s in recogniser.recognise(audio, features)] for recogniser in (before, after))
        assert count_phone_edits(first, then) <= 2


def test_a_voice_in_another_channel_becomes_more_probable(toy_model: Model, voice: list[types.Audio]) -> None:
    """By features of a short recording that move apart from their deltas and these from theirs."""
    one, other = (through_a_telephone(audio) for audio in voice[:2])
    found = estimate_adaptation(toy_model.phones, [other])
    plain = toy_model.phones.fit(analysed(one).mfcc(found.adaptation.warp).values)
    assert fit(toy_model, found, one) > plain + 0.5
    block, own = np.arange(39) // 13, found.adaptation.own[:, :-1]
    between = block[:, None] != block
    assert not own[between].any()
    assert np.abs(own[~between]).sum() > 39


@pytest.mark.long
def test_much_speech_moves_them_together(
    same_speaker: EstimatedAdaptation, toy_model: Model, voice: list[types.Audio]
) -> None:
    long = estimate_adaptation(toy_model.phones, voice * 3)
    assert long.speech_s == pytest.approx(3 * same_speaker.speech_s, rel=0.1)
    assert long.speech_s > 10
    assert np.abs(long.adaptation.own[:13, 13:39]).max() > 1e-3


def test_too_little_speech(toy_model: Model, voice: list[types.Audio]) -> None:
    loud = int(np.abs(voice[0].samples).argmax())
    short = np.pad(voice[0].samples[max(loud - 4000, 0) : loud + 4000], 16_000)
    for samples, message in (
        (0.01 * np.random.default_rng(0).normal(size=32_000), "no speech found"),
        (short, r"found 0.\d s of speech, required at least 1 s"),
    ):
        with pytest.raises(errors.InputError, match=message):
            estimate_adaptation(toy_model.phones, [types.Audio(samples.astype(np.float32), 16_000)])
