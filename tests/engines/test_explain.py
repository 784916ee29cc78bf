"""What the trace of a generation says about one frame."""

from __future__ import annotations

import numpy as np

from lipmotion.engines.base import explain_by_trace
from lipmotion.types import Channel, Generation, Motion, Span, StateTrace, Timeline, Unit


def test_a_frame_is_explained_by_its_own_span_state_and_values() -> None:
    units = Timeline((Span(0.0, 0.02, Unit("p")), Span(0.02, 0.04, Unit("aa"))))
    motion = Motion(np.arange(10.0).reshape(5, 2), 100.0, (Channel("opening"), Channel("width")))
    variance = np.square(np.arange(10.0, 20.0).reshape(5, 2))
    result = Generation(motion, variance, units, StateTrace(("one", "two"), np.array([0, 0, 1, 1, 1])))
    found = [explain_by_trace(result, frame) for frame in range(5)]
    assert [one.span.label.phone if one.span else None for one in found] == ["p", "p", "aa", "aa", None]
    assert [one.state for one in found] == ["one", "one", "two", "two", "two"]
    assert (found[3].motion["width"].value, found[3].motion["width"].deviation) == (7, 17)
    assert [one.time_s for one in found] == [0, 0.01, 0.02, 0.03, 0.04]
