from lipmotion.hmm.states import make_plain_states

TABLE = make_plain_states(("sil", "sp", "b", "ih"), (3, 1, 3, 3), free=("sil", "sp")).extended(("b.0<ih", "b.2>sil"))


def test_names_without_context_come_first_unit_by_unit():
    assert TABLE.names[:7] == ("sil.0", "sil.1", "sil.2", "sp.0", "b.0", "b.1", "b.2")


def test_states_depend_on_the_nearer_neighbour():
    for count, sides in ((1, [""]), (2, ["<", ">"]), (3, ["<", "", ">"]), (4, list("<<>>"))):
        table = make_plain_states(("u",), (count,), free=())
        assert [table.side("u", state) for state in range(count)] == sides


def test_free_units_depend_on_none():
    assert TABLE.side("sil", 2) == ""
    assert TABLE.neighbour("b", "sil", "ih", 2) is None
    assert TABLE.name("b", "sil", "ih", 2) == "sil.2"


def test_seen_contexts_have_densities_of_their_own():
    assert TABLE.names[TABLE.density("b", 0, "ih")] == "b.0<ih"
    assert TABLE.names[TABLE.density("b", 2, "sil")] == "b.2>sil"


def test_unseen_contexts_resolve_to_the_plain_state():
    for state, neighbour in ((0, "sil"), (2, "ih"), (1, "ih"), (0, None), (0, "unknown")):
        assert TABLE.names[TABLE.density("b", state, neighbour)] == f"b.{state}"


def test_full_names_say_the_neighbour_that_counts():
    assert [TABLE.name("sil", "ih", "b", state) for state in range(3)] == ["ih.0<sil", "ih.1", "ih.2>b"]
    assert [TABLE.neighbour("sil", "ih", "b", state) for state in range(3)] == ["sil", None, "b"]
