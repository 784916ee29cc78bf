"""Phones in context: the N-phone window of every phone, with words, position, stress and duration."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.types import Span, Timeline, Unit
from lipmotion.units import PHONES, SILENCE, close_gaps, describe_unknown_phone, is_silent
from lipmotion.units.phones import VISEME_OF, VISEMES
from lipmotion.units.stress import NUCLEI, find_stress

PROTECTED_PHONES = ("f", "v", "m", "em", "p", "b")
"""Phones whose lip shape every join must preserve. The paper lists /v/ twice and /b/ never."""
PROTECTED, INVISIBLE, NORMAL = "protected", "invisible", "normal"

Overlaps = Mapping[tuple[str, str], float]
"""The forward share of a shared phone, 0 to 1, by the classes of the phones before and after it."""

TABLE_1: Overlaps = {
    (PROTECTED, PROTECTED): 0.50,
    (PROTECTED, INVISIBLE): 0.77,
    (PROTECTED, NORMAL): 0.55,
    (INVISIBLE, PROTECTED): 0.23,
    (INVISIBLE, INVISIBLE): 0.50,
    (INVISIBLE, NORMAL): 0.27,
    (NORMAL, PROTECTED): 0.45,
    (NORMAL, INVISIBLE): 0.77,
    (NORMAL, NORMAL): 0.50,
}
"""Table 1 as printed. Its rows (forward) are the phone before, its columns (backward) the phone after."""
SYMMETRIC: Overlaps = {**TABLE_1, (NORMAL, INVISIBLE): 0.73}
"""Table 1 with the one entry changed that makes it symmetric: 73/27 opposite to 27/73."""
ANTICIPATORY: Overlaps = {(before, after): 1 - TABLE_1[after, before] for before, after in TABLE_1}
"""Table 1 with its rows read as the phone after: the abstract calls the influence of the following segment forward."""
MIDDLE: Overlaps = dict.fromkeys(TABLE_1, 0.5)
LEARNED: Overlaps = {**MIDDLE, (NORMAL, PROTECTED): 0.1}
"""The shares with the least errors of joined motion on the training list of GRID s1 (docs/results/selection.md)."""
OVERLAPS: Mapping[str, Overlaps] = {"learned": LEARNED, "printed": TABLE_1, "symmetric": SYMMETRIC,
                                    "anticipatory": ANTICIPATORY, "middle": MIDDLE}  # fmt: skip


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


INVISIBLE_SYMBOL = len(PHONES)
"""The symbol of all suppressed phones."""
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

    def symbols(self, invisible: Collection[str]) -> NDArray[np.intp]:
        """Return the symbol of every phone [shape=(U,)]: pauses are silence, suppressed phones are one symbol."""
        table = np.array([SILENT if is_silent(p) else INVISIBLE_SYMBOL if p in invisible else n
                          for n, p in enumerate(PHONES)], np.intp)  # fmt: skip
        return table[self.phones]

    def contexts(self, invisible: Collection[str], reach: int) -> NDArray[np.intp]:
        """Return the symbols around every phone [shape=(U, 2·reach + 1)]; beyond a recording there is silence."""
        symbols = self.symbols(invisible)
        numbers = np.arange(len(self))
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
        kept = np.flatnonzero(~np.isin(self.phones, [PHONE_NUMBER[phone] for phone in phones]))
        if len(kept) in (0, len(self)):
            return self, np.arange(len(self))
        begins = np.logical_or.reduceat(self.words[: kept[-1] + 1, 0], np.append(0, kept[:-1] + 1))
        ends = np.logical_or.reduceat(self.words[:, 1], kept)
        taken = replace(
            self,
            recording=self.recording[kept],
            phones=self.phones[kept],
            times_s=self.times_s[kept],
            words=np.stack([begins, ends], axis=1),
            stress=self.stress[kept],
            hidden=np.diff(kept, prepend=-1) > 1,
        )
        return taken, kept

    def suppressed(self, phones: Collection[str]) -> PhoneWindows:
        """Return the phones of one recording without some, whose time the vowel that follows takes.

        Where no vowel follows, the phone before takes it; at the start, the phone after.
        Source: Minnis & Breen 2000, §3: "the following vowel gives the shape of the mouth".
        """
        others, kept = self.without(phones)
        times_s = others.times_s.copy()
        if len(kept) == len(self):
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
        spoken = [(span.label.word, is_silent(span.label.phone)) for span in units]
        for position, span in enumerate(units):
            recording.append(number)
            phones.append(PHONE_NUMBER[span.label.phone])
            times_s.append((span.start_s, span.end_s))
            words.append(
                tuple(
                    not 0 <= other < len(spoken) or spoken[other] != spoken[position]
                    for other in (position - 1, position + 1)
                )
            )
        stress += [UNKNOWN_STRESS if each is None else each for each in find_stress(units)]
    return PhoneWindows(
        np.array(recording, np.int32),
        np.array(phones, np.int16),
        np.array(times_s, float).reshape(-1, 2),
        np.array(words, bool).reshape(-1, 2),
        np.array(stress, np.int8),
        any(span.label.word for units in timelines for span in units),
    )
