from dataclasses import replace

import numpy as np
import pytest

from lipmotion import errors, types
from lipmotion.engines import engine_named
from lipmotion.hmm.multistream import phone_recogniser as module
from lipmotion.storage.archive import NO_CHECKPOINT, Checkpoint
from lipmotion.testing import example, examples, speech, timeline

SENTENCE = ("t", "aa", "p", "iy", "m", "uw", "s", "aa")


def phones(units):
    return [span.label.phone for span in units]


def fitted(corpus, checkpoint=NO_CHECKPOINT, **options):
    values = [one.motion.values[:, :2] for one in corpus]
    return module.fit_phone_recogniser(corpus, values, types.silent_monitor, checkpoint, **options)


@pytest.fixture(scope="module")
def corpus():
    return examples(12)


@pytest.fixture(scope="module")
def recogniser(corpus):
    return fitted(corpus, min_minutes=0.1)


def test_too_little_speech_gives_no_recogniser(corpus):
    assert fitted(corpus) is None


def test_phones_of_a_speaker_of_the_training_are_recognised(recogniser):
    spoken = speech(timeline(SENTENCE), seed=77)
    found = recogniser.phones(replace(spoken, units=types.Timeline(())))
    assert phones(found) == ["sil", *SENTENCE, "sil"]
    for span, true in zip(found, spoken.units, strict=True):
        assert abs(span.start_s - true.start_s) < 0.03
    assert found[-1].end_s == spoken.features.duration_s


def test_another_speaker_silence_and_long_recordings_are_left_to_the_shared_recogniser(recogniser):
    spoken = speech(timeline(SENTENCE))
    values, duration_s = spoken.features.values, spoken.features.duration_s
    strange = np.random.default_rng(0).normal(0, 3, values.shape).astype(np.float32)
    for features in (
        types.Features(strange, duration_s),
        types.Features(np.zeros_like(values), duration_s),  # digital silence
        types.Features(values[:2], 0.01),
        types.Features(np.tile(values, (1 + round(100 * module.LONGEST_S) // len(values), 1)), 2 * module.LONGEST_S),
    ):
        assert recogniser.phones(replace(spoken, features=features)) is None


def test_a_recogniser_is_deserialised(recogniser):
    arrays = module.recogniser_to_arrays(recogniser)
    again = module.recogniser_from_arrays(arrays)
    assert again.training_score == recogniser.training_score
    spoken = speech(timeline(SENTENCE), seed=3)
    assert phones(again.phones(spoken)) == phones(recogniser.phones(spoken))
    assert module.recogniser_from_arrays({"means": np.zeros(3)}) is None
    for name in sorted(arrays)[::3]:
        with pytest.raises((errors.ModelFormatError, KeyError, ValueError)):
            module.recogniser_from_arrays({key: array for key, array in arrays.items() if key != name})


def test_a_trained_recogniser_is_kept_in_the_checkpoint(corpus, recogniser, tmp_path):
    checkpoint = Checkpoint(tmp_path, "one")
    first = module.recogniser_to_arrays(fitted(corpus, checkpoint, min_minutes=0.1))
    again = module.recogniser_to_arrays(fitted(corpus[::-1][:8], checkpoint, min_minutes=0.05))  # not trained on these
    assert [again[name].tobytes() for name in again if name != "joint_typical"] == [
        first[name].tobytes() for name in first if name != "joint_typical"
    ]
    assert first["joint_typical"] == recogniser.training_score


@pytest.mark.long
def test_the_engine_recognises_phones_if_there_is_enough_speech(monkeypatch):
    monkeypatch.setattr(module.fit_phone_recogniser, "__defaults__", (0.1,))
    engine = engine_named("trajectory", {"components": 2, "acoustic_components": 20})
    corpus = examples(10)
    model = engine.fit(corpus, types.silent_monitor).model
    spoken = example(SENTENCE, seed=50).speech
    recognised = engine.recognise(model, spoken)
    assert phones(recognised) == ["sil", *SENTENCE, "sil"]
    back = engine.from_arrays(engine.to_arrays(model))
    assert phones(engine.recognise(back, spoken)) == phones(recognised)
    without = engine_named("trajectory", {"components": 2, "acoustic_components": 20, "joint_recogniser": False})
    assert without.recognise(without.fit(corpus, types.silent_monitor).model, spoken) is None
