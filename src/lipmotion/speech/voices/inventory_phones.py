"""A synthesiser's phones in time to those of the inventory, with words, and pauses as in forced alignment."""

from __future__ import annotations

import re
import unicodedata
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby

from lipmotion.errors import InputError
from lipmotion.speech.voices.synthesiser import PhoneMap
from lipmotion.types import Span, Timeline, Unit
from lipmotion.units import PAUSE, SILENCE, VISEME_OF, Lexicon, Pronunciation, find_words, is_silent, list_phone_classes
from lipmotion.units.phones import REDUCED_VOWELS, SHORT_PAUSE_S
from lipmotion.units.spelling import normalise_text

GAP_COST, OWN_FORM_COST, OWN_KIND_COST, OTHER_KIND_COST = 0.7, 0.3, 0.8, 1.5
"""Costs of matching a phone with none, a form of itself, another of its kind (vowel, consonant), and the other kind."""
VOWELS = list_phone_classes()["vowel"]
WRITTEN_EDGES = re.compile(r"^[^\w]+|[^\w]+$")  # punctuation at the ends of a written word
Phones = Sequence[tuple[str, float, float]]


def convert_phones(
    labels: Timeline[str],
    phone_map: PhoneMap,
    words: Sequence[str] | Timeline[str],
    lexicon: Lexicon | None,
    duration_s: float,
) -> Timeline[Unit]:
    """Return the phones of a synthesised sentence in time, as forced alignment would label them.

    phone_map  : labels to phones (``synthesiser.PhoneMap``)
    words      : of the sentence; or what is written of it between blanks, in time, where the synthesiser tells
    lexicon    : pronunciations of the words (None: the sentence is not English, its words stay as they are written)
    duration_s : of the sound; what no label covers is silence
    Raises InputError: a label that is not in the map, or no phone at all.
    """
    timed: list[tuple[str, float, float]] = []
    for span in labels:
        if span.label not in phone_map:
            raise InputError(f"the synthesiser says {span.label!r}, which is no phone; known: {' '.join(phone_map)}")
        names = phone_map[span.label]
        if not names and timed:
            timed[-1] = (*timed[-1][:2], span.end_s)
        each_s = span.duration_s / max(len(names), 1)
        timed += [(phone, span.start_s + i * each_s, span.start_s + (i + 1) * each_s) for i, phone in enumerate(names)]
    phones = _cover([(phone, start, end) for phone, start, end in timed if end > start], duration_s)
    spoken = [phone for phone in phones if not is_silent(phone[0])]
    if not spoken:
        raise InputError("the synthesiser says no phone; give another text")
    if isinstance(words, Timeline):
        named = iter(_with_written_words(spoken, words, lexicon))
    else:
        named = iter(assign_words([phone for phone, _, _ in spoken], words, lexicon or Lexicon()))
    last = len(phones) - 1
    spans = [
        Span(start, end, Unit(PAUSE if 0 < place < last and end - start < SHORT_PAUSE_S else SILENCE))
        if is_silent(phone)
        else Span(start, end, next(named))
        for place, (phone, start, end) in enumerate(phones)
    ]
    return Timeline(tuple(spans))


def assign_words(phones: Sequence[str], words: Sequence[str], lexicon: Lexicon) -> list[Unit]:
    """Return phones with their words; AH, ER and IH are reduced where the dictionary reduces them.

    Both follow from the cheapest match with the words' first pronunciations; other phones belong to the word before.
    """
    expected = [(phone, number) for number, word in enumerate(words) for phone in _pronounce(word, lexicon)]
    units, number = [], expected[0][1] if expected else 0
    for phone, match in zip(phones, match_phones(phones, [phone for phone, _ in expected]), strict=True):
        before = number
        in_lexicon, number = expected[match] if match >= 0 else ("", number)
        name = in_lexicon if REDUCED_VOWELS.get(phone) == in_lexicon else phone
        again = number > before and words[number] == words[before]
        units.append(Unit(name, word=words[number], again=again))
    return units


def _pronounce(word: str, lexicon: Lexicon) -> Pronunciation:
    """Return the first pronunciation of a word; of one with letters that English has not, that of its plain letters."""
    try:
        return lexicon.pronunciations(word)[0]
    except InputError:
        plain = unicodedata.normalize("NFKD", word).encode("ascii", "ignore").decode()
        return lexicon.pronunciations(plain)[0] if plain.strip("'") else ()


def _with_written_words(phones: Phones, written: Timeline[str], lexicon: Lexicon | None) -> list[Unit]:
    """Return the units of phones that are said within written words."""
    starts_s = [span.start_s for span in written]
    numbers = [max(bisect_right(starts_s, (start + end) / 2) - 1, 0) for _, start, end in phones]
    units: list[Unit] = []
    for number, group in groupby(zip(phones, numbers, strict=True), key=lambda pair: pair[1]):
        names = [phone for (phone, _, _), _ in group]
        text = written[number].label
        words = find_words(text)
        if lexicon is not None and words:
            named = assign_words(names, words, lexicon)
        else:
            named = [Unit(name, word=WRITTEN_EDGES.sub("", normalise_text(text))) for name in names]
        again = bool(units) and named[0].word == units[-1].word
        units += [replace(named[0], again=again), *named[1:]]
    return units


def match_phones(spoken: Sequence[str], expected: Sequence[str]) -> list[int]:
    """Return for each spoken phone the index of the expected one that it matches, -1 for none: least total cost.

    Source: Wagner & Fischer 1974 (edit distance).
    """
    costs = [[GAP_COST * column for column in range(len(expected) + 1)]]
    for row, phone in enumerate(spoken):
        above, line = costs[-1], [GAP_COST * (row + 1)]
        for column, other in enumerate(expected):
            same = above[column] + _compute_cost(phone, other)
            line.append(min(same, above[column + 1] + GAP_COST, line[column] + GAP_COST))
        costs.append(line)
    matched, row, column = [-1] * len(spoken), len(spoken), len(expected)
    while row and column:
        if costs[row][column] == costs[row - 1][column - 1] + _compute_cost(spoken[row - 1], expected[column - 1]):
            row, column = row - 1, column - 1
            matched[row] = column
        elif costs[row][column] == costs[row - 1][column] + GAP_COST:
            row -= 1
        else:
            column -= 1
    return matched


def _compute_cost(phone: str, other: str) -> float:
    if phone == other:
        return 0.0
    if REDUCED_VOWELS.get(phone, phone) == REDUCED_VOWELS.get(other, other) or VISEME_OF[phone] == VISEME_OF[other]:
        return OWN_FORM_COST
    return OWN_KIND_COST if (phone in VOWELS) == (other in VOWELS) else OTHER_KIND_COST


def _cover(phones: Phones, duration_s: float) -> list[tuple[str, float, float]]:
    """Return phones with silence where none was, cut at the end of the sound; neighbouring silences are one."""
    covered: list[tuple[str, float, float]] = []
    now = 0.0
    for phone, start, end in [*phones, (SILENCE, duration_s, duration_s)]:
        for name, first, last in ((SILENCE, now, min(start, duration_s)), (phone, start, min(end, duration_s))):
            if last > first and is_silent(name) and covered and covered[-1][0] == SILENCE:
                covered[-1] = (SILENCE, covered[-1][1], last)
            elif last > first:
                covered.append((SILENCE if is_silent(name) else name, first, last))
        now = min(end, duration_s)
    return covered
