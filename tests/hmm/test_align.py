import numpy as np
import pytest

from hmm.synthetic import PAUSE, SILENCE, align, choose, known_hmm, random_hmm, speaker
from lipmotion.errors import AlignmentError
from lipmotion.hmm.align import align_units, expand_states, place_words, spread_windows
from lipmotion.hmm.network import compute_log_likelihoods
from lipmotion.kernels.paths import Windows
from oracles import sequences


def test_chains_name_states_in_context_and_fall_back_where_unseen():
    hmm = random_hmm(1, contexts=8)
    chain = expand_states(hmm, ("sil", "a", "b", "sp", "a"))
    names = [name for name, _ in chain.names]
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


def test_a_pause_inside_of_a_pronunciation_may_be_left_out():
    who = speaker()
    for said in (("a", "b"), ("a", PAUSE, "b"), ("c", PAUSE, "d"), ("c", "d")):
        features, _ = who.say(np.random.default_rng(3), (SILENCE, *said, SILENCE))
        found = choose(known_hmm(who), features, [[("a", PAUSE, "b"), ("c", PAUSE, "d")]])
        assert [item.units for item in found] == [(SILENCE,), said, (SILENCE,)]
        assert found[1][:2] == (0, int(said[0] == "c"))


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
