"""The inventory: every recorded phone in its context, with the motion that was recorded, and an index of the contexts.

The context of a phone is the N-phone window around it, with words, position, stress and duration.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.types import FRAME_RATE_HZ, Span, Timeline, Unit
from lipmotion.units import PHONES, SILENCE, close_gaps, describe_unknown_phone, is_silent
from lipmotion.units.phones import VISEME_OF, VISEMES
from lipmotion.units.stress import NUCLEI, find_stress

PROTECTED_PHONES = ("f", "v", "m", "em", "p", "b")
"""Phones whose lip shape every join must preserve. The paper lists /v/ twice and /b/ never."""
LIP_CLASSES = PROTECTED, INVISIBLE, NORMAL = "protected", "invisible", "normal"

Overlaps = Mapping[tuple[str, str], float]
"""The forward share of a shared phone, 0 to 1, by the classes of the phones before and after it."""

TABLE_1: Overlaps = {
    (before, after): share
    for before, row in zip(LIP_CLASSES, ((0.50, 0.77, 0.55), (0.23, 0.50, 0.27), (0.45, 0.77, 0.50)), strict=True)
    for after, share in zip(LIP_CLASSES, row, strict=True)
}
"""Table 1 as printed. Its rows (forward) are the phone before, its columns (backward) the phone after."""
SYMMETRIC: Overlaps = {**TABLE_1, (NORMAL, INVISIBLE): 0.73}
"""Table 1 with the one entry changed that makes it symmetric: 73/27 opposite to 27/73."""
ANTICIPATORY: Overlaps = {(before, after): 1 - TABLE_1[after, before] for before, after in TABLE_1}
"""Table 1 with its rows read as the phone after: the abstract calls the influence of the following segment forward."""
MIDDLE: Overlaps = dict.fromkeys(TABLE_1, 0.5)
OVERLAPS = {"printed": TABLE_1, "symmetric": SYMMETRIC, "anticipatory": ANTICIPATORY, "middle": MIDDLE}


def find_lip_class(phone: str, invisible: Collection[str]) -> str:
    """Return the class of a phone: ``protected``, ``invisible`` or ``normal``."""
    if phone in PROTECTED_PHONES:
        return PROTECTED
    return INVISIBLE if phone in invisible else NORMAL


def parse_invisible(text: str) -> frozenset[str]:
    """Return the phones of a text such as ``t d g k``. Raises InputError: one that cannot be invisible."""
    phones = frozenset(text.split())
    for phone in sorted(phones):
        if phone not in PHONES or is_silent(phone) or phone in PROTECTED_PHONES:
            allowed = " ".join(p for p in PHONES if not is_silent(p) and p not in PROTECTED_PHONES)
            raise InputError(f"the phone {phone!r} cannot be invisible; required some of: {allowed}")
    return phones


INVISIBLE_SYMBOL = len(PHONES)  # the symbol of all suppressed phones
SYMBOLS = len(PHONES) + 1
PHONE_NUMBER = {phone: number for number, phone in enumerate(PHONES)}
SILENT = PHONE_NUMBER[SILENCE]
VISEME_NUMBER = np.array([*(list(VISEMES).index(VISEME_OF[phone]) for phone in PHONES), len(VISEMES)])
UNKNOWN_STRESS = -1
SHORTEST_S = 0.01


@dataclass(frozen=True, eq=False)
class PhoneWindows:
    """The phones of one or several recordings, in context: one row a phone.

    recording : number of the recording of each phone [shape=(U,)]
    phones    : number of each phone in ``PHONES`` [shape=(U,)]
    times_s   : its start and its end in the recording [shape=(U, 2)]
    words     : whether it begins a word, and whether it ends one [bool, shape=(U, 2)]
    stress    : whether its syllable is stressed, 1 or 0; -1: not known [shape=(U,)]
    words_known : whether phones know their words
    hidden    : whether a suppressed phone came before each; None: none is suppressed [shape=(U,)]
    """

    recording: NDArray[np.int32]
    phones: NDArray[np.int16]
    times_s: NDArray[np.float64]
    words: NDArray[np.bool_]
    stress: NDArray[np.int8]
    words_known: bool = True
    hidden: NDArray[np.bool_] | None = None

    def __len__(self) -> int:
        return len(self.phones)

    @property
    def durations_s(self) -> NDArray[np.float64]:
        """The duration of every phone [shape=(U,)]."""
        return self.times_s[:, 1] - self.times_s[:, 0]

    def contexts(self, invisible: Collection[str], reach: int) -> NDArray[np.intp]:
        """Return the symbols around every phone [shape=(U, 2·reach + 1)]; beyond a recording there is silence.

        Pauses are silence; suppressed phones are one symbol.
        """
        table = np.array([SILENT if is_silent(p) else INVISIBLE_SYMBOL if p in invisible else n
                          for n, p in enumerate(PHONES)], np.intp)  # fmt: skip
        symbols, numbers = table[self.phones], np.arange(len(self))
        columns = []
        for offset in range(-reach, reach + 1):
            there = np.clip(numbers + offset, 0, len(self) - 1)
            inside = (there == numbers + offset) & (self.recording[there] == self.recording)
            columns.append(np.where(inside, symbols[there], SILENT))
        return np.stack(columns, axis=1)

    @property
    def continues(self) -> NDArray[np.bool_]:
        """Whether the phone after each one is of the same recording [shape=(U,)]."""
        return np.append(self.recording[1:] == self.recording[:-1], False)

    @property
    def adjoins(self) -> NDArray[np.bool_]:
        """Whether the phone after each one is of the same recording, and none was left out between them."""
        gaps_s = np.append(self.times_s[1:, 0] - self.times_s[:-1, 1], np.inf)
        return self.continues & (gaps_s < SHORTEST_S / 2)

    def without(self, phones: Collection[str]) -> tuple[PhoneWindows, NDArray[np.intp]]:
        """Return the other phones, with their own times, and their numbers here; all phones, if there are no others.

        A phone beside one that was left out begins or ends the word that this one began or ended.
        """
        remaining = np.flatnonzero(~np.isin(self.phones, [PHONE_NUMBER[phone] for phone in phones]))
        if len(remaining) in (0, len(self)):
            return self, np.arange(len(self))
        begins = np.logical_or.reduceat(self.words[: remaining[-1] + 1, 0], np.append(0, remaining[:-1] + 1))
        ends = np.logical_or.reduceat(self.words[:, 1], remaining)
        taken = replace(
            self,
            recording=self.recording[remaining],
            phones=self.phones[remaining],
            times_s=self.times_s[remaining],
            words=np.stack([begins, ends], axis=1),
            stress=self.stress[remaining],
            hidden=np.diff(remaining, prepend=-1) > 1,
        )
        return taken, remaining

    def suppressed(self, phones: Collection[str]) -> PhoneWindows:
        """Return the phones of one recording without some, whose time the vowel that follows takes.

        Where no vowel follows, the phone before takes it; at the start, the phone after.
        Source: Minnis & Breen 2000, §3: "the following vowel gives the shape of the mouth".
        """
        others, remaining = self.without(phones)
        times_s = others.times_s.copy()
        if len(remaining) == len(self):
            return self
        times_s[0, 0], times_s[-1, 1] = self.times_s[0, 0], self.times_s[-1, 1]
        vowel = np.array([PHONES[phone] in NUCLEI for phone in others.phones[1:]], bool)
        times_s[1:, 0] = np.where(vowel, times_s[:-1, 1], times_s[1:, 0])
        times_s[:-1, 1] = times_s[1:, 0]
        return replace(others, times_s=times_s)


def cover_recording(units: Timeline[Unit], duration_s: float) -> Timeline[Unit]:
    """Return phones in time without gaps, and without phones of no duration; at least one."""
    spans = tuple(span for span in close_gaps(units, duration_s) if span.duration_s > 0)
    return Timeline(spans or (Span(0.0, SHORTEST_S, Unit(SILENCE)),))


def list_windows(timelines: Sequence[Timeline[Unit]]) -> PhoneWindows:
    """Return the phones of some recordings. Raises InputError: an unknown phone."""
    recording, phones, times_s, words, stress = [], [], [], [], []
    for number, units in enumerate(timelines):
        for span in units:
            if span.label.phone not in PHONE_NUMBER:
                raise InputError(describe_unknown_phone(span.label.phone, f" at {span.start_s} s"))
            recording.append(number)
            phones.append(PHONE_NUMBER[span.label.phone])
            times_s.append((span.start_s, span.end_s))
        spoken = [(span.label.word, is_silent(span.label.phone)) for span in units]
        around = zip([None, *spoken], spoken, [*spoken[1:], None], strict=False)
        words += [(before != here, here != after) for before, here, after in around]
        stress += [UNKNOWN_STRESS if each is None else each for each in find_stress(units)]
    return PhoneWindows(
        np.array(recording, np.int32),
        np.array(phones, np.int16),
        np.array(times_s, float).reshape(-1, 2),
        np.array(words, bool).reshape(-1, 2),
        np.array(stress, np.int8),
        any(span.label.word for units in timelines for span in units),
    )


SOURCE = re.compile(r" \d+\.\d+-\d+\.\d+ s \S+$")  # the end of what ``find_source`` returns


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
    stored_ranges : the first row and the one after the last of each range of stored motion, in order [shape=(K, 2)]
    motion    : there, in the motion space, 100 rows a second; stored in half precision [shape=(N, Q)]
    predicted : what the guide predicts at ``POINTS`` of each unit, reduced [shape=(U, POINTS, D)]; None: no guide
    """

    names: tuple[str, ...]
    windows: PhoneWindows
    usable: NDArray[np.bool_]
    first: NDArray[np.intp]
    stored_ranges: NDArray[np.intp]
    motion: NDArray[np.floating[Any]]
    predicted: NDArray[np.float16] | None

    @cached_property
    def values(self) -> Array:
        """The motion of all recordings [shape=(F, Q)]; silence that is not stored is a line."""
        stored = np.concatenate([np.arange(first, stop) for first, stop in self.stored_ranges.tolist()])
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
        windows, remaining = self.windows.without(phones)
        if not self.usable[remaining].any():
            return self
        predicted = self.predicted[remaining] if self.predicted is not None else None
        return replace(self, windows=windows, usable=self.usable[remaining], predicted=predicted)

    def poses(self, fraction: float, later_s: float = 0.0) -> Array:
        """Return the motion of all units at a fraction of their duration, 0 to 1, or some time later [shape=(U, Q)]."""
        start_s, end_s = self.windows.times_s.T
        return self.at(self.windows.recording, start_s + fraction * (end_s - start_s) + later_s)

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
        matches = [
            each
            for bias, (order, keys) in enumerate(zip(self.orders, self.keys, strict=True))
            for each in _longest(order, keys, window[digits(bias, length)], lengths[bias], count, excluded, costs)
        ]
        if not matches and not count:
            matches = [*_longest(self.orders[0], self.keys[0], window[digits(0, length)], (1,), 0, excluded, costs)]
        return np.unique(np.concatenate(matches)) if matches else np.zeros(0, np.intp)


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
    total = 0
    for length in lengths:
        low = int(_keys(symbols[None, :length])[0]) * SYMBOLS ** (len(symbols) - length)
        first, stop = np.searchsorted(keys, [low, low + SYMBOLS ** (len(symbols) - length)]).tolist()
        outside = [(first, stop)] if inner is None else [(first, inner[0]), (inner[1], stop)]
        inner = (first, stop)
        for begin, end in outside:
            units = order[begin:end]
            if excluded is not None:
                units = units[~excluded[units]]
            if costs is not None and 0 < count - total < len(units):
                units = units[np.argsort(costs(units), kind="stable")]
            units = units[: count - total] if count else units
            total += len(units)
            if len(units):
                yield units
            if 0 < count <= total:
                return
        if total and not count:
            return
