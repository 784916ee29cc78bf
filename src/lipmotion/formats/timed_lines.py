"""Labels in time, one a line: of HTK, Audacity, TIMIT, ESPS, NIST's CTM and STM, tables with a header, texts of LRS."""

from __future__ import annotations

import csv
import math
import re
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace
from io import StringIO
from itertools import islice
from pathlib import Path
from statistics import median

from lipmotion.errors import InputError, shorten
from lipmotion.formats.label_tiers import (
    LINES,
    MAX_LABELS,
    PHONE_LABELS,
    TICKS_PER_S,
    WORDS,
    LabelTier,
    TimedLabel,
    check_count,
    find_tier,
    parse_seconds,
    require_time,
    to_phone,
)
from lipmotion.units.spoken_text import SpokenAs, classify_label

SHORTEST_TICKS = 10_000  # whole numbers below a millisecond are no ticks at sight: "20 30 people" is a sentence
LONG_SPAN = 45  # Whole numbers in order that are further apart than this are no seconds
NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,3})?|nan|inf"
WHOLE = re.compile(r"(\d+)[\s,;]\s*(\d+)[\s,;]\s*(\S+)(?:\s.*)?")
POINTS = re.compile(r"(\d+|\d*\.\d+)\s+(?:-?\d{1,3}\s+)?([^\d\s;]\S*)\s*(?:;.*)?")
"""A start or an end alone, perhaps a colour, a label: of HTK in ticks; of ESPS, Festival and people in seconds."""
ESPS = re.compile(r"\A(?:[^\n]*\n){0,20}?#[ \t]*\n(?=\s*[\d.]+\s)")
"""The header of ESPS and Festival, whose lines say where labels end."""
SECONDS = re.compile(r"([-+]?\d*\.\d+)\s+([-+]?\d*\.\d+)(?:\s+(.*))?|([-+]?\d+,\d+)\t([-+]?\d+,\d+)(?:\t(.*))?")
CTM = re.compile(rf"(\S+)\s+(?!\d*\.\d)(\S+)\s+({NUMBER})\s+({NUMBER})\s+(\S+)(?:\s+(?:{NUMBER}|NA))?(?:\s.*)?")
"""Recording, channel, start and duration in seconds, word, confidence."""
STM = re.compile(rf"(\S+)\s+\S+\s+(\S+)\s+({NUMBER})\s+({NUMBER})\s+(?:<[^<>]*>\s*)?(.*)")
"""Recording, channel, speaker, start and end in seconds, kind, words."""
RTTM = re.compile(r"(?:SPEAKER|SPKR-INFO)\s+\S+\s+\S+\s")
COMMENT = (";;", "#")
LRS_TEXT = re.compile(r"\s*Text:[ \t]+(\S.*)")  # the first line of a text of LRS: what is said
LRS_WORDS = re.compile(r"^WORD[ \t]+START[ \t]+END\b.*$", re.MULTILINE)
COLUMNS = {
    "start": {"begin", "begintime", "start", "starttime", "starts", "tmin", "onset", "startframe", "framestart"},
    "end": {"end", "endtime", "ends", "stop", "tmax", "offset", "endframe", "frameend"},
    "duration": {"duration", "dur"},
    "text": {"label", "text", "word", "phone", "transcript", "transcription", "utterance", "annotation"},
    "kind": {"type", "tier", "tiername"},
    "speaker": {"speaker", "speakerid", "participant"},
}
"""Names of columns of tables: of the Montreal Forced Aligner, of Praat, of people."""
UNIT_END = re.compile(
    r"(?:[\s_]+(?:-\s)?|[\s_]*[(\[])(?:hh:mm:ss(?:[:.]\w+)?|(?:ss\.)?m?s(?:ecs?)?|(?:milli)?seconds?)[)\]]?$"
)
"""A unit at the end of a name, which how long words last tells, too: ``start_ms``, ``Start (s)``."""
ELAN_TIME = r"(?:\t[\d:]+[.,]\d+)"
HEADLESS = (
    (re.compile(rf"[^\t]+\t[^\t]*{ELAN_TIME}{{3}}\t[^\t]*"), "tier\tparticipant\tstart\tend\tduration\ttext"),
    (re.compile(rf"[^\t]+\t[^\t]*{ELAN_TIME}{{6}}\t[^\t]*"), "tier\tparticipant\t\tstart\t\tend\t\tduration\ttext"),
    (re.compile(r"[^,]*,\d*\.\d+,\d*\.\d+,.*"), "name,start,end,text"),
    (re.compile(r"\d*\.\d+,\d*\.\d+,.*"), "start,end,text"),
)
"""The first line of tables without a header, and theirs: of ELAN, of aeneas, of people."""
TIMIT_HZ, TIMIT_SUFFIXES, TIMIT_SILENCE = 16_000, (".phn", ".wrd"), "h#"
LONGEST_SAMPLES, LAST_SAMPLE = 50_000, 1e7
"""Most samples that the middle label, and those that a whole file, lasts: more are ticks."""


def parse_line_tiers(text: str, where: str) -> list[LabelTier] | None:
    """Return the labels of a text whose lines hold times, or None if they do not; the first line decides.

    HTK's lines are ``start end label`` in 100 ns (further columns are ignored), or ``start label``, where each label
    ends where the next one starts; Audacity's are ``start end label`` in seconds; TIMIT's in samples at 16 kHz.
    One time a line is that of the end under the header of ESPS, or where the first label is silence and ends after 0.
    Raises InputError: a later line is of another form, or has a time that is none; or starts that may be ends.
    """
    if esps := ESPS.match(text):
        return _read_points("\n" * esps[0].count("\n") + text[esps.end() :], where, ends=True)
    first = next((line for _, line in _lines(text)), "")
    if RTTM.match(first):
        raise InputError(f"{where}: is RTTM, which says who speaks and no words; give a transcript or labels")
    if SECONDS.fullmatch(first):
        return [_read_spans(text, SECONDS, where)]
    header = next((header for form, header in HEADLESS if form.fullmatch(first)), "")
    if columns := _find_columns(header or first):
        return _read_table(text, columns, where, header)
    for read in (_read_lrs, _read_wholes, _read_starts, _read_nist):
        tiers = read(text, first, where)
        if tiers is not None:
            return tiers
    return None


def _read_wholes(text: str, first: str, where: str) -> list[LabelTier] | None:
    """Return labels with whole numbers, if these are times: large, or in order and too far apart for seconds."""
    span = WHOLE.fullmatch(first)
    if span is None:
        return None
    matches = [WHOLE.fullmatch(line) for _, line in islice(_lines(text), 1000)]
    spans = [(int(match[1]), int(match[2])) for match in matches if match and len(match[1]) < 15 > len(match[2])]
    in_order = len(matches) == len(spans) > 2 and all(a <= b for a, b in spans) and spans == sorted(spans)
    long = in_order and median(end - start for start, end in spans) > LONG_SPAN
    return [_read_spans(text, WHOLE, where)] if long or float(span[2]) >= SHORTEST_TICKS else None


def _read_starts(text: str, first: str, where: str) -> list[LabelTier] | None:
    """Return labels that each last to the next one, or from the one before, in ticks or seconds."""
    point, lines = POINTS.fullmatch(first), [line for _, line in islice(_lines(text), MAX_LABELS + 1)]
    last = POINTS.fullmatch(lines[-1]) if point and len(lines) > 1 else None
    if point is None or last is None:
        return None
    late, in_seconds = float(point[1]) > 0, "." in point[1]
    if not (all(map(POINTS.fullmatch, lines)) if in_seconds else float(last[1]) >= SHORTEST_TICKS):
        return None
    if in_seconds and late and classify_label(point[2]) is not SpokenAs.SILENCE:
        problem = f"has one time a line, {point[1]} in the first"
        raise InputError(f"{where}: {problem}, which may be its start or its end; required: start end label in each")
    return _read_points(text, where, ends=in_seconds and late)


def _read_points(text: str, where: str, *, ends: bool) -> list[LabelTier]:
    """Return the labels of lines with one time: their ends, else their starts."""
    rows = list(_match_lines(text, POINTS, "end label" if ends else "start label", where))
    per_s = 1 if any("." in time for _, (time, _) in rows) else TICKS_PER_S
    times_s = [require_time(time, f"line {number}", where) / per_s for number, (time, _) in rows]
    edges_s = [0.0, *times_s] if ends else [*times_s, math.inf]
    pairs = zip(edges_s, edges_s[1:], rows, strict=False)
    return [LabelTier("labels", tuple(TimedLabel(a, b, row[1], f"line {number}") for a, b, (number, row) in pairs))]


def _lines(text: str) -> Iterator[tuple[int, str]]:
    """Yield number and text of every line, except blank ones and Audacity's pitch ranges."""
    for number, line in enumerate(StringIO(text), 1):
        stripped = line.strip()
        if stripped and not stripped.startswith("\\"):
            yield number, stripped


def _match_lines(text: str, form: re.Pattern[str], wanted: str, where: str) -> Iterator[tuple[int, tuple[str, ...]]]:
    """Yield number and groups of every line. Raises InputError: one is of another form, or there are too many."""
    for count, (number, line) in enumerate(_lines(text), 1):
        check_count(count, where)
        match = form.fullmatch(line)
        if match is None and not (wanted.startswith("recording") and line.startswith(COMMENT)):
            raise InputError(f"{where}: line {number} is {shorten(line)!r}; required, as in line 1: {wanted}")
        if match is not None:
            yield number, tuple(group for group in match.groups(default="") if group or form is not SECONDS)


def _read_spans(text: str, form: re.Pattern[str], where: str) -> LabelTier:
    """Return the labels of lines with start and end, in seconds, samples, milliseconds or ticks."""
    labels = []
    for number, (start, end, *words) in _match_lines(text, form, "start end label", where):
        place = f"line {number}"
        start_s, end_s = (require_time(time, place, where) for time in (start, end))
        labels.append(TimedLabel(start_s, end_s, words[0].strip() if words else "", place))
    tier = LabelTier("labels", tuple(labels))
    if form is SECONDS:
        return parse_seconds([tier], where)[0]
    lengths = [label.end_s - label.start_s for label in labels if label.end_s > label.start_s]
    is_timit = Path(where).suffix.lower() in TIMIT_SUFFIXES or any(label.text == TIMIT_SILENCE for label in labels)
    short = bool(lengths) and median(lengths) < LONGEST_SAMPLES and labels[-1].end_s < LAST_SAMPLE
    if is_timit or not short:
        return parse_seconds([tier], where, TIMIT_HZ if short else TICKS_PER_S)[0]
    role = PHONE_LABELS if all(to_phone(label.text) for label in labels) else WORDS
    return parse_seconds([replace(tier, role=role)], where)[0]


def _read_nist(text: str, _: str, where: str) -> list[LabelTier] | None:
    """Return the words of a CTM or the lines of an STM in order of time, a tier for each channel or speaker."""
    first = next((line for _, line in _lines(text) if not line.startswith(COMMENT)), "")[:1000]
    matches = ((form, form.fullmatch(first)) for form in (STM, CTM))
    found = ((form, match) for form, match in matches if match and "." in match[3] + match[4])
    form = next((form for form, match in found if not re.match(rf"(?:{NUMBER})(?:\s|$)", match[5])), None)
    if form is None:
        return None
    wanted = "recording channel start duration word" if form is CTM else "recording channel speaker start end words"
    by_speaker: dict[str, list[TimedLabel]] = defaultdict(list)
    recording = ""
    for number, (name, speaker, start, end, words) in _match_lines(text, form, wanted, where):
        recording = recording or name
        if name != recording:
            names = f"{shorten(recording)!r} and {shorten(name)!r}"
            raise InputError(f"{where}: line {number}: words of two recordings, {names}; keep those of one")
        start_s, end_s = (require_time(time, f"line {number}", where) for time in (start, end))
        if form is CTM and end_s < 0:
            raise InputError(f"{where}: line {number}: a duration of {end_s:g} s, required 0 or more")
        end_s += start_s if form is CTM else 0.0
        by_speaker[speaker].append(TimedLabel(start_s, end_s, words, f"line {number}"))
    role = "" if form is CTM else LINES  # Kaldi writes phones in CTM, too
    several = len(by_speaker) > 1
    return [
        LabelTier(speaker, tuple(sorted(labels, key=lambda label: label.start_s)), role, speaker if several else "")
        for speaker, labels in by_speaker.items()
    ]


def _read_lrs(text: str, _: str, where: str) -> list[LabelTier] | None:
    """Return the words of a text of LRS: with times where it has a table ``WORD START END`` of seconds."""
    spoken, heading = LRS_TEXT.match(text), LRS_WORDS.search(text)
    if spoken is None:
        return None
    if heading is None:
        return [LabelTier("Text", (TimedLabel(math.nan, math.nan, spoken[1], "line 1"),), LINES)]
    rows = re.split(r"\n\s*\n", text[heading.start() :], maxsplit=1)[0]
    padded = "\n" * text.count("\n", 0, heading.start()) + re.sub(r"[ \t]+", "\t", rows)
    return _read_table(padded, _find_columns("WORD\tSTART\tEND"), where)


def _find_columns(line: str) -> dict[str, int]:
    """Return the columns of a table whose first line names a start, an end or a duration, and a text; else none."""
    if len(line) > 1000 or "\ufeff" in line:
        return {}
    names = [re.sub(r"[\s_]", "", UNIT_END.sub("", name.strip(' "').lower())) for name in re.split(r"[,;\t]", line)]
    columns = {kind: place for kind, known in COLUMNS.items() for place, name in enumerate(names) if name in known}
    return columns if {"start", "text"} <= columns.keys() and {"end", "duration"} & columns.keys() else {}


def _read_table(text: str, columns: dict[str, int], where: str, given: str = "") -> list[LabelTier]:
    """Return the tiers of a table, of the Montreal Forced Aligner or any; ``given``: its header."""
    header = given or next(line for _, line in _lines(text))
    delimiter = max(",;\t", key=header.count)
    kinds: dict[tuple[str, str], list[TimedLabel]] = defaultdict(list)
    named = re.split(r"[,;\t]", header)[columns["text"]].strip(' "').lower()
    named = "" if named in ("text", "label") else named
    for number, line in islice(_lines(text), 0 if given else 1, None):
        check_count(number, where)
        place = f"line {number}"
        try:
            fields = next(csv.reader([line], delimiter=delimiter))
            fields += [""] if columns["text"] == len(fields) else []  # of a line that is empty
            known = {kind: at for kind, at in columns.items() if at < len(fields) or kind != "speaker"}
            row = {kind: fields[column] for kind, column in known.items()}
            times = (row["start"], row.get("end") or row["duration"])
        except (ValueError, IndexError, KeyError, csv.Error) as error:
            raise InputError(f"{where}: {place} is {shorten(line)!r}; required, as in line 1: {header}") from error
        start_s, end_s = (require_time(time, place, where) for time in times)
        end_s += 0.0 if row.get("end") else start_s
        kinds[(row.get("kind", named), row.get("speaker", ""))].append(TimedLabel(start_s, end_s, row["text"], place))
    tiers = [find_tier(kind, labels, speaker) for (kind, speaker), labels in kinds.items()]
    whole = all(label.start_s % 1 == 0 == label.end_s % 1 for tier in tiers for label in tier.labels)
    return parse_seconds(tiers, where, 1000 if whole and header == "start\tend\ttext" else 0)  # Whisper's
