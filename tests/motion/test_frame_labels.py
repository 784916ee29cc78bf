import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lipmotion.motion import frame_labels
from lipmotion.testing import timeline
from lipmotion.types import ENERGY_FEATURE, Timeline, Unit
from meshes.speech import said

LAYOUT = frame_labels.StateLayout(5, 7, 0.1)
REST = LAYOUT.rest


def states_of(units: Timeline[Unit], phone: str, states: int = 5, edge_s: float = 0.08) -> list[int]:
    labels = frame_labels.label_full_context(units, 200, frame_labels.StateLayout(states, 1, edge_s))
    return [label.state for label in labels if label.unit == phone]


@pytest.mark.parametrize(
    ("end_s", "given", "wanted"),
    [
        (0.6, {}, [0, 0, 1, 1, 2, 2, 3, 3, 4, 4]),
        (0.53, {"states": 3}, [0, 1, 2]),
        (0.53, {"states": 1}, [0, 0, 0]),
        (0.7, {"edge_s": 0.02}, [0, 0, 1, 1, *[2] * 12, 3, 3, 4, 4]),
    ],
)
def test_short_phones_are_cut_into_equal_states_and_only_the_middle_of_long_ones_is_longer(end_s, given, wanted):
    assert states_of(said((0.5, end_s, "aa")), "aa", **given) == wanted


@given(
    start=st.integers(0, 40),
    length=st.integers(1, 60),
    states=st.sampled_from([1, 3, 5, 7]),
    edge=st.integers(1, 9),
    offset_s=st.sampled_from([0.0, -0.005, 0.003]),
)
def test_states_never_go_back_and_are_all_there(start, length, states, edge, offset_s):
    edges = (start / 100 + offset_s, (start + length) / 100 + offset_s)
    found = states_of(said((*edges, "aa")), "aa", states, edge / 100)
    assert all(0 <= state < states for state in found)
    assert (np.diff(found) >= 0).all()
    if length >= states and start:
        assert set(found) == set(range(states))


@given(start=st.integers(1, 40), length=st.integers(1, 60), edge=st.integers(1, 9))
def test_states_mirror_in_time(start, length, edge):
    """Frames lie evenly in a phone that begins half a frame before its first, as alignments do."""
    edges = (start - 0.5) / 100, (start + length - 0.5) / 100
    found = states_of(said((*edges, "aa")), "aa", 5, edge / 100 + 0.0012)
    assert found == [4 - state for state in reversed(found)]


def test_silence_rests_away_from_speech_only():
    units = said((0, 0.595, "sil"), (0.595, 0.695, "aa"), (0.695, 1.5, "sil"))
    states = frame_labels.label_full_context(units, 151, LAYOUT)
    rests = np.array([state == REST for state in states])
    margin = round(LAYOUT.rest_s * 100)
    assert margin == 30
    assert np.flatnonzero(~rests).tolist() == [*range(60 - margin, 70 + margin)]
    assert (states[50].unit, states[50].right) == ("sil", "aa")
    between_words = said((0, 0.1, "aa"), (0.1, 0.6, "sil"), (0.6, 0.7, "aa"))
    assert REST not in frame_labels.label_full_context(between_words, 70, LAYOUT)


def test_frames_belong_to_the_unit_that_has_begun_and_rest_outside_of_all():
    states = frame_labels.label_full_context(said((0.1, 0.2, "aa"), (0.3, 0.4, "t")), 60, LAYOUT)
    assert [states[frame].context for frame in (15, 35)] == [("sil", "aa", "t"), ("aa", "t", "sil")]
    assert [frame for frame in range(60) if states[frame] != REST] == [*range(10, 20), *range(30, 40)]
    states = frame_labels.label_full_context(said((0.0, 0.105, "aa"), (0.105, 0.2, "t")), 20, LAYOUT)
    assert [state.unit for state in states] == ["aa"] * 11 + ["t"] * 9


@given(edges=st.lists(st.integers(0, 400), max_size=12, unique=True), margin=st.integers(0, 40))
def test_it_is_farther_than_the_margin_from_every_interval(edges: list[int], margin: int) -> None:
    edges = sorted(edges)[: len(edges) // 2 * 2]
    speech = list(zip(edges[::2], edges[1::2], strict=True))
    times = np.arange(400, dtype=float) + 0.5
    wanted = np.ones(400, bool)
    for start, end in speech:
        wanted &= (times < start - margin) | (times > end + margin)
    assert frame_labels.is_away_from_speech(times, speech, float(margin)).tolist() == wanted.tolist()


def test_the_mouth_rests_in_digital_silence_of_some_length() -> None:
    features = np.full((200, ENERGY_FEATURE + 1), 3.0)
    for first, stop in ((5, 10), (20, 24), (50, 62), (75, 90)):  # 50 ms, 40 ms, beside speech, in speech
        features[first:stop, ENERGY_FEATURE] = -9.0
    features[30:40, ENERGY_FEATURE] = -8.9  # a breath
    silent = frame_labels.find_digital_silence(features, timeline(("t", "aa", "t")))
    assert np.flatnonzero(silent).tolist() == [*range(5, 10), *range(50, 55)]
