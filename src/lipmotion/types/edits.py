"""Changes of single curves, and of all of the mouth: pins, gains, drawn curves, holds, locks."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from numbers import Real
from typing import ClassVar

from lipmotion.errors import InputError, shorten
from lipmotion.types.audio import FRAME_RATE_HZ

LARGEST_GAIN, MAX_DRAWN = 3.0, 10_000  # largest factor of movements, and largest number of values of a drawn curve


@dataclass(frozen=True)
class Pin:
    """A value that generated motion must take at a time.

    time_s  : seconds; the value is set in the nearest 10 ms frame
    channel : name of a channel that is modelled as it is: ``opening``, ``width``, ``outer``, blendshapes
    value   : in the unit of the channel

    >>> Pin(1.2, "opening", 0.02)
    Pin(time_s=1.2, channel='opening', value=0.02)
    """

    time_s: float
    channel: str
    value: float

    def __post_init__(self) -> None:
        for name, number in (("time", self.time_s), ("value", self.value)):
            try:
                is_number = isinstance(number, Real) and isinstance(float(number), float)
            except OverflowError:
                is_number = False
            if not is_number:
                raise InputError(f"the {name} of a pin is {shorten(repr(number))}, required a number")


@dataclass(frozen=True)
class SlopedPin(Pin):
    """A pin through which the curve goes at a slope, in its unit per second."""

    slope: float

    @property
    def pins(self) -> tuple[Pin, ...]:
        """The values in the frame itself, and in those beside it."""
        steps = (step / FRAME_RATE_HZ for step in (0, -1, 1) if self.time_s + step / FRAME_RATE_HZ >= 0)
        return tuple(Pin(self.time_s + step, self.channel, self.value + step * self.slope) for step in steps)


@dataclass(frozen=True)
class Gain:
    """Movements that are made larger or smaller for a time.

    start_s, end_s : seconds; the factor grows and fades within 0.1 s before and after them
    factor  : 1: as generated; 0: the rest pose
    channel : name of a channel or curve; empty: all movements of the mouth
    Raises InputError: a factor that is not 0 to 3, or an end before the start.

    >>> Gain(1.0, 2.0, 1.3)
    Gain(start_s=1.0, end_s=2.0, factor=1.3, channel='')
    """

    start_s: float
    end_s: float
    factor: float
    channel: str = ""

    def __post_init__(self) -> None:
        if not 0 <= self.factor <= LARGEST_GAIN:
            raise InputError(f"the gain is {self.factor:g}, required 0 to {LARGEST_GAIN:g}")
        if not self.start_s <= self.end_s:
            raise InputError(f"the gain lasts from {self.start_s:g} to {self.end_s:g} s, required a later end")


@dataclass(frozen=True)
class DrawnCurve:
    """Values that a curve takes over a stretch, as somebody has drawn them.

    start_s, end_s : seconds; within 0.1 s before and after, the curve blends into the values
    channel : name of a channel or curve
    values  : at equal distances from the start to the end, in the unit of the channel
    Raises InputError: fewer than 2 values, or more than ``MAX_DRAWN``; no numbers; or an end that is not after the
    start.
    """

    start_s: float
    end_s: float
    channel: str
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        if not 2 <= len(self.values) <= MAX_DRAWN or not all(map(math.isfinite, self.values)):
            raise InputError(f"{len(self.values)} values are drawn, required 2 to {MAX_DRAWN} finite numbers")
        _check_stretch(self.start_s, self.end_s)


@dataclass(frozen=True)
class Hold:
    """The whole mouth stays for a time as at the start; it blends into that within 0.05 s.

    start_s, end_s : seconds
    Raises InputError: an end that is not after the start.
    """

    start_s: float
    end_s: float
    channel: ClassVar[str] = ""

    def __post_init__(self) -> None:
        _check_stretch(self.start_s, self.end_s)


@dataclass(frozen=True)
class Locked:
    """Curves stay for a time as these edits alone make them, whatever other edits there are."""

    start_s: float
    end_s: float
    edits: tuple[CurveEdit, ...]
    channel: ClassVar[str] = ""


CurveEdit = Pin | Gain | DrawnCurve | Hold | Locked  # changes of one curve, or of all curves of the mouth


def _check_stretch(start_s: float, end_s: float) -> None:
    if not start_s < end_s:
        raise InputError(f"from {start_s:g} to {end_s:g} s, required an end after the start")


@dataclass(frozen=True)
class Constraints:
    """Values that generated motion must take exactly.

    Raises InputError: something else than pins, or a time or a value that is no number.

    >>> import lipmotion
    >>> closed = lipmotion.Constraints((lipmotion.Pin(0.5, "opening", 0.02),))
    >>> result = lipmotion.animate("examples/welcome.flac", constraints=closed)
    >>> round(float(result.motion["opening"][50]), 6)
    0.02
    """

    pins: tuple[Pin, ...] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.pins, Collection) or not all(isinstance(pin, Pin) for pin in self.pins):
            found = shorten(repr(self.pins))
            raise InputError(f"constraints of {found}, required pins: Constraints((Pin(0.5, 'opening', 0.02),))")
