import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.errors import InputError
from lipmotion.hmm.multistream.unit_states import RecognisedUnit, frames_to_units, units_to_frames
from lipmotion.types import Span, Timeline, Unit


def timeline(*spans):
    return Timeline(tuple(Span(start, end, Unit(phone)) for start, end, phone in spans))


def test_every_frame_has_a_unit():
    spoken = timeline((0.015, 0.05, "a"), (0.05, 0.054, "t"), (0.07, 0.1, "b"))
    units, bounds = units_to_frames(spoken, 13, "sil")
    assert units == ("sil", "a", "t", "sil", "b", "sil")
    assert bounds.tolist() == [0, 2, 5, 6, 7, 10, 13]
    assert units_to_frames(spoken, 4, "sil", lambda label: {"a": "open"}[label.phone])[0] == ("sil", "open")
    assert units_to_frames(timeline(), 3, "sil")[0] == ("sil",)
    with pytest.raises(InputError):
        units_to_frames(spoken, 0, "sil")


def test_a_unit_without_a_frame_is_left_out():
    units, bounds = units_to_frames(timeline((0, 0.031, "a"), (0.031, 0.038, "t"), (0.038, 0.06, "b")), 6, "sil")
    assert units == ("a", "b")
    assert bounds.tolist() == [0, 4, 6]


def test_a_unit_begins_half_a_frame_before_its_first_frame():
    spoken = frames_to_units([RecognisedUnit("sil", 0), RecognisedUnit("a", 3), RecognisedUnit("sil", 9)], 0.125)
    assert [span.start_s for span in spoken] == pytest.approx([0, 0.025, 0.085])
    assert [span.end_s for span in spoken] == pytest.approx([0.025, 0.085, 0.125])


@settings(max_examples=30)
@given(lengths=st.lists(st.integers(1, 9), min_size=1, max_size=9))
def test_there_and_back(lengths):
    firsts = np.cumsum([0, *lengths]).tolist()
    said = [RecognisedUnit("ab"[i % 2], first) for i, first in enumerate(firsts[:-1])]
    spoken = frames_to_units(said, firsts[-1] / 100)
    assert spoken[-1].end_s == firsts[-1] / 100
    units, bounds = units_to_frames(spoken, firsts[-1], "sil")
    assert [RecognisedUnit(unit, first) for unit, first in zip(units, bounds[:-1].tolist(), strict=True)] == said
