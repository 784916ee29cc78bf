from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from hmm.multistream.synthetic import observed, random_joint, utterances
from lipmotion import errors, types
from lipmotion.engines import engine_named
from lipmotion.errors import AlignmentError, InputError
from lipmotion.hmm.multistream import densities, recognise, unit_states
from lipmotion.hmm.multistream import phone_recogniser as module
from lipmotion.hmm.multistream.densities import SPEECH, ObservedStream, StreamObservations, StreamWeights
from lipmotion.hmm.multistream.recognise import recognise_units
from lipmotion.storage.archive import NO_CHECKPOINT, Checkpoint
from lipmotion.testing import example, examples, speech, timeline
from oracles import joint as slow
from oracles.sequences import segmentations, sequences

WEIGHTS = StreamWeights(0.8, 0.5, 1.0, 0.3, 0.0)


def candidates(hmm, frames):
    counts = {unit: hmm.inventory.count(unit) for unit in hmm.inventory.names}
    return sequences([unit for unit in hmm.inventory.names if unit != "sp"], counts, frames)


@pytest.mark.parametrize("both", [False, True])
@pytest.mark.parametrize(("seed", "states", "frames", "bigram"), [(0, 2, 7, 1.3), (1, 3, 8, 1.3), (4, 2, 7, 4.0)])
def test_nothing_else_is_more_probable(seed, states, frames, bigram, both):
    language = {"bigram_weight": bigram, "insertion": 1.5 if bigram > 2 else -0.4}
    hmm = random_joint(
        seed, states=states, components=1 + seed % 2, both_neighbours=both, recognition=WEIGHTS, **language
    )
    data = observed(np.random.default_rng([seed, 1]), frames)
    density = cache(lambda state, frame: slow.log_density(hmm, data, state, frame, WEIGHTS))
    best, units, lengths = max(slow.everything(hmm, density, frames, candidates(hmm, frames)))
    said, edges = recognise_units(hmm, data)
    assert said == units
    inside = iter(lengths)
    assert np.diff(edges).tolist() == [sum(next(inside) for _ in range(hmm.inventory.count(u))) for u in units]
    assert np.isfinite(best)


def test_what_cannot_be_recognised():
    hmm, data = random_joint(12), utterances(1)[0].observed
    with pytest.raises(InputError, match="switched on are"):
        recognise_units(random_joint(12, recognition=StreamWeights(0, 0, 0, 0, 0)), data)
    with pytest.raises(AlignmentError):
        recognise_units(hmm, observed(np.random.default_rng(0), 2))
    wide = StreamObservations({SPEECH: ObservedStream(np.zeros((9, 4)), np.ones(9, bool))})
    with pytest.raises(InputError, match="has 4 dimensions"):
        recognise_units(hmm, wide)


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


@pytest.mark.long
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


FIVE_WEIGHTS = densities.StreamWeights(1, 0.5, 0.2, 1, 0.7)


def slow_scores(hmm, data, units, weights):
    """Give the score (emissions and transitions) and the durations of every segmentation."""
    states = unit_states.expand_triphones(hmm.inventory, units)
    density = np.array(
        [[slow.log_density(hmm, data, state, t, weights) for state in states.triphones] for t in range(data.frames)]
    )
    stay = hmm.log_stay[states.monophones]
    for lengths in segmentations(data.frames, len(states.monophones)):
        path = np.repeat(np.arange(len(lengths)), lengths)
        kept = ((np.array(lengths) - 1) * stay + np.log(1 - np.exp(stay))).sum()
        yield float(density[np.arange(data.frames), path].sum() + kept), lengths


@pytest.mark.parametrize("bounds", [None, [0, 4, 6, 9]])
def test_no_other_path_is_more_probable(bounds):
    for seed in range(2):
        hmm = random_joint(seed, states=2)
        data, units = observed(np.random.default_rng([seed, 1]), 9), ("sil", "a", "b")
        scores = slow_scores(hmm, data, units, FIVE_WEIGHTS)
        _, lengths = max(each for each in scores if bounds in (None, np.cumsum([0, *each[1]])[::2].tolist()))
        path = recognise.align(hmm, data, units, None if bounds is None else np.array(bounds), FIVE_WEIGHTS)
        assert path.frames.tolist() == np.repeat(np.arange(6), lengths).tolist()
        assert path.bounds(3).tolist() == np.cumsum([0, *lengths])[::2].tolist()


def test_short_units_have_some_of_their_states():
    hmm, data = random_joint(0), observed(np.random.default_rng(1), 10)
    path = recognise.align(hmm, data, ("sil", "a", "b", "a", "sil"), np.array([0, 3, 5, 6, 6, 10]))
    assert path.frames.tolist()[:6] == [0, 1, 2, 3, 5, 7]
    assert path.bounds(5).tolist() == [0, 3, 5, 6, 6, 10]


def test_what_does_not_fit_is_refused():
    hmm, data = random_joint(6), observed(np.random.default_rng(7), 8)
    with pytest.raises(AlignmentError, match="at least 9 frames"):
        recognise.align(hmm, data, ("a", "b", "a"))
    with pytest.raises(InputError, match="unknown unit"):
        recognise.align(hmm, data, ("q",))
