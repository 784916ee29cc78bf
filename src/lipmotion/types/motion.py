"""Motion: named curves over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, shorten, shorten_list
from lipmotion.printable import is_formula
from lipmotion.types.values import suggest

EYE_DISTANCE = "eye_distance"  # the unit of all tracked lengths: the distance between the outer eye corners
WEIGHT = "weight"  # the unit of blendshapes: 0 is no effect, 1 the full effect; never negative
RADIAN = "radian"  # the unit of angles
GREY = "grey"  # the unit of eigenlips: coefficients of an orthonormal basis of mouth pictures in grey levels, 0 to 255
LARGEST_MAGNITUDE = {EYE_DISTANCE: 1e4, WEIGHT: 255.0, GREY: 1e5}
"""Largest plausible magnitude of motion of a face, by unit; values in pixels, in files without units, are allowed."""
LARGEST_OTHER = 1e6  # the same for all other units


@dataclass(frozen=True)
class Channel:
    """Name and unit of one curve. Raises InputError: a spreadsheet would execute the name as a formula."""

    name: str
    unit: str = EYE_DISTANCE

    def __post_init__(self) -> None:
        if is_formula(self.name):
            raise InputError(
                f"the channel name {shorten(self.name)!r} begins as a spreadsheet's formula, required another "
                "beginning than = + - @; rename it"
            )


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion: P curves in T frames; frame n is at ``n / rate_hz`` seconds.

    values   : float array [shape=(T, P)], each column in the unit of its channel; single precision in long recordings
    rate_hz  : frames per second
    channels : name and unit of each of the P curves
    Raises InputError: shapes that do not fit, two channels of one name, or a rate that is not positive.

    >>> import numpy as np
    >>> motion = Motion(np.array([[0.0], [0.1], [0.2]]), 25.0, (Channel("opening"),))
    >>> motion["opening"].tolist(), motion.time_s.tolist()
    ([0.0, 0.1, 0.2], [0.0, 0.04, 0.08])
    >>> motion.resampled(50.0).values[:, 0].tolist()
    [0.0, 0.05, 0.1, 0.15000000000000002, 0.2]
    """

    values: NDArray[np.floating[Any]]
    rate_hz: float
    channels: tuple[Channel, ...]

    def __post_init__(self) -> None:
        if np.ma.is_masked(self.values) or self.values.ndim != 2 or self.values.shape[1] != len(self.channels):
            raise InputError(f"motion values of shape {self.values.shape}, required unmasked (T, {len(self.channels)})")
        if not 0 < self.rate_hz < float("inf"):
            raise InputError(f"motion rate is {self.rate_hz} Hz, required more than 0 and finite")
        if len(set(self.names)) != len(self.channels):
            raise InputError(f"motion channel names repeat: {', '.join(self.names)}")

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The names of the channels, in order."""
        return tuple(channel.name for channel in self.channels)

    @property
    def time_s(self) -> NDArray[np.float64]:
        """The time of every frame, in seconds [shape=(T,)]."""
        return np.arange(len(self.values)) / self.rate_hz

    def __getitem__(self, name: str) -> NDArray[np.floating[Any]]:
        """Return the curve of one channel [shape=(T,)]. Raises InputError: no such channel."""
        return self.values[:, self.column(name)]

    def column(self, name: str) -> int:
        """Return the column of a channel in ``values``. Raises InputError: no such channel."""
        if name not in self.names:
            known = f"{len(self.names)}: {shorten_list(self.names, 6)}"
            raise InputError(f"no motion channel {shorten(repr(name))}{suggest(name, self.names)} among {known}")
        return self.names.index(name)

    def selected(self, names: Sequence[str]) -> Motion:
        """Return the motion of some channels, in the given order. Raises InputError: no such channel."""
        columns = [self.column(name) for name in names]
        if columns == [*range(len(self.names))]:
            return self
        return Motion(self.values[:, columns], self.rate_hz, tuple(self.channels[column] for column in columns))

    def at(self, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values at some times in seconds, linear between frames, constant beyond [shape=(N, P)]."""
        return interpolate_rows(self.values, self.rate_hz, time_s)

    def resampled(self, rate_hz: float) -> Motion:
        """Return the motion at another rate, by linear interpolation. Raises InputError: the rate is not positive."""
        return Motion(self.at(compute_frame_times(len(self.values), self.rate_hz, rate_hz)), rate_hz, self.channels)


def compute_frame_times(frames: int, rate_hz: float, fps: float) -> NDArray[np.float64]:
    """Return when pictures of so many frames are shown, ``fps`` a second, to the last one, in seconds [shape=(N,)].

    Raises InputError: a rate that is not positive.
    """
    if not 0 < fps < float("inf"):
        raise InputError(f"the frame rate is {fps} Hz, required more than 0 and finite")
    return np.arange(int(np.floor((frames - 1) / rate_hz * fps + 1e-9)) + 1) / fps


def interpolate_rows(
    rows: NDArray[np.floating[Any]], rate_hz: float, time_s: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return rows [shape=(T, P)] at some times, linear between frames, constant beyond both ends [shape=(N, P)]."""
    position = np.clip(np.asarray(time_s) * rate_hz, 0, len(rows) - 1)
    low = np.minimum(position.astype(int), max(len(rows) - 2, 0))
    high = np.minimum(low + 1, len(rows) - 1)
    fraction = (position - low)[:, None]
    return (1 - fraction) * rows[low] + fraction * rows[high]


def check_curves(motion: Motion) -> None:
    """Raise InputError if a curve has values that are not finite, or larger than plausible motion of a face."""
    if len(motion.values):
        smallest, largest = motion.values.min(axis=0).tolist(), motion.values.max(axis=0).tolist()
        for channel, low, high in zip(motion.channels, smallest, largest, strict=True):
            check_magnitude(channel, low, high)


def check_magnitude(channel: Channel, low: float, high: float) -> None:
    """Raise InputError if values of a channel from ``low`` to ``high`` are larger than plausible motion of a face."""
    largest = LARGEST_MAGNITUDE.get(channel.unit, LARGEST_OTHER)
    if not -largest <= low <= high <= largest:
        raise InputError(
            f"{channel.name!r} goes from {low:g} to {high:g} {channel.unit}, required within ±{largest:g}; "
            "write its unit into a .json, or scale it"
        )
