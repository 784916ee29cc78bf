"""Sentences to record: those that say most of what a model has not heard, first."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from importlib import resources
from itertools import groupby, pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.corpora.entry import read_entry
from lipmotion.corpora.store import Corpus
from lipmotion.errors import InputError
from lipmotion.pipeline.transcribe import read_transcript
from lipmotion.units import SILENCE, VISEME_OF, Lexicon, is_silent, words_of

SHIPPED = "english.txt"
PHONE, DIPHONE, BESIDE = "phone", "diphone", "beside"
WORTH = {PHONE: 8.0, DIPHONE: 2.0, BESIDE: 1.0}
"""What each unit is worth when it is first said: a phone; a phone after a phone; a phone beside a viseme class. The
engines fall back from the last to the first, so the more general ones must not be missing."""

UnitName = tuple[str, ...]


@dataclass(frozen=True)
class Prompt:
    """A sentence, and how many phones and diphones are covered once it has been recorded."""

    text: str
    phones: int
    diphones: int


@dataclass(frozen=True)
class Prompts:
    """The sentences to record, in this order.

    phones, diphones : how many there are in all sentences together, and in what is recorded already
    sentences        : how many were there to choose from
    left_out         : sentences that were not, to the word that is neither in the dictionary nor in the lexicon
    """

    chosen: tuple[Prompt, ...]
    phones: int
    diphones: int
    sentences: int
    left_out: dict[str, str]


def prompts(
    text: str | Path | None = None, *, count: int = 50, have: Corpus | None = None, lexicon: Lexicon | None = None
) -> Prompts:
    """Return the sentences that cover most units for the time it takes to say them.

    text  : a file with a sentence a line; the list in the package by default
    count : at most so many; fewer where further ones would add nothing
    have  : a corpus whose units need not be said again; its utterances without words or phones do not count
    Raises InputError: no such file, no sentence that can be used, or a count under 1.
    Source: greedy weighted set cover (Chvátal 1979), gains recomputed only where they may matter (Minoux 1978).
    """
    if count < 1:
        raise InputError(f"{count} prompts asked for, required at least 1")
    lexicon = lexicon or Lexicon()
    path = Path(text) if text is not None else Path(str(resources.files("lipmotion") / "prompts" / SHIPPED))
    usable, left_out = _pronounced(_lines(path), lexicon)
    if not usable:
        some = f"; {next(iter(left_out.values()))!r} is not in the dictionary: --lexicon" if left_out else ""
        raise InputError(f"{path}: no sentence to choose from{some}; required: a sentence a line")
    index: dict[UnitName, int] = {}
    units = [_numbered(units_of(phones), index) for phones in usable.values()]
    known = _numbered({unit for run in _recorded(have, lexicon) for unit in units_of(run)}, index) if have else None
    worth = np.array([WORTH[name[0]] for name in index])
    if known is not None:
        worth[known] = 0
    costs = [len(phones) for phones in usable.values()]
    order = greedy_cover(units, costs, worth.copy(), count)
    covered = worth == 0
    is_phone, is_diphone = (np.array([name[0] == kind for name in index]) for kind in (PHONE, DIPHONE))
    chosen, sentences = [], list(usable)
    for number in order:
        covered[units[number]] = True
        chosen.append(Prompt(sentences[number], int((covered & is_phone).sum()), int((covered & is_diphone).sum())))
    return Prompts(tuple(chosen), int(is_phone.sum()), int(is_diphone.sum()), len(usable), left_out)


def units_of(phones: Sequence[str]) -> set[UnitName]:
    """Return the units in phones that are said between two silences; silence counts as a neighbour only."""
    around = [SILENCE, *phones, SILENCE]
    units: set[UnitName] = {(DIPHONE, left, right) for left, right in pairwise(around)}
    for left, phone, right in zip(around, phones, around[2:], strict=False):
        units |= {(PHONE, phone), (BESIDE, f"[{VISEME_OF[left]}]-{phone}"), (BESIDE, f"{phone}+[{VISEME_OF[right]}]")}
    return units


def greedy_cover(
    sets: Sequence[NDArray[np.intp]], costs: Sequence[float], worth: NDArray[np.float64], count: int
) -> list[int]:
    """Return which sets to take, in order: each time the one that adds most worth for its cost.

    sets  : the elements of each, as indices into ``worth``
    worth : of each element [shape=(E,)]; becomes 0 where it is taken
    What a set adds only ever shrinks, so one that still leads after its gain was recomputed is the best of all.
    """
    queue = [
        (-float(worth[elements].sum()) / cost, i) for i, (elements, cost) in enumerate(zip(sets, costs, strict=True))
    ]
    heapq.heapify(queue)
    taken: list[int] = []
    while queue and len(taken) < count:
        _, i = heapq.heappop(queue)
        now = (-float(worth[sets[i]].sum()) / costs[i], i)
        if queue and now > queue[0]:
            heapq.heappush(queue, now)
        elif now[0] == 0:
            break
        else:
            taken.append(i)
            worth[sets[i]] = 0
    return taken


def _lines(path: Path) -> list[str]:
    lines = (" ".join(line.split()) for line in read_transcript(path).splitlines())
    return list(dict.fromkeys(line for line in lines if line))


def _pronounced(lines: Iterable[str], lexicon: Lexicon) -> tuple[dict[str, tuple[str, ...]], dict[str, str]]:
    """Return sentences with their phones, and those with a word that nobody says how to pronounce."""
    usable: dict[str, tuple[str, ...]] = {}
    left_out: dict[str, str] = {}
    for line in lines:
        try:
            words = words_of(line)
        except InputError:  # a line of dashes
            continue
        unknown = next((word for word in words if not lexicon.known(word)), None)
        if unknown is None:
            usable[line] = tuple(phone for word in words for phone in lexicon.pronunciations(word)[0])
        else:
            left_out[line] = unknown
    return usable, left_out


def _recorded(corpus: Corpus, lexicon: Lexicon) -> Iterator[tuple[str, ...]]:
    """Give the phones that a corpus holds, from silence to silence."""
    for name in corpus.names():
        entry = read_entry(corpus.folder(name))
        if entry.get("phones"):
            phones = [row[2] for row in entry["phones"]]
            yield from (tuple(run) for silent, run in groupby(phones, key=is_silent) if not silent)
        elif entry["words"] and all(map(lexicon.known, entry["words"])):
            yield tuple(phone for word in entry["words"] for phone in lexicon.pronunciations(word)[0])


def _numbered(units: set[UnitName], index: dict[UnitName, int]) -> NDArray[np.intp]:
    return np.array([index.setdefault(unit, len(index)) for unit in sorted(units)], np.intp)
