import numpy as np
import pytest

from hmm.synthetic import align, random_hmm
from lipmotion.errors import ModelFormatError
from lipmotion.hmm.model import hmm_from_arrays, hmm_to_arrays, make_plain_states

TABLE = make_plain_states(("sil", "sp", "b", "ih"), (3, 1, 3, 3), free=("sil", "sp")).extend(("b.0<ih", "b.2>sil"))


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
    assert [TABLE.neighbour("sil", "ih", "b", state) for state in range(3)] == ["sil", None, "b"]
    assert TABLE.side("sil", 2) == ""  # free units depend on none
    assert TABLE.neighbour("b", "sil", "ih", 2) is None
    assert TABLE.name("b", "sil", "ih", 2) == "sil.2"


def test_only_seen_contexts_have_densities_of_their_own():
    assert TABLE.names[TABLE.density("b", 0, "ih")] == "b.0<ih"
    assert TABLE.names[TABLE.density("b", 2, "sil")] == "b.2>sil"
    for state, neighbour in ((0, "sil"), (2, "ih"), (1, "ih"), (0, None), (0, "unknown")):
        assert TABLE.names[TABLE.density("b", state, neighbour)] == f"b.{state}"
