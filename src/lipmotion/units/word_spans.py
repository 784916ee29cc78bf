"""Words in time, of phones in time."""

from __future__ import annotations

import re
from itertools import groupby

from lipmotion.errors import MissingDependencyError
from lipmotion.types import Span, Timeline, Unit
from lipmotion.units.lexicon import Lexicon, Pronunciation


def group_words(units: Timeline[Unit]) -> Timeline[str]:
    """Return the words of phones in time; phones without a word, silence among them, are spans of the empty text.

    Neighbours of the same word are one word, unless one is known to begin it ``again``, or their phones are those of
    the word said several times: ``b ih g b ih g`` is ``big big``, while ``t uw t uw`` is one ``tutu``.

    >>> big = [Span(n / 10, (n + 1) / 10, Unit(phone, word="big")) for n, phone in enumerate("b ih g b ih g".split())]
    >>> [word.label for word in group_words(Timeline(tuple(big)))]
    ['big', 'big']
    """
    found = []
    for word, run in groupby(units, key=lambda span: span.label.word):
        spans = list(run)
        starts = [0, *(place for place, span in enumerate(spans) if span.label.again and place)]
        if len(starts) == 1:
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
        variants = ()
    said = _spaced(phones)
    once = "|".join(sorted(map(_spaced, variants), key=len, reverse=True))  # as few times as can be
    if not once or not re.fullmatch(f"(?:{once})+", said):
        part = re.fullmatch(r"((?:\S+ ){2,}?)\1+", said)
        written = re.fullmatch(r"(.{2,}?)\1+", word.lower())  # a word that repeats its own part, as ``blahblah``
        once = part[1] * (len(word) // len(written[1]) if written else 1) if part else said
    return [said.count(" ", 0, found.start()) for found in re.finditer(once, said)] or [0]


def _spaced(phones: Pronunciation) -> str:
    return "".join(f"{phone} " for phone in phones)
