from typing import Any

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.types import (
    Channel,
    Constraints,
    Generation,
    Motion,
    Pin,
    ReducedVariance,
    Span,
    StateTrace,
    Timeline,
    Unit,
)


def generation(frames: int = 101) -> Generation:
    """A second of a line, its variance the square of the frame's number, ten states."""
    line = np.arange(frames, dtype=float)[:, None]
    units = Timeline((Span(0.0, 1.0, Unit("aa")),))
    states = tuple(f"state {number}" for number in range(10))
    trace = StateTrace(states, np.minimum(np.arange(frames) // 10, 9))
    return Generation(Motion(line, 100.0, (Channel("opening"),)), line**2, units, trace)


def test_all_parts_come_at_the_new_rate() -> None:
    result = generation().resampled(25.0)
    assert result.motion.rate_hz == 25.0
    assert result.motion["opening"] == pytest.approx(np.arange(0, 101, 4))
    assert result.variance == pytest.approx(np.arange(0, 101, 4)[:, None] ** 2)
    assert result.units == generation().units
    assert result.trace.states == generation().trace.states
    assert result.trace.frames.tolist() == [min(frame // 10, 9) for frame in range(0, 101, 4)]


def test_the_state_is_that_of_the_nearest_frame() -> None:
    for rate_hz in (24.0, 29.97, 60.0, 100.0, 441.0):
        before, after = generation(), generation().resampled(rate_hz)
        assert len(after.trace.frames) == len(after.variance) == len(after.motion.values)
        for time_s, state in zip(after.motion.time_s, after.trace.frames, strict=True):
            nearest = np.abs(before.motion.time_s - time_s)
            assert state in before.trace.frames[nearest <= nearest.min() + 1e-9]


def test_channels_are_selected_in_order() -> None:
    before = generation()
    names = before.motion.names[::-1][:2]
    after = before.selected(names)
    assert after.motion.names == names
    for name in names:
        assert np.array_equal(after.motion[name], before.motion[name])
    assert after.variance.shape == after.motion.values.shape
    with pytest.raises(InputError, match="no motion channel 'smile'"):
        before.selected(["smile"])


def test_variance_that_follows_from_few_dimensions_is_kept_as_such() -> None:
    reduced, mixing = np.arange(202.0).reshape(101, 2), np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 2.0]])
    channels = tuple(map(Channel, ("opening", "width", "outer")))
    plain = generation()
    motion = Motion(np.zeros((101, 3)), 100.0, channels)
    small = Generation(motion, ReducedVariance(reduced, mixing), plain.units, plain.trace)
    large = Generation(motion, reduced @ mixing, plain.units, plain.trace)
    for change in (lambda g: g, lambda g: g.selected(["outer", "width"]), lambda g: g.resampled(29.97)):
        assert isinstance(change(small).spread, ReducedVariance)
        assert change(small).variance == pytest.approx(change(large).variance)
    assert small.variance_of(slice(3, 5)) == pytest.approx(large.variance[3:5])


def test_pins_and_times_are_numbers() -> None:
    wrong: Any
    for wrong in ("soon", None, [0.1], 1j, np.array([0.5]), 10**400):
        with pytest.raises(InputError, match=r"the time of a pin is .*, required a number"):
            Pin(wrong, "opening", 0.1)
        with pytest.raises(InputError, match=r"the value of a pin is .*, required a number"):
            Pin(0.5, "opening", wrong)
    for wrong in ("soon", None, [0.1], 1j, 10**400):
        with pytest.raises(InputError, match=r"the phone 'p' lasts from .* to .*, required seconds"):
            Timeline((Span(wrong, wrong, Unit("p")),))
    pin = Pin(0.5, "opening", 0.1)
    pins: Any
    for pins in (7, None, pin, "pins", [(0.5, "opening", 0.1)], [pin, None], iter([pin])):
        with pytest.raises(InputError, match="required pins"):
            Constraints(pins)
