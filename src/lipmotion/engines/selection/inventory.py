"""The inventory: every recorded phone in its window, with the motion that was recorded, and an index of the windows."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.selection.windows import SYMBOLS, PhoneWindows
from lipmotion.types import FRAME_RATE_HZ
from lipmotion.units import PHONES, find_similar_lips

SOURCE = re.compile(r" \d+\.\d+-\d+\.\d+ s \S+$")
"""The end of what ``find_source`` returns."""


def find_source(inventory: RecordedUnits, unit: int) -> str:
    """Return the recording of a unit, and its time and phone there: ``bbaf2n 0.530-0.610 s b``."""
    windows = inventory.windows
    start_s, end_s = windows.times_s[unit].tolist()
    return f"{inventory.names[windows.recording[unit]]} {start_s:.3f}-{end_s:.3f} s {PHONES[windows.phones[unit]]}"


Array = NDArray[np.float64]
UnitNumbers = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class RecordedUnits:
    """Recorded phones, called units, and their motion.

    windows   : the units, recording by recording; times are seconds in their recording
    usable    : whether the motion of each unit was measured throughout [shape=(U,)]
    first     : the row of ``values`` at which each recording begins; the last number is that of all rows [shape=(R+1,)]
    kept      : the first row and the one after the last of each range whose motion is stored, in order [shape=(K, 2)]
    motion    : there, in the motion space, 100 rows a second; stored in half precision [shape=(N, Q)]
    predicted : what the guide predicts at ``POINTS`` of each unit, reduced [shape=(U, POINTS, D)]; None: no guide
    """

    names: tuple[str, ...]
    windows: PhoneWindows
    usable: NDArray[np.bool_]
    first: NDArray[np.intp]
    kept: NDArray[np.intp]
    motion: NDArray[np.floating[Any]]
    predicted: NDArray[np.float16] | None

    @cached_property
    def values(self) -> Array:
        """The motion of all recordings [shape=(F, Q)]; silence that is not stored is a line."""
        stored = np.concatenate([np.arange(first, stop) for first, stop in self.kept.tolist()])
        rows, frames = self.motion.astype(float), np.arange(self.first[-1])
        if len(rows) == len(frames):
            return rows
        edges = [self.first[:-1], self.first[1:] - 1]
        after = np.minimum(np.searchsorted(stored, edges[0]), len(stored) - 1)
        before = np.maximum(np.searchsorted(stored, edges[1], side="right") - 1, 0)
        knots = np.concatenate([stored, *edges])
        values = np.concatenate([rows, rows[after], rows[before]])
        knots, order = np.unique(knots, return_index=True)
        return np.stack([np.interp(frames, knots, column) for column in values[order].T], axis=1)

    def without(self, phones: Collection[str]) -> RecordedUnits:
        """Return the units of other phones; all units, if none of those is usable."""
        windows, kept = self.windows.without(phones)
        if not self.usable[kept].any():
            return self
        predicted = self.predicted[kept] if self.predicted is not None else None
        return replace(self, windows=windows, usable=self.usable[kept], predicted=predicted)

    def poses(self, units: UnitNumbers, fraction: float) -> Array:
        """Return the motion of some units at a fraction of their duration, 0 to 1 [shape=(N, Q)]."""
        start_s, end_s = self.windows.times_s[units].T
        return self.at(self.windows.recording[units], start_s + fraction * (end_s - start_s))

    def velocities(self, units: UnitNumbers, fraction: float) -> Array:
        """Return the change of the motion per second, at a fraction of the duration of some units [shape=(N, Q)]."""
        start_s, end_s = self.windows.times_s[units].T
        time_s, recording = start_s + fraction * (end_s - start_s), self.windows.recording[units]
        step_s = 1 / FRAME_RATE_HZ
        return (self.at(recording, time_s + step_s) - self.at(recording, time_s - step_s)) / (2 * step_s)

    def at(self, recording: NDArray[np.integer], time_s: Array) -> Array:
        """Return the motion of recordings at times, interpolated; held beyond their ends [shape=(N, Q)]."""
        first, last = self.first[recording], self.first[recording + 1] - 1
        position = np.clip(first + time_s * FRAME_RATE_HZ, first, last)
        before = np.minimum(position.astype(np.intp), np.maximum(last - 1, first))
        after = np.minimum(before + 1, last)
        share = (position - before)[:, None]
        return self.values[before] * (1 - share) + self.values[after] * share


@dataclass(frozen=True, eq=False)
class UnitIndex:
    """An index of the windows of an inventory: three orders, of left, right and no bias.

    contexts : symbols of the window of every unit [shape=(U, N)]
    orders   : for each bias, the usable units in the order of their keys
    keys     : for each bias, the keys in this order
    The digits of a key are the symbols of a window to the base ``SYMBOLS``, the phone itself first: then all on the
    left and all on the right (left bias), the reverse (right bias), or left and right in turns (no bias). Units that
    agree in the first digits are neighbours in the order, so that they are found by bisection.
    Source: Minnis & Breen 2000, §3.
    """

    contexts: NDArray[np.intp]
    orders: tuple[UnitNumbers, ...]
    keys: tuple[NDArray[np.int64], ...]

    def candidates(
        self,
        window: NDArray[np.intp],
        count: int,
        excluded: NDArray[np.bool_] | None = None,
        costs: Callable[[UnitNumbers], Array] | None = None,
    ) -> UnitNumbers:
        """Return the units whose windows agree best with a window, in ascending order.

        window   : symbols [shape=(N,)]; the phone itself is in the middle
        count    : for each bias so many of the longest agreement; of equally long ones those that cost least. 0: every
                   contextual match: all units of the longest agreement to the left, to the right, and equally far to
                   both sides; where no neighbour agrees, all units of the phone
        excluded : units that are not wanted [shape=(U,)]
        costs    : what units cost [shape=(N,)]; where it is the same, or None, those of the lowest keys are taken
        Empty, if no unit has the phone.
        """
        length = len(window)
        sides = (range(length // 2 + 1, 1, -1), range(length // 2 + 1, 1, -1), range(length, 1, -2))
        lengths = sides if not count else (range(length, 0, -1),) * 3
        found = [
            each
            for bias, (order, keys) in enumerate(zip(self.orders, self.keys, strict=True))
            for each in _longest(order, keys, window[digits(bias, length)], lengths[bias], count, excluded, costs)
        ]
        if not found and not count:
            found = [*_longest(self.orders[0], self.keys[0], window[digits(0, length)], (1,), 0, excluded, costs)]
        return np.unique(np.concatenate(found)) if found else np.zeros(0, np.intp)


def index_units(inventory: RecordedUnits, invisible: Collection[str], window: int) -> UnitIndex:
    """Return the index of an inventory."""
    contexts = inventory.windows.contexts(invisible, window // 2)
    usable = np.flatnonzero(inventory.usable)
    orders, keys = [], []
    for bias in range(3):
        key = _keys(contexts[usable][:, digits(bias, window)])
        order = np.argsort(key, kind="stable")
        orders.append(usable[order])
        keys.append(key[order])
    return UnitIndex(contexts, tuple(orders), tuple(keys))


def digits(bias: int, window: int) -> list[int]:
    """Return the columns of a window in the order of a key; bias 0 is left, 1 right, 2 none."""
    middle = window // 2
    left, right = list(range(middle - 1, -1, -1)), list(range(middle + 1, window))
    sides = (left + right, right + left, [column for pair in zip(left, right, strict=True) for column in pair])
    return [middle, *sides[bias]]


def find_substitutes(windows: PhoneWindows, usable: NDArray[np.bool_]) -> dict[str, str]:
    """Return for every phone that no usable unit has the phone that stands in for it."""
    known = {PHONES[number] for number in np.unique(windows.phones[usable])}
    return {phone: find_similar_lips(phone, known) for phone in PHONES if phone not in known} if known else {}


def _keys(columns: NDArray[np.intp]) -> NDArray[np.int64]:
    keys = np.zeros(len(columns), np.int64)
    for column in columns.T:
        keys = keys * SYMBOLS + column
    return keys


def _longest(
    order: UnitNumbers,
    keys: NDArray[np.int64],
    symbols: NDArray[np.intp],
    lengths: Iterable[int],
    count: int,
    excluded: NDArray[np.bool_] | None,
    costs: Callable[[UnitNumbers], Array] | None,
) -> Iterator[UnitNumbers]:
    """Yield units whose agreement has some falling lengths, until there are ``count``; 0: those of the first length."""
    inner: tuple[int, int] | None = None
    found = 0
    for length in lengths:
        low = int(_keys(symbols[None, :length])[0]) * SYMBOLS ** (len(symbols) - length)
        first, stop = np.searchsorted(keys, [low, low + SYMBOLS ** (len(symbols) - length)]).tolist()
        outside = [(first, stop)] if inner is None else [(first, inner[0]), (inner[1], stop)]
        inner = (first, stop)
        for begin, end in outside:
            units = order[begin:end]
            if excluded is not None:
                units = units[~excluded[units]]
            if costs is not None and 0 < count - found < len(units):
                units = units[np.argsort(costs(units), kind="stable")]
            units = units[: count - found] if count else units
            found += len(units)
            if len(units):
                yield units
            if 0 < count <= found:
                return
        if found and not count:
            return
