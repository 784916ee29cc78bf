from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from hmm.synthetic import (
    PAUSE,
    SILENCE,
    UNITS,
    align,
    choose,
    decode,
    known_hmm,
    random_hmm,
    sentences,
    speaker,
    within_silence,
)
from lipmotion.errors import AlignmentError, ModelFormatError
from lipmotion.hmm.align import align_units, expand_states, place_words, spread_windows
from lipmotion.hmm.model import HmmConfig, hmm_from_arrays, hmm_to_arrays, make_plain_states
from lipmotion.hmm.network import compute_log_likelihoods
from lipmotion.kernels.paths import Windows
from oracles import sequences

PLAIN = make_plain_states(("sil", "sp", "b", "ih"), (3, 1, 3, 3), free=("sil", "sp"))
TABLE = replace(PLAIN, names=(*PLAIN.names, "b.0<ih", "b.2>sil"))


def test_models_come_back_from_arrays():
    hmm = random_hmm(1, contexts=5)
    hmm.mixtures.log_weights[0] = [0, -np.inf]  # a component that is switched off
    back = hmm_from_arrays(hmm_to_arrays(hmm), hmm.config)
    assert back.mixtures.log_weights[0].tolist() == [0, -np.inf]
    assert back.table == hmm.table
    assert back.bigram.units == hmm.bigram.units
    assert np.array_equal(back.log_stay, hmm.log_stay)
    assert np.array_equal(back.bigram.log_probability, hmm.bigram.log_probability)
    features = np.random.default_rng(1).normal(0, 1.5, (30, 2)).astype(np.float32)
    assert back.mixtures.log_likelihood(features) == pytest.approx(hmm.mixtures.log_likelihood(features), abs=0.1)
    units = ("sil", "a", "b", "sil")
    assert np.array_equal(align(back, features, units), align(hmm, features, units))


def test_a_missing_array_and_one_of_the_wrong_shape_are_a_damaged_model():
    hmm = random_hmm(5, contexts=2)
    whole = hmm_to_arrays(hmm)
    for name in whole:
        with pytest.raises(ModelFormatError, match=name):
            hmm_from_arrays({other: array for other, array in whole.items() if other != name}, hmm.config)
    for name in ("means", "variances", "names", "log_weights", "log_stay", "bigram", "counts"):
        with pytest.raises(ModelFormatError, match="damaged"):
            hmm_from_arrays(whole | {name: whole[name][:-1]}, hmm.config)


def test_states_depend_on_the_nearer_neighbour():
    for count, sides in ((1, [""]), (2, ["<", ">"]), (3, ["<", "", ">"]), (4, list("<<>>"))):
        table = make_plain_states(("u",), (count,), free=())
        assert [table.side("u", state) for state in range(count)] == sides


def test_names_of_states_say_the_neighbour_that_counts():
    assert TABLE.names[:7] == ("sil.0", "sil.1", "sil.2", "sp.0", "b.0", "b.1", "b.2")  # unit by unit
    assert [TABLE.name("sil", "ih", "b", state) for state in range(3)] == ["ih.0<sil", "ih.1", "ih.2>b"]
    assert TABLE.side("sil", 2) == ""  # free units depend on none
    assert TABLE.name("b", "sil", "ih", 2) == "sil.2"


INVENTORY = (SILENCE, "a", "b")


def decoded(hmm, features, inventory=INVENTORY):
    units, bounds = decode(hmm, features, inventory)
    return units, bounds.tolist()


def own_score(hmm, features, units, bounds) -> float:
    """Return the best score of units with the bounds that were recognised."""
    cuts = (
        durations
        for durations in sequences.segmentations(len(features), sum(hmm.table.count(unit) for unit in units))
        if sequences.boundaries(hmm, units, durations) == bounds
    )
    return max(sequences.score(hmm, features, units, durations) for durations in cuts)


@pytest.mark.parametrize(("states", "frames"), [(1, 5), (2, 6), (3, 7), (5, 10)])
@pytest.mark.parametrize(("contexts", "seed"), [(0, 0), (6, 1), (6, 2)])
def test_no_sequence_of_units_is_better(seed, contexts, states, frames):
    """The bigram of every unit counts exactly once, in any context."""
    hmm = random_hmm(seed, states=states, contexts=contexts)
    features = np.random.default_rng([seed, frames]).normal(0, 1.5, (frames, 2)).astype(np.float32)
    candidates = [  # of one state, a unit after itself is the same path as one that lasts longer
        units
        for units in sequences.sequences(INVENTORY, dict.fromkeys(INVENTORY, states), frames)
        if states > 1 or all(unit != following for unit, following in pairwise(units))
    ]
    units, bounds = decoded(hmm, features)
    best = sequences.best(hmm, features, candidates)[2]
    assert own_score(hmm, features, units, bounds) == pytest.approx(best, abs=1e-3)


def test_a_known_sequence_is_recovered():
    who = speaker()
    for number, words in enumerate(sentences(1, 10)):
        features, edges = who.say(np.random.default_rng(number), within_silence(words))
        found, bounds = decoded(known_hmm(who), features, (SILENCE, *UNITS))
        assert found == within_silence(words)
        assert bounds == pytest.approx(edges, abs=1)


def test_short_silence_at_the_start_is_not_priced_out():
    """Silence never follows silence, nor the silence before a recording that begins in silence."""
    who = speaker(spread=2.0)
    hmm = known_hmm(who, list(map(within_silence, sentences(1, 400))), HmmConfig(mixtures=1, bigram_weight=8.0))
    sounds = [who.means[SILENCE][:1], *(who.means[unit] for unit in ("b", "c", SILENCE))]
    features = np.repeat(np.concatenate(sounds), 3, axis=0).astype(np.float32)
    assert decoded(hmm, features, (SILENCE, *UNITS))[0] == (SILENCE, "b", "c", SILENCE)


def test_the_bigram_decides_between_units_that_sound_alike():
    who = speaker()
    who.means["e"] = who.means["d"]
    hmm = known_hmm(who, [(SILENCE, "a", "e", SILENCE)] * 9 + [(SILENCE, "b", "d", SILENCE)] * 9)
    for first, second in (("a", "e"), ("b", "d")):
        features, _ = who.say(np.random.default_rng(2), (SILENCE, first, second, SILENCE))
        assert decoded(hmm, features, (SILENCE, *UNITS))[0] == (SILENCE, first, second, SILENCE)


def test_chains_name_states_in_context_and_fall_back_where_unseen():
    hmm = random_hmm(1, contexts=8)
    chain = expand_states(hmm, ("sil", "a", "b", "sp", "a"))
    names = list(chain.names)
    assert names[3:6] == ["a.0<sil", "a.1", "a.2>b"]
    assert names[6:9] == ["b.0<a", "b.1", "b.2>sil"]  # as a neighbour, a pause is silence
    assert names[10:] == ["a.0<sil", "a.1", "a.2>sil"]  # as beyond the end
    assert chain.positions.tolist() == [0] * 3 + [1] * 3 + [2] * 3 + [3] + [4] * 3
    for name, density, plain in zip(names, chain.densities, chain.plain, strict=True):
        own = name if name in hmm.table.names else name.split("<")[0].split(">")[0]
        assert hmm.table.names[density] == own
        assert hmm.table.names[plain] == name.split("<")[0].split(">")[0]


def test_no_segmentation_is_better():
    for seed, units in enumerate([("a", "b"), ("sil", "b")]):
        hmm = random_hmm(seed, contexts=4)
        features = np.random.default_rng(seed).normal(0, 1.5, (10, 2)).astype(np.float32)
        assert align(hmm, features, units).tolist() == sequences.best(hmm, features, [units])[1]


def test_too_short_a_recording_says_so():
    hmm, units = random_hmm(7), ("sil", "a", "b", "sil")
    with pytest.raises(AlignmentError, match="12 states in 11 frames"):
        align(hmm, np.zeros((11, 2), np.float32), units)
    assert align(hmm, np.zeros((12, 2), np.float32), units).tolist() == [0, 3, 6, 9, 12]


WORDS = ((("a",), ("b", "c")), (("d",),), (("c", "e"), ("b",), ("e", "e")))


def test_the_pronunciation_and_the_pauses_that_were_said_are_chosen():
    for first, last, pauses in ((0, 0, ()), (0, 2, (1,)), (1, 1, (2,)), (1, 2, (1, 2))):
        who = speaker()
        wanted = [(-1, 0, (SILENCE,))]
        for word, variant in enumerate((first, 0, last)):
            wanted += [(-1, 0, (PAUSE,))] * (word in pauses)
            wanted.append((word, variant, WORDS[word][variant]))
        wanted.append((-1, 0, (SILENCE,)))
        features, _ = who.say(np.random.default_rng(first + 2 * last), [unit for part in wanted for unit in part[2]])
        assert choose(known_hmm(who), features, WORDS) == wanted


def test_pronunciations_without_number_are_refused_before_a_network_is_built():
    with pytest.raises(AlignmentError, match=r"\d+ arcs, required at most 1000600"):
        choose(random_hmm(2), np.zeros((60, 2), np.float32), [[("a",)] * 800] * 4)


def test_words_are_placed_within_their_windows():
    """The same word twice in the sound, and once in the transcript: the window says which."""
    who = speaker()
    hmm = known_hmm(who)
    features, edges = who.say(np.random.default_rng(7), (SILENCE, "b", "c", SILENCE, "b", "c", SILENCE))
    log_likelihoods, words = compute_log_likelihoods(hmm, features), [[("b", "c")]]
    for first in (1, 4):
        begin, end = edges[first], edges[first + 2]
        windows = Windows(np.array([begin - 2]), np.array([end + 2]))
        placed = place_words(hmm, log_likelihoods, words, PAUSE, windows)
        assert [item.spoken.units for item in placed] == [(SILENCE,), ("b", "c"), (SILENCE,)]
        assert placed[1].start == pytest.approx(begin, abs=1)
        assert -0.5 < placed[1].fit <= 0
        spoken = [item.spoken for item in placed]
        of_units = spread_windows(spoken, windows, len(features))
        assert of_units.first.tolist() == [0, begin - 2, begin - 2, begin - 2]
        assert of_units.end.tolist() == [end + 2, end + 2, end + 2, len(features)]
        bounds = align_units(hmm, log_likelihoods, [unit for item in spoken for unit in item.units], of_units)
        assert bounds.tolist() == pytest.approx([0, *edges[first : first + 3], len(features)], abs=1)
    between = Windows(np.array([edges[3] - 3]), np.array([edges[4] + 3]))
    assert place_words(hmm, log_likelihoods, words, PAUSE, between)[1].fit < -2
    nowhere = Windows(np.array([edges[3]]), np.array([edges[3] + 3]))
    with pytest.raises(AlignmentError, match="no path"):
        place_words(hmm, log_likelihoods, words, PAUSE, nowhere)
