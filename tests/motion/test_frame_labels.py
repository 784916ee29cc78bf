import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from lipmotion.motion.frame_labels import StateLayout, label_full_context, with_neighbours
from lipmotion.types import Span, Timeline, Unit

LAYOUT = StateLayout(5, 7, 0.1)
REST = LAYOUT.rest


def spans(*labels: tuple[float, float, str]) -> Timeline[Unit]:
    return Timeline(tuple(Span(start_s, end_s, Unit(phone)) for start_s, end_s, phone in labels))


def states_of(units: Timeline[Unit], phone: str, states: int = 5, edge_s: float = 0.08) -> list[int]:
    return [
        label.state for label in label_full_context(units, 200, StateLayout(states, 1, edge_s)) if label.unit == phone
    ]


def test_beyond_the_ends_lies_silence():
    units = spans((0, 0.1, "p"), (0.1, 0.2, "aa"))
    assert [(left, span.label.phone, right) for left, span, right in with_neighbours(units)] == [
        ("sil", "p", "aa"),
        ("p", "aa", "sil"),
    ]


def test_a_short_phone_is_cut_into_equal_states():
    assert states_of(spans((0.5, 0.6, "aa")), "aa") == [0, 0, 1, 1, 2, 2, 3, 3, 4, 4]
    assert states_of(spans((0.5, 0.53, "aa")), "aa", states=3) == [0, 1, 2]
    assert states_of(spans((0.5, 0.53, "aa")), "aa", states=1) == [0, 0, 0]


def test_only_the_middle_of_a_long_phone_gets_longer():
    assert states_of(spans((0.5, 0.7, "aa")), "aa", edge_s=0.02) == [0, 0, 1, 1, *[2] * 12, 3, 3, 4, 4]


@given(
    start=st.integers(0, 40),
    length=st.integers(1, 60),
    states=st.sampled_from([1, 3, 5, 7]),
    edge=st.integers(1, 9),
    offset_s=st.sampled_from([0.0, -0.005, 0.003]),
)
def test_states_never_go_back_and_are_all_there(start, length, states, edge, offset_s):
    edges = (start / 100 + offset_s, (start + length) / 100 + offset_s)
    found = states_of(spans((*edges, "aa")), "aa", states, edge / 100)
    assert all(0 <= state < states for state in found)
    assert (np.diff(found) >= 0).all()
    if length >= states and start:
        assert set(found) == set(range(states))


@given(start=st.integers(1, 40), length=st.integers(1, 60), edge=st.integers(1, 9))
def test_states_mirror_in_time(start, length, edge):
    """Frames lie evenly in a phone that begins half a frame before its first, as alignments do."""
    edges = (start - 0.5) / 100, (start + length - 0.5) / 100
    found = states_of(spans((*edges, "aa")), "aa", 5, edge / 100 + 0.0012)
    assert found == [4 - state for state in reversed(found)]


def test_silence_rests_away_from_speech_only():
    states = label_full_context(spans((0, 0.595, "sil"), (0.595, 0.695, "aa"), (0.695, 1.5, "sil")), 151, LAYOUT)
    rests = np.array([state == REST for state in states])
    margin = round(LAYOUT.rest_s * 100)
    assert margin == 30
    assert rests[: 60 - margin].all()
    assert not rests[60 - margin : 70 + margin].any()
    assert rests[70 + margin :].all()
    assert (states[50].unit, states[50].right) == ("sil", "aa")


def test_short_silence_between_words_never_rests():
    units = spans((0, 0.1, "aa"), (0.1, 0.6, "sil"), (0.6, 0.7, "aa"))
    assert REST not in label_full_context(units, 70, LAYOUT)


def test_frames_outside_all_units_rest():
    states = label_full_context(spans((0.1, 0.2, "aa"), (0.3, 0.4, "t")), 60, LAYOUT)
    assert [frame for frame in range(60) if states[frame] != REST] == [*range(10, 20), *range(30, 40)]


def test_frames_belong_to_the_unit_that_has_begun():
    states = label_full_context(spans((0.0, 0.105, "aa"), (0.105, 0.2, "t")), 20, LAYOUT)
    assert [state.unit for state in states] == ["aa"] * 11 + ["t"] * 9
