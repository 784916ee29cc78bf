from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from lipmotion import Model
from lipmotion.errors import InputError
from lipmotion.speech.features.analysed_audio import analysed
from lipmotion.speech.recognition.adaptation_estimation import EstimatedAdaptation, estimate_adaptation
from lipmotion.speech.recognition.recogniser import Recogniser
from lipmotion.stats.constrained_mllr import log_determinant
from lipmotion.testing.toy import toy_sentences
from lipmotion.types import Audio
from lipmotion.units.phones import count_phone_edits


@pytest.fixture(scope="module")
def voice() -> list[Audio]:
    """Not those that the toy model was trained on, but of the same voice."""
    return [sentence.audio for sentence in toy_sentences(12)[8:]]


@pytest.fixture(scope="module")
def same_speaker(toy_model: Model, voice: list[Audio]) -> EstimatedAdaptation:
    return estimate_adaptation(toy_model.phones, voice)


def through_a_telephone(audio: Audio) -> Audio:
    samples = lfilter(*butter(2, [300 / 8000, 3000 / 8000], "band"), audio.samples)
    return Audio(np.asarray(samples, np.float32), audio.rate_hz)


def fit(model: Model, found: EstimatedAdaptation, audio: Audio) -> float:
    adapted = found.adaptation.own_features(analysed(audio))
    return model.phones.fit(adapted) + log_determinant(found.adaptation.own)


@pytest.mark.long
def test_the_speaker_of_the_training_has_full_weight_and_changes_little(
    toy_model: Model, voice: list[Audio], same_speaker: EstimatedAdaptation
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


def test_a_voice_in_another_channel_becomes_more_probable(toy_model: Model, voice: list[Audio]) -> None:
    far = [through_a_telephone(audio) for audio in voice[:2]]
    found = estimate_adaptation(toy_model.phones, far[1:])
    assert (
        fit(toy_model, found, far[0]) > toy_model.phones.fit(analysed(far[0]).mfcc(found.adaptation.warp).values) + 0.5
    )


def test_a_short_recording_moves_features_deltas_and_their_deltas_apart(toy_model: Model, voice: list[Audio]) -> None:
    own = estimate_adaptation(toy_model.phones, [through_a_telephone(voice[0])]).adaptation.own
    block = np.arange(39) // 13
    between = block[:, None] != block
    assert not own[:, :-1][between].any()
    assert np.abs(own[:, :-1][~between]).sum() > 39


@pytest.mark.long
def test_much_speech_moves_them_together(
    same_speaker: EstimatedAdaptation, toy_model: Model, voice: list[Audio]
) -> None:
    long = estimate_adaptation(toy_model.phones, voice * 3)
    assert long.speech_s == pytest.approx(3 * same_speaker.speech_s, rel=0.1)
    assert long.speech_s > 10
    assert np.abs(long.adaptation.own[:13, 13:39]).max() > 1e-3


def test_no_speech(toy_model: Model) -> None:
    samples = 0.01 * np.random.default_rng(0).normal(size=32_000)
    with pytest.raises(InputError, match="no speech found in the recordings; give some of the voice"):
        estimate_adaptation(toy_model.phones, [Audio(samples.astype(np.float32), 16_000)])


def test_too_little_speech(toy_model: Model, voice: list[Audio]) -> None:
    loud = int(np.abs(voice[0].samples).argmax())
    samples = np.concatenate([np.zeros(16_000), voice[0].samples[max(loud - 4000, 0) : loud + 4000], np.zeros(16_000)])
    with pytest.raises(InputError, match=r"found 0.\d s of speech, required at least 1 s; give more of this voice"):
        estimate_adaptation(toy_model.phones, [Audio(samples.astype(np.float32), 16_000)])
