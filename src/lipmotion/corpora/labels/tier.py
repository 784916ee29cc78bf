"""Tiers of labels as in a file, and the phones or words that they stand for."""

from __future__ import annotations

import math
import re
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace

from lipmotion.errors import InputError, shortened
from lipmotion.printable import is_line
from lipmotion.types import Span, TimedTranscript, TimedWord, Timeline, TranscriptLine, Unit
from lipmotion.units import (
    PHONES,
    RECOGNISED,
    SILENCE,
    RecognisedPhone,
    is_silent,
    phone_named,
    with_confidences,
    with_reduced_vowels,
)
from lipmotion.units.phones import REDUCED_VOWELS
from lipmotion.units.spoken_text import line_words

SILENCES = frozenset(["", *"sil sp spn pau ssil nsn h# #h # _ - silence <sil> <p:> {sil} [sil] <eps>".split()])
"""Labels of other tools for silence, pauses and noise that is not speech."""
PHONES_SHARE = 0.75
"""A tier of which this share of the labels are phones is one of phones; the other labels are errors."""
ROUNDING_S = 1e-3
"""Times may differ by this much: they are written with three digits or more."""
IN_CONTEXT = re.compile(r"[^-+]*-([^-+]+)\+.*")
"""Triphones and full-context labels of HTK and HTS: ``t-iy+n``, ``x^sil-hh+iy=t@...``."""
STATE_NUMBER = re.compile(r"\[(\d{1,9})\]$")
RECOGNISED_LABEL = re.compile(r"(\S+) (0|1|1\.0|0\.\d+|\d(?:\.\d+)?e-\d+)")
"""A phone or unit, and its confidence from 0 to 1."""
MOST_LABELS = 250_000
"""Most labels of a file: phones of five hours of speech."""


@dataclass(frozen=True, slots=True)
class TimedLabel:
    """One label: its time, its text, and its position in the file, for messages. An unknown end is infinite."""

    start_s: float
    end_s: float
    text: str
    position: str


@dataclass(frozen=True)
class LabelTier:
    """A series of labels, and its name for messages."""

    name: str
    labels: tuple[TimedLabel, ...]


def check_count(count: int, where: str) -> None:
    """Raise InputError for more labels than a recording has."""
    if count > MOST_LABELS:
        raise InputError(f"{where}: more than {MOST_LABELS} labels; give those of one recording")


def required_time(text: str, place: str, where: str) -> float:
    """Return a time from its text. Raises InputError: it is not finite."""
    time = float(text)
    if not math.isfinite(time):
        raise InputError(f"{where}: {place} has the time {shortened(text)}, required a finite one")
    return time


def holds_phones(tier: LabelTier) -> bool:
    """Return whether a tier's name says that it holds phones, or most of its labels other than silence are phones."""
    spoken = [label for label in tier.labels if not is_silence(label.text)]
    if not spoken or is_named_as_words(tier):
        return False
    if is_named_as_phones(tier):
        return True
    return sum(phone_of(label.text) is not None for label in spoken) >= PHONES_SHARE * len(spoken)


def is_named_as_phones(tier: LabelTier) -> bool:
    """Return whether a tier's name says that it holds phones."""
    return re.search(r"phone|segment|\bmau\b", tier.name.lower()) is not None


def is_named_as_words(tier: LabelTier) -> bool:
    """Return whether a tier's name says that it holds words."""
    return re.search(r"\bwords?\b|transcript|\bort", tier.name.lower()) is not None


def is_named_as_recognised(tier: LabelTier) -> bool:
    """Return whether a tier's name says that it holds the phones as they were recognised (``units.recognised``)."""
    return tier.name == f"tier {RECOGNISED!r}"


def with_recognised(units: Timeline[Unit], tier: LabelTier) -> Timeline[Unit]:
    """Return phones in time in which those of a tier of recognised ones have their confidence; the others are known."""
    found = [(label, RECOGNISED_LABEL.fullmatch(label.text)) for label in tier.labels]
    rows = (RecognisedPhone(label.start_s, label.end_s, match[1], float(match[2])) for label, match in found if match)
    return with_confidences(units, rows)


def with_words(units: Timeline[Unit], tier: LabelTier) -> Timeline[Unit]:
    """Return phones in time, each with the word of a tier in which its middle lies; silence has none."""
    starts_s = [label.start_s for label in tier.labels]
    spans = []
    for span in units:
        middle_s = (span.start_s + span.end_s) / 2
        place = bisect_right(starts_s, middle_s) - 1
        inside = place >= 0 and middle_s < tier.labels[place].end_s and not is_silent(span.label.phone)
        word = tier.labels[place].text if inside else ""
        said = word if is_line(word) and not is_silence(word) else ""
        spans.append(replace(span, label=replace(span.label, word=said)))
    return Timeline(tuple(spans))


def tier_transcript(tier: LabelTier, where: str) -> TimedTranscript:
    """Return the words of a tier with their times, silence left out; each label is a line.

    Raises InputError: labels overlap, or there is no word.
    """
    _check_order(tier, where)
    lines = []
    for label in tier.labels:
        words = () if is_silence(label.text) else line_words(label.text, f"{where}: {label.position}")
        end_s = label.end_s if math.isfinite(label.end_s) else None
        times_s = (label.start_s, end_s) if len(words) == 1 else (None, None)
        if words:
            lines.append(TranscriptLine(tuple(TimedWord(word, *times_s) for word in words), label.start_s, end_s))
    if not lines:
        raise InputError(f"{where}: {tier.name} holds no word; remove the file if the words are not known")
    return TimedTranscript(tuple(lines))


def phone_timeline(tier: LabelTier, words: LabelTier | None, where: str, *, with_gaps: bool = False) -> Timeline[Unit]:
    """Return the phones of a tier in time.

    words : the words of the same recording in time, or None; if the phones have no stress marks, the lexicon's rule
            reduces the vowels of each word
    with_gaps : gaps between labels are allowed, and stay
    Raises InputError: a label that is no phone, or labels that overlap or leave a gap.
    """
    _check_order(tier, where)
    for before, label in zip(tier.labels, tier.labels[1:], strict=False):
        if not with_gaps and label.start_s > before.end_s + ROUNDING_S:
            raise InputError(
                f"{where}: {label.position} starts at {label.start_s:g} s, the one before it ends at {before.end_s:g} "
                "s; phones must follow each other without a gap: label silence as sil"
            )
    labels = _without_states(tier.labels)
    phones = [_required_phone(label, where) for label in labels]
    marked = any(re.search(r"\d$", label.text) for label in labels) or set(REDUCED_VOWELS.values()) & set(phones)
    if words is not None and not marked:
        phones = _reduced(labels, phones, words)
    starts_s = [max(label.start_s, 0.0) for label in labels]
    ends_s = [
        label.end_s if following_s > label.end_s + ROUNDING_S else following_s
        for label, following_s in zip(labels, starts_s[1:], strict=False)
    ] + [max(labels[-1].end_s, 0.0)]
    return Timeline(tuple(Span(*row) for row in zip(starts_s, ends_s, map(Unit, phones), strict=True)))


def _check_order(tier: LabelTier, where: str) -> None:
    """Raise InputError for labels that overlap or end before they start."""
    end_s = 0.0
    for label in tier.labels:
        if label.end_s < label.start_s:
            raise InputError(
                f"{where}: {label.position} ends at {label.end_s:g} s, before its start at {label.start_s:g} s"
            )
        if label.start_s < end_s - ROUNDING_S:
            raise InputError(
                f"{where}: {label.position} starts at {label.start_s:g} s, before the one ahead of it ends ({end_s:g} "
                "s); labels must not overlap"
            )
        end_s = label.end_s


def is_silence(text: str) -> bool:
    """Return whether a label of another tool stands for silence."""
    return (_inner(text) or text).lower() in SILENCES


def _inner(text: str) -> str | None:
    """Return the phone in the middle of a triphone or full-context label; None for other labels."""
    match = IN_CONTEXT.fullmatch(text)
    return match[1] if match else None


def phone_of(text: str) -> str | None:
    """Return the phone that a label stands for, or None."""
    text = STATE_NUMBER.sub("", text)
    name = phone_named(text) or phone_named(_inner(text) or "")
    return SILENCE if name is None and is_silence(text) else name


def _required_phone(label: TimedLabel, where: str) -> str:
    phone = phone_of(label.text)
    if phone is None:
        raise InputError(
            f"{where}: {label.position} is {label.text[:40]!r}, which is no phone; the phones are: {' '.join(PHONES)}"
        )
    return phone


def _without_states(labels: Sequence[TimedLabel]) -> list[TimedLabel]:
    """Return labels of whole phones: labels of the states of a phone (``...[2]``, ``...[3]``, ...) become one."""
    whole: list[TimedLabel] = []
    last = -1
    for label in labels:
        match = STATE_NUMBER.search(label.text)
        state = int(match[1]) if match else -1
        name = STATE_NUMBER.sub("", label.text)
        if whole and state > last >= 0 and whole[-1].text == name:
            whole[-1] = TimedLabel(whole[-1].start_s, label.end_s, name, whole[-1].position)
        else:
            whole.append(TimedLabel(label.start_s, label.end_s, name, label.position))
        last = state
    return whole


def _reduced(labels: Sequence[TimedLabel], phones: Sequence[str], words: LabelTier) -> list[str]:
    """Return the phones with the unstressed vowels of every word reduced by the lexicon's rule."""
    result = list(phones)
    middles_s = [(label.start_s + label.end_s) / 2 for label in labels]
    in_time = sorted(range(len(labels)), key=middles_s.__getitem__)
    sorted_s = [middles_s[i] for i in in_time]
    end = 0
    for word in words.labels:
        start, end = max(end, bisect_left(sorted_s, word.start_s)), max(end, bisect_left(sorted_s, word.end_s))
        inside = [i for i in sorted(in_time[start:end]) if not is_silent(phones[i])]
        reduced = with_reduced_vowels(word.text.lower(), tuple(phones[i] for i in inside))
        for i, phone in zip(inside, reduced, strict=True):
            result[i] = phone
    return result
