"""Tiers of labels as in a file: what each holds, who speaks in it, and the phones or words that it stands for."""

from __future__ import annotations

import logging
import math
import re
from bisect import bisect_left, bisect_right
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from statistics import median

from lipmotion.errors import InputError, shorten
from lipmotion.printable import is_line
from lipmotion.types import Span, TimedTranscript, TimedWord, Timeline, TranscriptLine, Unit, sort_lines
from lipmotion.types.values import parse_clock, parse_number
from lipmotion.units import PAUSE, PHONES, RECOGNISED, SILENCE, UNKNOWN_PHONES, find_phone, is_silent, reduce_vowels
from lipmotion.units.ipa_phones import find_spelling, read_ipa, read_tokens, xsampa_to_ipa
from lipmotion.units.phones import CLOSURES, REDUCED_VOWELS, SHORT_PAUSE_S
from lipmotion.units.spelling import read_patterns, read_table
from lipmotion.units.spoken_text import (
    SpokenAs,
    classify_label,
    extract_spoken_text,
    find_speaker_names,
    read_line_words,
    time_words,
)

LOG = logging.getLogger("lipmotion")
EARLIEST_S = -1.0  # a time up to this is none; recognisers write others a little before 0, where the sound begins
WORDS, LINES, PHONE_LABELS, RECOGNISED_PHONES, OTHER = "words", "lines", "phones", "recognised", "other"
"""What a tier holds. ``OTHER`` is neither said nor seen: pronunciations, syllables, translations, notes."""
MARKS = read_patterns(Path(__file__).with_name("label_tiers.tsv"))
"""What names of tiers say that they hold, and whose, and parts of labels, by their names in the table."""
SPEAKERS = (r"(?P<speaker>.+?)\s*[-_/:]\s*(?:words?|phones?|phonemes?)", r"[^@]+@(?P<speaker>.+)")
"""Names of tiers that hold a speaker's, too: ``ann - words`` of the Montreal Forced Aligner, ``words@ANN`` of ELAN."""
PHONES_SHARE = 0.75  # a tier of which this share of the labels are phones is one of phones; the other labels are errors
SHARED_TIME = 0.5
"""Tiers of unknown kinds of which so much is at the same time are versions of one text; else they are of speakers."""
SHORTEST_PAUSE_S = 0.0101  # Azure writes gaps of 10 ms between phones that follow each other
ROUNDING_S = 1e-3  # times may differ by this much: they are written with three digits or more
WHOLE_WORD_S = 0.03  # a span of unknown phones whose ends are so near to those of a word is all of it
GLOTTAL_STOP = "q"  # TIMIT's: a sound of the throat, with any lips
RECOGNISED_LABEL = re.compile(r"(\S+) (0|1|1\.0|0\.\d+|\d(?:\.\d+)?e-\d+)")  # a phone or unit, and its confidence
MAX_LABELS, MAX_WORDS = 250_000, 500_000  # most of a file: phones of five hours of speech, words of twelve
TYPICAL_PHONE_S, TYPICAL_WORD_S = 0.08, 0.3  # how long a phone, and a word, alone or of a line, last
LONGEST_WORD_S = 100.0  # a single word that lasts longer than this is in another unit
UNIT_LIMITS = ((150, 1), (6000, 1000), (300_000, 0), (3_200_000, 1_000_000))
"""If they last up to so many times as long as is typical, so many units are a second; 0: these are samples."""
WHOLE_LIMITS = ((15, 1), (70, 0), (220, 100), *UNIT_LIMITS[1:])
"""The same for whole numbers of words and phones, which may be frames (0), too; lines in seconds last that long."""
TICKS_PER_S = 10_000_000
UNITS = {1: "seconds", 100: "hundredths of a second", 1000: "milliseconds", 1_000_000: "microseconds"}
UNITS[TICKS_PER_S] = "ticks of 100 ns"
OCULUS = read_table("oculus")
OCULUS_ALONE = frozenset("PP FF DD SS RR kk nn".split())
"""Phones with the mouths of Oculus' visemes, and the names of those that are no phones."""
PAUSES = frozenset((" ", *' ^ $ . , ; : ! ? — – … ( ) “ ” " « » ¡ ¿'.split(" ")))
"""Symbols of voices for silence: padding, blanks and punctuation, which last as long as the pause."""
LONGEST_SYMBOL = 40  # most letters of a phone with all its marks
WITH_GLIDES = {"aj": "aɪ", "ej": "eɪ", "ɔj": "ɔɪ", "ow": "oʊ", "əw": "əʊ", "aw": "aʊ", "ɐ": "ʌ"}
"""Diphthongs, and the vowel of "cut", as the Montreal Forced Aligner writes them."""


@dataclass(frozen=True, slots=True)
class TimedLabel:
    """One label: its time, its text, and its position in the file, for messages.

    start_s, end_s : NaN where they are not known; an end that is open is infinite
    parts          : the words of a line, where these have times of their own
    """

    start_s: float
    end_s: float
    text: str
    position: str
    parts: tuple[TimedLabel, ...] = ()


@dataclass(frozen=True)
class LabelTier:
    """A series of labels; its name as in the file, what it holds, and who speaks. Empty: the file does not say."""

    name: str
    labels: tuple[TimedLabel, ...]
    role: str = ""
    speaker: str = ""

    @property
    def is_said(self) -> bool:
        """Whether labels may be words: not where all are names of lines (``f000001``, ``ABC_NARR_001``)."""
        return not (self.labels and all(MARKS["identifier"].fullmatch(label.text) for label in self.labels))


def find_tier(name: str, labels: Sequence[TimedLabel], speaker: str = "") -> LabelTier:
    """Return a tier in order of time whose name says what it holds and perhaps who speaks."""
    owner = next(filter(None, (re.fullmatch(form, name, re.IGNORECASE) for form in SPEAKERS)), None)
    role = next((role for role in (OTHER, PHONE_LABELS, WORDS, LINES) if MARKS[role].search(name)), "")
    role = RECOGNISED_PHONES if name == RECOGNISED else role
    last_s = -math.inf
    known_s = [last_s := label.start_s if label.start_s > EARLIEST_S else last_s for label in labels]
    in_time = [label for _, label in sorted(zip(known_s, labels, strict=True), key=lambda pair: pair[0])]
    return LabelTier(name, tuple(in_time), role, speaker or (owner["speaker"].strip() if owner else ""))


def check_count(count: int, where: str, what: str = "labels") -> None:
    """Raise InputError for more labels, or ``words``, than a recording has."""
    most = MAX_WORDS if what == "words" else MAX_LABELS
    if count > most:
        raise InputError(f"{where}: more than {most} {what}; give those of one recording")


def require_time(text: str, place: str, where: str) -> float:
    """Return a time from its text, also with a decimal comma or as 0:01.5. Raises InputError: it is none."""
    if ":" in text and not math.isnan(clock_s := parse_clock(text)):
        return clock_s
    wanted = "finite seconds from the start of the recording"
    return parse_number(text.replace(",", "."), f"{where}: {place} has the time", wanted)


def find_time_unit(spans: Sequence[tuple[float, float, str]], role: str, where: str, usual: int = 1) -> int:
    """Return how many units of time are a second, by how long words, of a line each of them, or phones last.

    spans : start, end and text, in the unit
    where : the file's name; empty: nothing is logged
    usual : how many it usually is, where one span says nothing; a warning names what is neither this nor seconds
    Raises InputError: the times are samples or frames, whose rate is not known.
    """
    lengths = [
        (end - start) / (1 if role == PHONE_LABELS else max(len(text.split()), 1))
        for start, end, text in spans
        if math.inf > end > start and classify_label(text) is SpokenAs.SPEECH
    ]
    all_whole = all(time == int(time) for span in spans for time in span[:2] if math.isfinite(time))
    if not lengths or (len(lengths) < 2 and usual == 1 and lengths[0] < LONGEST_WORD_S):
        return usual if all_whole else 1
    times = median(lengths) / (TYPICAL_PHONE_S if role == PHONE_LABELS else TYPICAL_WORD_S)
    limits = WHOLE_LIMITS if all_whole and role in (WORDS, PHONE_LABELS) else UNIT_LIMITS
    per_s = next((per_s for limit, per_s in limits if times < limit), TICKS_PER_S)
    if not all_whole and per_s != 1000:
        return 1
    starts = [start for start, *_ in spans if not math.isnan(start)]
    if per_s == 0 or (per_s > 1 and len(lengths) > 2 and max(starts) - min(starts) < median(lengths)):
        what = "frames" if times < WHOLE_LIMITS[1][0] else "samples of the sound" if per_s == 0 else "in two units"
        raise InputError(f"{where}: its times seem to be {what} (one lasts {median(lengths):g}), required seconds")
    if where and per_s not in (1, usual):
        LOG.warning("%s: its times are taken for %s; write seconds if they are not", where, UNITS[per_s])
    return per_s


def parse_seconds(tiers: list[LabelTier], where: str, per_s: float = 0) -> list[LabelTier]:
    """Return tiers in seconds; ``per_s``: units in one, 0: as words last. Raises InputError: as ``find_time_unit``."""
    spoken = [tier for tier in tiers if tier.role != OTHER]
    judged = next((tier for tier in spoken if tier.role == WORDS or holds_phones(tier)), next(iter(spoken), None))
    spans = [(label.start_s, label.end_s, label.text) for label in judged.labels] if judged else []
    single = WORDS if all(len(text.split()) < 2 for *_, text in spans) else ""
    role = PHONE_LABELS if judged and holds_phones(judged) else judged.role or single if judged else ""
    per_s = per_s or find_time_unit(spans, role, where)

    def scale(label: TimedLabel) -> TimedLabel:
        return replace(label, start_s=label.start_s / per_s, end_s=label.end_s / per_s)

    return [replace(tier, labels=tuple(map(scale, tier.labels))) for tier in tiers]


def holds_phones(tier: LabelTier) -> bool:
    """Return whether a tier's name says that it holds phones, or most of its labels other than silence are phones."""
    spoken = [label for label in tier.labels if classify_label(label.text) is SpokenAs.SPEECH]
    if tier.role:
        return tier.role == PHONE_LABELS and any(label.text for label in tier.labels)
    return bool(spoken) and sum(to_phone(label.text) is not None for label in spoken) >= PHONES_SHARE * len(spoken)


def split_speakers(tiers: list[LabelTier]) -> list[LabelTier]:
    """Return tiers; those of unknown kinds that hold words at other times than each other are named as speakers."""
    unknown = [tier for tier in tiers if not tier.role and any(label.text for label in tier.labels)]
    if len(unknown) < 2 or any(tier.speaker or tier.role in (WORDS, LINES) for tier in tiers):
        return tiers
    spoken = [
        [label for label in tier.labels if read_line_words(extract_spoken_text(label.text), tier.name)]
        for tier in unknown
    ]
    if any(map(holds_phones, unknown)) or not all(spoken):
        return tiers
    first, others = spoken[0], [label for labels in spoken[1:] for label in labels]
    pairs = product(first[:1000], others[:1000])
    shared_s = sum(max(min(a.end_s, b.end_s) - max(a.start_s, b.start_s), 0.0) for a, b in pairs)
    spoken_s = sum(min(label.end_s - label.start_s, 60.0) for label in first[:1000])
    if shared_s > SHARED_TIME * spoken_s:
        return tiers
    return [replace(tier, speaker=tier.name, role=LINES) if tier in unknown else tier for tier in tiers]


def attach_words(units: Timeline[Unit], labels: Sequence[TimedLabel]) -> Timeline[Unit]:
    """Return phones in time with the words in which their middles lie; unknown phones only where they are all of it."""
    timed = [label for label in labels if not math.isnan(label.start_s + label.end_s)]
    starts_s = [label.start_s for label in timed]
    spans: list[Span[Unit]] = []
    place = -1
    for span in units:
        middle_s, before = (span.start_s + span.end_s) / 2, place
        place = bisect_right(starts_s, middle_s) - 1
        inside = place >= 0 and middle_s < timed[place].end_s and not is_silent(span.label.phone)
        if inside and span.label.unit == UNKNOWN_PHONES:
            edges = (span.start_s - timed[place].start_s, span.end_s - timed[place].end_s)
            inside = max(map(abs, edges)) <= WHOLE_WORD_S
        word = timed[place].text.strip() if inside else ""
        spoken_word = word if is_line(word) and classify_label(word) is SpokenAs.SPEECH else ""
        again = place > before and bool(spans) and spoken_word == spans[-1].label.word != ""
        spans.append(replace(span, label=replace(span.label, word=spoken_word, again=again)))
    return Timeline(tuple(spans))


def read_transcript_tier(tiers: Sequence[LabelTier], where: str) -> TimedTranscript:
    """Return the words of tiers with their times, in order; silence, sounds and markup are left out.

    Each label is a line; words have its time where it is one of words, or a single word.
    Raises InputError: a label ends before it starts, or there are too many words.
    """
    names = find_speaker_names(label.text for tier in tiers for label in tier.labels)
    lines: list[TranscriptLine] = []
    count = 0
    for tier in tiers:
        for label in join_pieces(tier.labels):
            place = f"{where}: {label.position}"
            start_s, end_s = _find_times(label, where)
            words: list[TimedWord] = []
            for part in join_pieces(label.parts or (label,)):
                text = extract_spoken_text(part.text, names) if classify_label(part.text) is SpokenAs.SPEECH else ""
                single = not tier.role and len(read_line_words(text, place)) == 1
                timed = bool(label.parts) or tier.role == WORDS or single
                words += time_words(text, *(_find_times(part, where) if timed else (None, None)), where=place)
            lines.append(TranscriptLine(tuple(words), start_s, end_s))
            count += len(words)
            check_count(count, where, "words")
    return sort_lines(lines)


def join_pieces(labels: Sequence[TimedLabel]) -> list[TimedLabel]:
    """Return labels, of which pieces of a word are one: without a blank, if others have one, or of a contraction."""
    starts = sum(label.text[:1] == " " for label in labels)
    single = all(len(label.text.split()) < 2 and not label.parts for label in labels)
    in_pieces = single and 1 < starts < len(labels) < 3 * starts
    joined: list[TimedLabel] = []
    for label in labels:
        end = f"{joined[-1].text[-1:] if joined and single else ''}{label.text}"  # of a word in two labels
        if joined and ((in_pieces and label.text[:1] != " ") or MARKS["contraction"].fullmatch(end)):
            joined[-1] = replace(joined[-1], end_s=label.end_s, text=joined[-1].text + label.text)
        else:
            joined.append(label)
    return joined


def _find_times(label: TimedLabel, where: str) -> tuple[float | None, float | None]:
    """Return the times of a label, None where they are not known: nothing is said before the sound begins."""
    if label.end_s < label.start_s:
        raise _reverse(label, where)
    start_s, end_s = (time_s if EARLIEST_S < time_s < math.inf else None for time_s in (label.start_s, label.end_s))
    return start_s and max(start_s, 0.0), end_s and max(end_s, 0.0)


def _reverse(label: TimedLabel, where: str) -> InputError:
    ends = f"{label.position} ends at {label.end_s:g} s, before its start"
    return InputError(f"{where}: {ends} at {label.start_s:g} s; correct it")


def read_phone_tier(
    tier: LabelTier, words: Sequence[TimedLabel], where: str, *, with_gaps: bool = False
) -> Timeline[Unit]:
    """Return the phones of a tier in time; speech of unknown phones has the unit ``UNKNOWN_PHONES``.

    words : the words of the same recording in time; if the phones have no stress marks, the lexicon's rule reduces the
            vowels of each word
    with_gaps : gaps between labels are allowed, and stay
    Raises InputError: a label that is no phone, or labels that overlap or leave a gap.
    """
    reached_s = 0.0
    for number, label in enumerate(tier.labels):
        if not min(label.start_s, label.end_s) > EARLIEST_S:
            raise InputError(f"{where}: {label.position} has no time, required the start and the end of a phone")
        if label.end_s < label.start_s:
            raise _reverse(label, where)
        late_s, which = label.start_s - reached_s, f"{where}: {label.position} starts at {label.start_s:g} s, "
        if late_s < -ROUNDING_S:
            raise InputError(f"{which}before the one ahead of it ends ({reached_s:g} s); labels must not overlap")
        if number and not with_gaps and late_s > ROUNDING_S:
            gap = f"the one before it ends at {reached_s:g} s; phones must follow each other without a gap"
            raise InputError(f"{which}{gap}: label silence as sil")
        reached_s = label.end_s
    labels = _join_states(tier.labels)
    nasal = (label.text.lower().removesuffix("n") for label in labels)  # vowels of Buckeye
    phones = [to_phone(label.text) or to_phone(other) or "" for label, other in zip(labels, nasal, strict=True)]
    if "" in phones:
        wrong = labels[phones.index("")]
        what = f"{where}: {wrong.position} is {wrong.text[:40]!r}, which is no phone"
        raise InputError(f"{what}; the phones are: {' '.join(PHONES)}")
    marked = any(re.search(r"\d$", label.text) for label in labels) or set(REDUCED_VOWELS.values()) & set(phones)
    if words and not marked:
        phones = _reduce_vowels(labels, phones, words)
    starts_s = [max(label.start_s, 0.0) for label in labels]
    pairs = zip(labels, starts_s[1:], strict=False)
    ends_s = [after_s if after_s <= label.end_s + ROUNDING_S else label.end_s for label, after_s in pairs]
    ends_s.append(max(labels[-1].end_s, 0.0))
    units = (Unit("", UNKNOWN_PHONES) if phone == UNKNOWN_PHONES else Unit(phone) for phone in phones)
    return Timeline(tuple(Span(*row) for row in zip(starts_s, ends_s, units, strict=True)))


def merge_timelines(timelines: Sequence[Timeline[Unit]]) -> Timeline[Unit]:
    """Return what several speakers say in order, without silence; where two speak at once, who began goes on."""
    if len(timelines) == 1:
        return timelines[0]
    merged: list[Span[Unit]] = []
    spoken = (span for units in timelines for span in units if not is_silent(span.label.phone))
    for span in sorted(spoken, key=lambda span: span.start_s):
        end_s = merged[-1].end_s if merged else -math.inf
        if span.end_s > end_s:
            merged.append(replace(span, start_s=max(span.start_s, end_s)))
    return Timeline(tuple(merged))


def to_phone(text: str) -> str | None:
    """Return the phone that a label stands for, ``UNKNOWN_PHONES`` for speech of unknown ones, or None."""
    text = MARKS["state"].sub("", text)
    inner = MARKS["context"].sub(r"\1", text)
    name = find_phone(text) or find_phone(inner)
    if name is not None or text == GLOTTAL_STOP:
        return name or "hh"
    return {SpokenAs.SILENCE: SILENCE, SpokenAs.UNKNOWN: UNKNOWN_PHONES}.get(classify_label(inner))


def _join_states(labels: Sequence[TimedLabel]) -> list[TimedLabel]:
    """Return states of a phone (``...[2]``, ``...[3]``, ...) as one, and closures of TIMIT's with what they open to."""
    phones: list[TimedLabel] = []
    last = -1
    for label in labels:
        match = MARKS["state"].search(label.text)
        state = int(match[1]) if match else -1
        name = MARKS["state"].sub("", label.text)
        before = phones[-1].text.lower() if phones else ""
        if (phones and state > last >= 0 and before == name.lower()) or name.lower() in CLOSURES.get(before, ()):
            phones[-1] = replace(phones[-1], end_s=label.end_s, text=name)
        else:
            phones.append(replace(label, text=name))
        last = state
    return phones


def _reduce_vowels(labels: Sequence[TimedLabel], phones: Sequence[str], words: Sequence[TimedLabel]) -> list[str]:
    """Return the phones with the unstressed vowels of every word reduced by the lexicon's rule."""
    result, end = list(phones), 0
    middles_s = [(label.start_s + label.end_s) / 2 for label in labels]
    for word in words:
        start, end = max(end, bisect_left(middles_s, word.start_s)), max(end, bisect_left(middles_s, word.end_s))
        inside = [i for i in range(start, end) if not is_silent(phones[i])]
        reduced = reduce_vowels(word.text.lower(), tuple(phones[i] for i in inside))
        for i, phone in zip(inside, reduced, strict=True):
            result[i] = phone
    return result


def split_ipa(labels: Sequence[TimedLabel], where: str) -> list[TimedLabel]:
    """Return phones in IPA as phones of the inventory, in the same time.

    Symbols that are one sound together are one phone, as ``a`` and ``ɪ``; a symbol of several sounds is divided into
    equal times; marks, as those of stress and length, are part of the phone before. Source: ``units.ipa_phones``.
    Raises InputError: a symbol that is none of IPA, with its place.
    """
    unspoken = [label.text in PAUSES or classify_label(label.text) is not SpokenAs.SPEECH for label in labels]
    for label, pause in zip(labels, unspoken, strict=True):
        if len(label.text) > LONGEST_SYMBOL:
            long = f"{label.position} has {len(label.text)} letters"
            raise InputError(f"{where}: {long}, required a phone: {LONGEST_SYMBOL} at most")
        unknown = "" if pause else read_ipa(label.text)[1]
        if unknown:
            what = f"{where}: {label.position} is {shorten(label.text)!r}, which is no phone (not IPA: {unknown!r});"
            raise InputError(f"{what} required IPA, X-SAMPA, or: {' '.join(PHONES)}")
    phones_of: dict[int, list[str]] = defaultdict(list)
    # no sound goes on beyond silence
    tokens = ["<sil>" if pause else label.text for label, pause in zip(labels, unspoken, strict=True)]
    for phone, number in read_tokens(tokens):
        phones_of[number].append(phone)
    result: list[TimedLabel] = []
    for number, label in enumerate(labels):
        if phones := phones_of.get(number, []):
            each_s = (label.end_s - label.start_s) / len(phones)
            edges_s = [label.start_s + place * each_s for place in range(len(phones))] + [label.end_s]
            spans = zip(phones, edges_s[:-1], edges_s[1:], strict=True)
            result += [replace(label, start_s=a, end_s=b, text=phone) for phone, a, b in spans]
        elif not unspoken[number] and result and result[-1].end_s >= label.start_s:
            result[-1] = replace(result[-1], end_s=label.end_s)
        else:
            is_speech = classify_label(label.text) is SpokenAs.UNKNOWN
            result.append(replace(label, text=UNKNOWN_PHONES if is_speech else SILENCE))
    return result


def map_to_inventory(tier: LabelTier, where: str) -> LabelTier:
    """Return a tier; phones in X-SAMPA or IPA become those of the inventory. Raises InputError: as ``split_ipa``."""
    if not tier.role and find_spelling([each.text for each in tier.labels if to_phone(each.text) != SILENCE]):
        tier = replace(tier, role=PHONE_LABELS)
    labels = tier.labels if tier.role == PHONE_LABELS else ()
    names = {label.text.removeprefix("viseme_") for label in tier.labels} - {""}
    if {"X"} < names <= set("ABCDEFGHX"):
        return replace(tier, role=OTHER)  # mouth cues
    if names & OCULUS_ALONE and names <= OCULUS.keys():
        named = (replace(label, text=OCULUS.get(label.text.removeprefix("viseme_"), "")) for label in tier.labels)
        return replace(tier, labels=tuple(named), role=PHONE_LABELS)
    if any("+" in label.text and MARKS["context"].match(label.text) for label in labels):
        labels = tuple(replace(label, text=MARKS["left_context"].sub(r"\1", label.text)) for label in labels)
        tier = replace(tier, labels=labels)
    texts = [label.text for label in labels if classify_label(label.text) is SpokenAs.SPEECH]
    if texts and all(map(str.isdecimal, texts)):
        raise InputError(f"{where}: tier {tier.name!r} holds numbers of phones, required their names")
    as_ipa = _find_ipa([WITH_GLIDES.get(text, text) for text in texts])
    if as_ipa is None:
        return tier
    symbols = [replace(label, text=as_ipa.get(label.text, label.text)) for label in labels]
    return replace(tier, labels=tuple(split_ipa(symbols, where)))


def _find_ipa(texts: Sequence[str]) -> Mapping[str, str] | None:
    """Return the symbols of phones that are written otherwise in IPA; None: the texts are phones of the inventory."""
    if spelling := find_spelling(texts):
        return spelling
    known = sum(to_phone(text) is not None for text in texts)
    in_xsampa = {text: ipa for text in texts if (ipa := xsampa_to_ipa(text))}
    count = sum(text in in_xsampa for text in texts)
    if known == len(texts) or (known >= PHONES_SHARE * len(texts) and count < len(texts)):
        return None
    return in_xsampa if all(map(str.isascii, texts)) and count >= PHONES_SHARE * len(texts) else WITH_GLIDES


def add_pauses(phones: Sequence[TimedLabel]) -> tuple[TimedLabel, ...]:
    """Return phones with silence in the gaps between them; where it is short, a pause."""
    filled: list[TimedLabel] = []
    for label in phones:
        gap_s = label.start_s - filled[-1].end_s if filled else 0.0
        if gap_s > SHORTEST_PAUSE_S:
            filled.append(replace(label, start_s=filled[-1].end_s, end_s=label.start_s, text=SILENCE))
        elif gap_s > ROUNDING_S:
            filled[-1] = replace(filled[-1], end_s=label.start_s)
        filled.append(label)
    is_silence = [classify_label(label.text) is SpokenAs.SILENCE for label in filled]
    for number in range(1, len(filled) - 1):
        if is_silence[number] and filled[number].end_s - filled[number].start_s < SHORT_PAUSE_S:
            filled[number] = replace(filled[number], text=PAUSE)
    return tuple(filled)
