"""Movement as named curves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any
from unicodedata import normalize

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, shortened

EYE_DISTANCE = "eye_distance"
"""The unit of all tracked distances: that between the outer eye corners."""
WEIGHT = "weight"
"""The unit of blendshapes: 0 is absent, 1 is whole; never less than 0."""
GREY = "grey"
"""The unit of eigenlips: coefficients of an orthonormal basis of pictures in grey levels, 0 to 255."""
LARGEST = {EYE_DISTANCE: 1e4, WEIGHT: 255.0, GREY: 1e5}
"""Values beyond these are of nothing that moves in a face, even where a table without units holds pixels."""
LARGEST_OTHER = 1e6


FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""A spreadsheet runs a field as a formula that begins with one of these, wide forms of them included."""


@dataclass(frozen=True)
class Channel:
    """One curve: its name and the unit of its values.

    Raises InputError: the name is what a spreadsheet takes for a formula.
    """

    name: str
    unit: str = EYE_DISTANCE

    def __post_init__(self) -> None:
        if self.name.startswith(FORMULA) or normalize("NFKC", self.name.lstrip()[:1]).startswith(FORMULA):
            raise InputError(
                f"the channel name {shortened(self.name)!r} begins as a spreadsheet's formula, required another "
                "beginning than = + - @; rename it"
            )


@dataclass(frozen=True, eq=False)
class Motion:
    """Movement, one row a frame, frame n at ``n / rate_hz`` seconds.

    values   : float array [shape=(T, P)], in single precision where it is long
    rate_hz  : frames per second
    channels : the P curves
    Raises InputError: the shapes do not fit, two channels share a name, or the rate is not positive.
    """

    values: NDArray[np.floating[Any]]
    rate_hz: float
    channels: tuple[Channel, ...]

    def __post_init__(self) -> None:
        if self.values.ndim != 2 or self.values.shape[1] != len(self.channels):
            raise InputError(f"motion values have shape {self.values.shape}, required (T, {len(self.channels)})")
        if not 0 < self.rate_hz < float("inf"):
            raise InputError(f"motion rate is {self.rate_hz} Hz, required more than 0 and finite")
        if len(set(self.names)) != len(self.channels):
            raise InputError(f"motion channel names repeat: {', '.join(self.names)}")

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the channels, in order."""
        return tuple(channel.name for channel in self.channels)

    @property
    def time_s(self) -> NDArray[np.float64]:
        """The time of every frame, in seconds [shape=(T,)]."""
        return np.arange(len(self.values)) / self.rate_hz

    def __getitem__(self, name: str) -> NDArray[np.floating[Any]]:
        """Return one channel's curve [shape=(T,)]. Raises InputError: no such channel."""
        curve: NDArray[np.floating[Any]] = self.values[:, self.column(name)]
        return curve

    def column(self, name: str) -> int:
        """Return which column of ``values`` a channel is. Raises InputError: no such channel."""
        if name not in self.names:
            some = ", ".join(self.names[:6]) + (", ..." if len(self.names) > 6 else "")
            raise InputError(f"no motion channel {name!r} among {len(self.names)}: {some}")
        return self.names.index(name)

    def at(self, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values at other times [shape=(len(time_s), P)].

        Linear between frames, as every figure is computed (docs: measures); constant beyond both ends.
        """
        return between_frames(self.values, self.rate_hz, time_s)

    def resampled(self, rate_hz: float) -> Motion:
        """Return the same curves at another rate, over the same duration (linear between frames).

        Raises InputError: the rate is not more than 0.
        """
        if not 0 < rate_hz < float("inf"):
            raise InputError(f"motion rate is {rate_hz} Hz, required more than 0")
        count = int(np.floor((len(self.values) - 1) / self.rate_hz * rate_hz + 1e-9)) + 1
        return Motion(self.at(np.arange(count) / rate_hz), rate_hz, self.channels)


def between_frames(rows: NDArray[np.floating[Any]], rate_hz: float, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return rows [shape=(T, N)], one a frame, at other times, as ``Motion.at`` does [shape=(len(time_s), N)]."""
    position = np.clip(np.asarray(time_s) * rate_hz, 0, len(rows) - 1)
    low = np.minimum(position.astype(int), max(len(rows) - 2, 0))
    high = np.minimum(low + 1, len(rows) - 1)
    share = (position - low)[:, None]
    values: NDArray[np.float64] = (1 - share) * rows[low] + share * rows[high]
    return values


def check_curves(motion: Motion) -> None:
    """Raise InputError where a curve is not finite, or larger than anything in a face."""
    if len(motion.values):
        ends = zip(motion.channels, motion.values.min(axis=0).tolist(), motion.values.max(axis=0).tolist(), strict=True)
        for channel, low, high in ends:
            check_magnitude(channel, low, high)


def check_magnitude(channel: Channel, low: float, high: float) -> None:
    """Raise InputError where a curve from ``low`` to ``high`` is none of a face."""
    largest = LARGEST.get(channel.unit, LARGEST_OTHER)
    if not -largest <= low <= high <= largest:
        raise InputError(
            f"{channel.name!r} goes from {low:g} to {high:g} {channel.unit}, required within ±{largest:g}; "
            "say its unit in a .json, or scale it"
        )
