"""Labels in time, one a line: of HTK, Audacity, TIMIT, ESPS, NIST's CTM and STM, tables with a header, texts of LRS."""

from __future__ import annotations

import csv
import math
import re
from collections import defaultdict
from dataclasses import replace
from io import StringIO
from pathlib import Path
from statistics import median

from lipmotion.errors import InputError, shorten
from lipmotion.formats.label_tiers import (
    LINES,
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
from lipmotion.storage.sources import read_shipped_table
from lipmotion.units.spelling import read_patterns
from lipmotion.units.spoken_text import SpokenAs, classify_label

SHORTEST_TICKS = 10_000  # whole numbers below a millisecond are no ticks at sight: "20 30 people" is a sentence
LONG_SPAN = 45  # Whole numbers in order that are further apart than this are no seconds
MARKS = read_patterns(Path(__file__).with_name("timed_lines.tsv"))
"""Patterns of lines and their times, by their names in the table."""
COMMENT = (";;", "#")
COLUMNS = {row["column"]: {*row["names"].split()} for row in read_shipped_table(__package__, "label_columns.csv")}
"""Names of columns of tables: of the Montreal Forced Aligner, of Praat, of people."""
HEADLESS = {name.replace(" ", "\t"): form for name, form in MARKS.items() if "start" in name}
"""The first line of tables without a header, by theirs: of ELAN, of aeneas, of people."""
TIMIT_HZ, TIMIT_SUFFIXES, TIMIT_SILENCE = 16_000, (".phn", ".wrd"), "h#"
LONGEST_SAMPLES, LAST_SAMPLE = 50_000, 1e7
"""Most samples that the middle label, and those that a whole file, lasts: more are ticks."""

Lines = list[tuple[int, str]]  # lines that are not blank, with their numbers


def parse_line_tiers(text: str, where: str) -> list[LabelTier] | None:
    """Return the labels of a text whose lines hold times, or None if they do not; the first line decides.

    HTK's lines are ``start end label`` in 100 ns (further columns are ignored), or ``start label``, where each label
    ends where the next one starts; Audacity's are ``start end label`` in seconds; TIMIT's in samples at 16 kHz.
    One time a line is that of the end under the header of ESPS, or where the first label is silence and ends after 0.
    Raises InputError: a later line is of another form, or has a time that is none; or starts that may be ends.
    """
    text = re.sub(r"\A\t(?=\S)", "#\t", re.sub(r"\A\ufeff?sep=.[ \t\r]*\n", "\n", text))  # Excel's, pandas'
    text = MARKS["MARKERS"].sub(r"\1text", text)
    if esps := MARKS["ESPS"].match(text):
        return _read_points(_list_lines("\n" * esps[0].count("\n") + text[esps.end() :]), where, ends=True)
    lines = _list_lines(text)
    first = lines[0][1] if lines else ""
    if MARKS["RTTM"].match(first):
        raise InputError(f"{where}: is RTTM, which says who speaks and no words; give a transcript or labels")
    if MARKS["SECONDS"].fullmatch(first):
        return parse_seconds(_read_form(lines, MARKS["SECONDS"], where), where)
    header = next((header for header, form in HEADLESS.items() if form.fullmatch(first)), "")
    if columns := _find_columns(header or first):
        return _read_table(lines, columns, where, header)
    if MARKS["LRS_TEXT"].match(text):
        return _read_lrs(text, where)
    tiers = (read(lines, where) for read in (_read_wholes, _read_starts, _read_nist) if lines)
    return next((each for each in tiers if each is not None), None)


def _list_lines(text: str) -> Lines:
    """Return number and text of every line, except blank ones and Audacity's pitch ranges."""
    stripped = ((number, line.strip()) for number, line in enumerate(StringIO(text), 1))
    return [(number, line) for number, line in stripped if line and not line.startswith("\\")]


def _read_form(lines: Lines, form: re.Pattern[str], where: str, role: str = "") -> list[LabelTier]:
    """Return the labels of lines of one form, as their times stand; a tier in order for each channel or speaker."""
    check_count(len(lines), where)
    by_speaker: dict[str, list[TimedLabel]] = defaultdict(list)
    recording = ""
    for number, line in lines:
        place, match = f"line {number}", form.fullmatch(line)
        if match is None:
            names = " ".join(sorted(form.groupindex, key=form.groupindex.__getitem__)).replace("text", "label")
            raise InputError(f"{where}: {place} is {shorten(line)!r}; required, as in line 1: {names}")
        fields = match.groupdict(default="")
        recording = recording or fields.get("recording", "")
        if fields.get("recording", "") != recording:
            names = f"{shorten(recording)!r} and {shorten(fields['recording'])!r}"
            raise InputError(f"{where}: {place}: words of two recordings, {names}; keep those of one")
        start, end = (require_time(fields.get(name, "0"), place, where) for name in ("start", "end"))
        if "duration" in fields:
            end = start + require_time(fields["duration"], place, where)
            if end < start:
                raise InputError(f"{where}: {place}: a duration of {end - start:g} s, required 0 or more")
        by_speaker[fields.get("speaker", "")].append(TimedLabel(start, end, fields["text"].strip(), place))
    several = len(by_speaker) > 1
    in_time = {who: tuple(sorted(labels, key=lambda label: label.start_s)) for who, labels in by_speaker.items()}
    if "recording" not in form.groupindex:
        return [LabelTier("labels", tuple(by_speaker[""]))]
    return [LabelTier(who, labels, role, who if several else "") for who, labels in in_time.items()]


def _read_nist(lines: Lines, where: str) -> list[LabelTier] | None:
    spoken = [line for line in lines if not line[1].startswith(COMMENT)]
    first = spoken[0][1][:1000] if spoken else ""
    matches = ((MARKS[name], MARKS[name].fullmatch(first)) for name in ("STM", "CTM"))
    fitting = ((form, match) for form, match in matches if match and "." in match[3] + match[4])
    form = next((form for form, match in fitting if not MARKS["BEGINS_NUMBER"].match(match["text"])), None)
    role = "" if form is MARKS["CTM"] else LINES  # Kaldi writes phones in CTM, too
    return form and _read_form(spoken, form, where, role)


def _read_wholes(lines: Lines, where: str) -> list[LabelTier] | None:
    """Return labels in ticks, samples or milliseconds, if whole numbers are times: large, or in order and far apart."""
    matches = [MARKS["WHOLE"].fullmatch(line) for _, line in lines[:1000]]
    spans = [(int(match[1]), int(match[2])) for match in matches if match and len(match[1]) < 15 > len(match[2])]
    in_order = len(matches) == len(spans) > 2 and all(a <= b for a, b in spans) and spans == sorted(spans)
    long = in_order and median(end - start for start, end in spans) > LONG_SPAN
    if matches[0] is None or not (long or float(matches[0][2]) >= SHORTEST_TICKS):
        return None
    (tier,) = _read_form(lines, MARKS["WHOLE"], where)
    lengths = [label.end_s - label.start_s for label in tier.labels if label.end_s > label.start_s]
    is_timit = Path(where).suffix.lower() in TIMIT_SUFFIXES or any(each.text == TIMIT_SILENCE for each in tier.labels)
    short = bool(lengths) and median(lengths) < LONGEST_SAMPLES and tier.labels[-1].end_s < LAST_SAMPLE
    if is_timit or not short:
        return parse_seconds([tier], where, TIMIT_HZ if short else TICKS_PER_S)
    role = PHONE_LABELS if all(to_phone(label.text) for label in tier.labels) else WORDS
    return [replace(each, role="") for each in parse_seconds([replace(tier, role=role)], where)]


def _read_starts(lines: Lines, where: str) -> list[LabelTier] | None:
    """Return labels that each last to the next one, or from the one before, in ticks or seconds."""
    first, last = MARKS["POINTS"].fullmatch(lines[0][1]), MARKS["POINTS"].fullmatch(lines[-1][1])
    if first is None or last is None or len(lines) < 2:
        return None
    late, in_seconds = float(first[1]) > 0, "." in first[1]
    are_points = (MARKS["POINTS"].fullmatch(line) for _, line in lines)
    if not (all(are_points) if in_seconds else float(last[1]) >= SHORTEST_TICKS):
        return None
    if in_seconds and late and classify_label(first[2]) is not SpokenAs.SILENCE:
        problem = f"has one time a line, {first[1]} in the first"
        raise InputError(f"{where}: {problem}, which may be its start or its end; required: start end label in each")
    return _read_points(lines, where, ends=in_seconds and late)


def _read_points(lines: Lines, where: str, *, ends: bool) -> list[LabelTier]:
    """Return the labels of lines with one time: their ends, else their starts."""
    (tier,) = _read_form(lines, MARKS["POINTS"], where)
    per_s = 1 if any("." in line.split()[0] for _, line in lines) else TICKS_PER_S
    times_s = [label.start_s / per_s for label in tier.labels]
    edges_s = [0.0, *times_s] if ends else [*times_s, math.inf]
    pairs = zip(tier.labels, edges_s, edges_s[1:], strict=False)
    return [replace(tier, labels=tuple(replace(each, start_s=a, end_s=b) for each, a, b in pairs))]


def _read_lrs(text: str, where: str) -> list[LabelTier]:
    """Return the words of a text of LRS: with times where it has a table ``WORD START END`` of seconds."""
    heading = MARKS["LRS_WORDS"].search(text)
    if heading is None:
        words = text.strip().splitlines()[0].partition(":")[2].strip()
        return [LabelTier("Text", (TimedLabel(math.nan, math.nan, words, "line 1"),), LINES)]
    rows = re.split(r"\n\s*\n", text[heading.start() :], maxsplit=1)[0]
    padded = "\n" * text.count("\n", 0, heading.start()) + re.sub(r"[ \t]+", "\t", rows)
    return _read_table(_list_lines(padded), _find_columns("WORD\tSTART\tEND"), where)


def _find_columns(line: str) -> dict[str, int]:
    """Return the columns of a table whose first line names a start, an end or a duration, and a text; else none."""
    if len(line) > 1000 or "\ufeff" in line:
        return {}
    plain = (name.strip(' "').lower() for name in re.split(r"[,;\t]", line))
    names = [re.sub(r"[\s_]", "", MARKS["UNIT_END"].sub("", name)) for name in plain]
    columns = {kind: place for kind, known in COLUMNS.items() for place, name in enumerate(names) if name in known}
    return columns if {"start", "text"} <= columns.keys() and {"end", "duration"} & columns.keys() else {}


def _read_table(lines: Lines, columns: dict[str, int], where: str, known_header: str = "") -> list[LabelTier]:
    """Return the tiers of a table, of the Montreal Forced Aligner or any; ``known_header``: of one that has none."""
    header = known_header or lines[0][1]
    delimiter = max(",;\t", key=header.count)
    kinds: dict[tuple[str, str], list[TimedLabel]] = defaultdict(list)
    named = re.split(r"[,;\t]", header)[columns["text"]].strip(' "').lower()
    named = "" if named in ("text", "label") else named
    if "frame" in re.split(r"[,;\t]", header)[columns["start"]].lower():
        raise InputError(f"{where}: its times are frames, whose rate is not known; required seconds")
    check_count(len(lines), where)
    joined: Lines = []  # a text in quotes may have line ends
    for number, line in lines[0 if known_header else 1 :]:
        first, before = joined.pop() if joined and joined[-1][1].count('"') % 2 else (number, "")
        joined.append((first, f"{before} {line}".strip()))
    for number, line in joined:
        place = f"line {number}"
        try:
            fields = next(csv.reader([line], delimiter=delimiter))
            fields += [""] if columns["text"] == len(fields) else []  # of a line that is empty
            if columns["text"] == header.count(delimiter):  # in the last column, a text without quotes
                fields[columns["text"] :] = [delimiter.join(fields[columns["text"] :])]
            known = {kind: at for kind, at in columns.items() if at < len(fields) or kind != "speaker"}
            row = {kind: fields[column] for kind, column in known.items()}
            times = (row["start"], row.get("end") or row["duration"])
        except (ValueError, IndexError, KeyError, csv.Error) as error:
            raise InputError(f"{where}: {place} is {shorten(line)!r}; required, as in line 1: {header}") from error
        start_s, end_s = (require_time(time, place, where) for time in times)
        end_s += 0.0 if row.get("end") else start_s
        kinds[(row.get("kind", named), row.get("speaker", ""))].append(TimedLabel(start_s, end_s, row["text"], place))
    tiers = [find_tier(kind, labels, speaker) for (kind, speaker), labels in kinds.items()]
    all_whole = all(label.start_s % 1 == 0 == label.end_s % 1 for tier in tiers for label in tier.labels)
    return parse_seconds(tiers, where, 1000 if all_whole and header == "start\tend\ttext" else 0)  # Whisper's
