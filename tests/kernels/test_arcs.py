import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from kernels.networks import phone_loop, random_network
from lipmotion.kernels.arcs import arc_layout


def arcs_in(layout):
    """Return every arc of a layout as (arc, source, target), with the states' own numbers."""
    order = layout.order
    for target, source, length, first in layout.runs:
        for i in range(length):
            yield layout.run_arcs[first + i], order[source + i], order[target + i]
    for target, targets, first, sources in layout.blocks:
        for s in range(first, first + sources):
            for t in range(targets):
                yield layout.block_arcs[s, t], order[layout.block_sources[s]], order[target + t]


def all_are_there(arrays) -> None:
    layout = arc_layout(arrays["arc_from"], arrays["arc_start"])
    counts = np.diff(arrays["arc_start"], append=len(arrays["arc_from"]))
    targets = np.repeat(np.arange(len(counts)), counts)
    assert sorted(arcs_in(layout)) == list(zip(range(len(targets)), arrays["arc_from"], targets, strict=True))
    assert np.array_equal(layout.place[layout.order], np.arange(len(counts)))


@given(seed=st.integers(0, 2**32 - 1), states=st.integers(1, 30), dense=st.sampled_from([0.05, 0.5, 1.0]))
@settings(max_examples=30)
def test_every_arc_has_its_place(seed, states, dense):
    all_are_there(random_network(seed, states, 3, dense)[0])


def test_every_arc_of_a_loop_has_its_place():
    for units, states in ((11, 3), (9, 1), (4, 2)):
        all_are_there(phone_loop(1, units, states)[0])


def test_a_loop_of_phones_is_one_block_and_few_runs():
    arrays, _ = phone_loop(1, units=21, states=5)
    layout = arc_layout(arrays["arc_from"], arrays["arc_start"])
    assert [tuple(block[[1, 3]]) for block in layout.blocks] == [(20, 21)]
    assert len(layout.runs) == 5
