from itertools import accumulate, pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.errors import InputError
from lipmotion.types import Span, Timeline, Unit

NAN = float("nan")


def timeline(*edges_s: tuple[float, float]) -> Timeline[str]:
    return Timeline(tuple(Span(start_s, end_s, f"at {start_s}") for start_s, end_s in edges_s))


def test_rounding_is_not_an_overlap() -> None:
    assert len(timeline((0, 0.1 + 0.2), (0.3, 1))) == 2


def test_it_says_which_span_is_wrong() -> None:
    for edges_s, message in (
        ([(1, 0.5)], r"'at 1' ends at 0.5 s, before its start at 1 s"),
        ([(0, 1), (0.9, 2)], r"'at 0.9' starts at 0.9 s, before the previous span ends \(1 s\)"),
        ([(1, 2), (0, 0.5)], r"'at 0' starts at 0 s"),
        ([(NAN, 1)], "ends at 1 s"),
        ([(0, NAN)], "ends at nan s"),
    ):
        with pytest.raises(InputError, match=message):
            timeline(*edges_s)


@settings(max_examples=50)
@given(st.lists(st.floats(0, 5), min_size=2, max_size=8), st.floats(0, 1000))
def test_shifting_moves_every_time_and_nothing_else(steps_s: list[float], offset_s: float) -> None:
    spans = timeline(*pairwise(accumulate(steps_s)))
    moved = spans.shifted(offset_s)
    assert [span.label for span in moved] == [span.label for span in spans]
    assert [span.start_s for span in moved] == [span.start_s + offset_s for span in spans]
    assert [span.end_s for span in moved] == [span.end_s + offset_s for span in spans]


def test_a_phone_is_named_as_users_know_it() -> None:
    spans = (Span(0.0, 0.5, Unit("d", "sil-d+m")), Span(0.4, 0.6, Unit("m", "d-m+ih", "midnight")))
    with pytest.raises(InputError, match=r"^the phone 'm' starts at 0.4 s, before the previous span ends \(0.5 s\)"):
        Timeline(spans)
    with pytest.raises(InputError, match=r"^the unit 'bilabial' ends at 0\.5 s"):
        Timeline((Span(1.0, 0.5, Unit("", "bilabial")),))
