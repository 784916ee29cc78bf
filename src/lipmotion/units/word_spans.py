"""Words in time, of phones in time."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

from lipmotion.errors import MissingDependencyError
from lipmotion.types import Span, Timeline, Unit
from lipmotion.units.lexicon import Lexicon, Pronunciation


def words_in_time(units: Timeline[Unit]) -> Timeline[str]:
    """Return the words of phones in time; phones without a word, silence among them, are spans of the empty text.

    Neighbours of the same word are one word, unless their phones are those of the word said several times: ``b ih g b
    ih g`` is ``big big``, while ``t uw t uw`` is one ``tutu``. Only words of the dictionary are told apart so.

    >>> big = [Span(n / 10, (n + 1) / 10, Unit(phone, word="big")) for n, phone in enumerate("b ih g b ih g".split())]
    >>> [word.label for word in words_in_time(Timeline(tuple(big)))]
    ['big', 'big']
    """
    found = []
    for word, run in groupby(units, key=lambda span: span.label.word):
        spans = list(run)
        starts = _starts(word, tuple(span.label.phone for span in spans))
        for first, end in zip(starts, [*starts[1:], len(spans)], strict=True):
            found.append(Span(spans[first].start_s, spans[end - 1].end_s, word))
    return Timeline(tuple(found))


def _starts(word: str, phones: Pronunciation) -> list[int]:
    """Return the place of the first phone of each time that a word is said; just 0 where that cannot be told."""
    if not word or phones[0] not in phones[1:]:
        return [0]
    try:
        lexicon = Lexicon()
        variants = lexicon.pronunciations(word.lower()) if lexicon.known(word.lower()) else ()
    except MissingDependencyError:
        return [0]
    return _fewest_parts(phones, variants) or [0]


def _fewest_parts(phones: Pronunciation, variants: Sequence[Pronunciation]) -> list[int]:
    """Return where the parts begin if phones are put together of as few variants as possible; empty: they are not."""
    parts: list[tuple[int, int] | None] = [(0, 0), *[None] * len(phones)]  # up to here: how many, start of the last one
    for end in range(1, len(phones) + 1):
        for variant in variants:
            start = end - len(variant)
            before = parts[start] if start >= 0 and phones[start:end] == variant else None
            best = parts[end]
            if before is not None and (best is None or before[0] + 1 < best[0]):
                parts[end] = before[0] + 1, start
    starts: list[int] = []
    end = len(phones)
    while end and (last := parts[end]) is not None:
        end = last[1]
        starts.append(end)
    return starts[::-1]
