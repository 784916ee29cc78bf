"""Phones in time: without gaps, grouped to words, and which of them were recognised, by what files say of it.

Files hold the recognised phones twice: as phones, which people edit, and as they were recognised. A phone that is the
same in both is as doubtful as it was; every other one is known, for somebody has corrected it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import replace
from itertools import groupby
from typing import NamedTuple

from lipmotion.errors import MissingDependencyError
from lipmotion.types import FRAME_RATE_HZ, Span, Timeline, Unit
from lipmotion.units.lexicon import Lexicon, Pronunciation
from lipmotion.units.phones import SILENCE


def close_gaps(units: Timeline[Unit], duration_s: float) -> Timeline[Unit]:
    """Return phones in time that follow each other from the start to the end of a recording.

    units      : a last end may be infinite: it becomes the end of the recording
    duration_s : length of the recording in seconds
    A gap is silence. One of less than a frame (10 ms), as rounded times leave, is added to the phone before it instead.
    Units without phones, of unit sets, are returned as they are.
    """
    if not all(span.label.phone for span in units):
        return units
    filled: list[Span[Unit]] = []
    end_s = 0.0

    def fill(until_s: float) -> None:
        if until_s - end_s >= 1 / FRAME_RATE_HZ - 1e-9:
            filled.append(Span(end_s, until_s, Unit(SILENCE)))
        elif filled and until_s > end_s:
            filled[-1] = Span(filled[-1].start_s, until_s, filled[-1].label)

    for span in units:
        fill(span.start_s)
        end_s = span.end_s if math.isfinite(span.end_s) else max(span.start_s, duration_s)
        filled.append(Span(span.start_s, end_s, span.label))
    if duration_s - end_s >= 1 / FRAME_RATE_HZ:
        fill(duration_s)
    return Timeline(tuple(filled))


RECOGNISED = "recognised"  # name of the tier, and of the member of motion files


class RecognisedPhone(NamedTuple):
    """A phone as it was recognised: its times in seconds, its name or that of its unit, and its confidence, 0 to 1."""

    start_s: float
    end_s: float
    name: str
    confidence: float


def list_recognised_phones(units: Timeline[Unit]) -> list[RecognisedPhone]:
    """Return the phones in time that are recognised, not known."""
    return [
        RecognisedPhone(float(span.start_s), float(span.end_s), _name(span.label), float(span.label.confidence))
        for span in units
        if span.label.confidence is not None
    ]


def restore_confidences(units: Timeline[Unit], recognised: Iterable[RecognisedPhone]) -> Timeline[Unit]:
    """Return phones in time; those still as recognised (``list_recognised_phones``) have their confidence."""
    confidence_of = {phone[:3]: phone.confidence for phone in recognised}

    def restore(span: Span[Unit]) -> Span[Unit]:
        confidence = confidence_of.get((span.start_s, span.end_s, _name(span.label)))
        return replace(span, label=replace(span.label, confidence=confidence))

    return Timeline(tuple(map(restore, units)))


def _name(label: Unit) -> str:
    return label.phone or label.unit


def group_words(units: Timeline[Unit]) -> Timeline[str]:
    """Return the words of phones in time; phones without a word, silence among them, are spans of the empty text.

    Neighbours of the same word are one word, unless one is known to begin it ``again``, or their phones are those of
    the word said several times: ``b ih g b ih g`` is ``big big``, while ``t uw t uw`` is one ``tutu``.

    >>> big = [Span(n / 10, (n + 1) / 10, Unit(phone, word="big")) for n, phone in enumerate("b ih g b ih g".split())]
    >>> [word.label for word in group_words(Timeline(tuple(big)))]
    ['big', 'big']
    """
    words = []
    for word, run in groupby(units, key=lambda span: span.label.word):
        spans = list(run)
        starts = [0, *(place for place, span in enumerate(spans) if span.label.again and place)]
        if len(starts) == 1:
            starts = _starts(word, tuple(span.label.phone for span in spans))
        for first, end in zip(starts, [*starts[1:], len(spans)], strict=True):
            words.append(Span(spans[first].start_s, spans[end - 1].end_s, word))
    return Timeline(tuple(words))


def _starts(word: str, phones: Pronunciation) -> list[int]:
    """Return the place of the first phone of each time that a word is said; just 0 where that cannot be told."""
    if not word or phones[0] not in phones[1:]:
        return [0]
    try:
        lexicon = Lexicon()
        variants = lexicon.pronunciations(word.lower()) if lexicon.known(word.lower()) else ()
    except MissingDependencyError:
        variants = ()
    spoken, *spaced = ("".join(f"{phone} " for phone in each) for each in (phones, *variants))
    single = "|".join(sorted(spaced, key=len, reverse=True))  # as few times as can be
    if not single or not re.fullmatch(f"(?:{single})+", spoken):
        part = re.fullmatch(r"((?:\S+ ){2,}?)\1+", spoken)
        written = re.fullmatch(r"(.{2,}?)\1+", word.lower())  # a word that repeats its own part, as ``blahblah``
        single = part[1] * (len(word) // len(written[1]) if written else 1) if part else spoken
    return [spoken.count(" ", 0, match.start()) for match in re.finditer(single, spoken)] or [0]
