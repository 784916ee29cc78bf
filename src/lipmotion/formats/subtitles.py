"""Subtitles: SubRip (``.srt``), WebVTT (``.vtt``), SubStation Alpha (``.ass``, ``.ssa``), YouTube's ``.sbv``, lyrics
(``.lrc``), SubViewer, MicroDVD, MPL2 and TMPlayer (``.sub``, ``.txt``), and what Whisper's programs print."""

from __future__ import annotations

import logging
import math
import re
from collections.abc import Iterator
from dataclasses import replace
from io import StringIO
from pathlib import Path

from lipmotion.errors import InputError, shorten
from lipmotion.formats.label_tiers import LINES, LabelTier, TimedLabel, check_count, require_time
from lipmotion.storage.files import atomic_file
from lipmotion.types import Timeline, Unit
from lipmotion.types.values import parse_clock
from lipmotion.units import group_words, is_silent
from lipmotion.units.spelling import read_patterns
from lipmotion.units.spoken_text import extract_spoken_text, find_speaker_names

LOG = logging.getLogger("lipmotion")
MARKS = read_patterns(Path(__file__).with_name("subtitles.tsv"))
"""Patterns of lines and their times, by their names in the table."""
FRAME_RATES = (24, 25, 30, 50, 60)
BRIDGE_S, BRIDGES_SHARE, NEAR_S = 0.1, 0.2, 0.1
"""Captions that scroll repeat each line, and between them are bridges shorter than this; if so large a share of cues
of a file are bridges, lines that the cue before, which ends so near, showed already are left out."""
DEFAULT_FIELDS = "layer start end style name marginl marginr marginv effect text".split()
"""The fields of a line where no line ``Format:`` says them."""
PHONES = ".phones"  # a file whose name ends so before its suffix, as ``talk.phones.vtt``, holds phones, not words
_ESCAPES = str.maketrans({"&": "&amp;", "<": "&lt;", ">": "&gt;"})


def is_subtitles(text: str) -> bool:
    """Return whether a text is a file of subtitles or lyrics."""
    begins = text.startswith("WEBVTT") or MARKS["COUNTED"].match(text) is not None
    return begins or any(MARKS[form].search(text) for form in ("SUBSTATION", "CUE", "SBV", "LYRICS"))


def convert_timecodes(text: str, where: str) -> str:
    """Return a text with clocks for its timecodes, and arrows between two at the start of a line, as in subtitles.

    Their rate is the lowest usual one that has all these frames, which a warning says (``where`` empty: nothing does).
    """
    text, count = MARKS["THOUSANDTHS"].subn(r"\1.\2", text)
    codes = MARKS["TIMECODE"].finditer(text)
    frames = [max(int(code[4]), 29 * (";" in code[0])) for code in codes]  # 29.97 drops frames
    rate = next((rate for rate in FRAME_RATES if rate > max(frames, default=0)), 0)
    if max(len(frames), count) < 2 or not rate:
        return text
    if where and frames:
        LOG.warning("%s: its times count frames, taken for %d a second; give seconds if that is wrong", where, rate)
    text = MARKS["TIMECODE"].sub(lambda code: f"{code[1]}:{code[2]}:{int(code[3]) + int(code[4]) / rate:06.3f}", text)
    named = MARKS["PREMIERE"].sub(r"\1 --> \2\n\3: ", text)
    return MARKS["TWO_CLOCKS"].sub(r"\1 --> \2\n", named)


def parse_subtitles(text: str, where: str) -> LabelTier:
    """Return the lines of subtitles, a cue each; words that have times of their own are parts of it.

    Left out are notes and styles, the repetitions of captions that scroll, and what stands before the first cue.
    Numbers of cues may be missing, and blank lines too.
    Raises InputError: times that are damaged or end before they start, with their line; too many cues or words; frames
    of an unknown rate; pictures.
    """
    text = _convert_counts(text, where) if MARKS["COUNTED"].match(text) else text
    is_dialogue = MARKS["SUBSTATION"].search(text) is not None
    read = _read_lyrics if MARKS["LYRICS"].search(text) else _read_dialogue if is_dialogue else _read_cues
    cues = list(read(text, where))
    if cues and (picture := MARKS["PICTURE"].fullmatch(cues[0].text.strip())):
        what = f"is a track of thumbnails ({cues[0].position} shows {shorten(picture[0])}), which are no words"
        raise InputError(f"{where}: {what}; give the subtitles")
    labels = (replace(cue, parts=_split_words(cue)) for cue in _drop_repetitions(cues))
    return LabelTier("subtitles", tuple(labels), LINES)


def _convert_counts(text: str, where: str) -> str:
    """Return lines that begin with counts of frames or tenths of a second with times instead, as those of lyrics."""
    stated = MARKS["RATE"].match(text)
    if text[0] == "{" and not stated:
        problem = "is MicroDVD, whose times are in frames, and says no rate"
        raise InputError(f"{where}: {problem}; required: frames a second in the first line, as {{1}}{{1}}25.000")

    def time_line(line: re.Match[str]) -> str:
        per_s = float(stated[1].replace(",", ".")) if stated and line[1] == "{" else 10.0
        edges = [line[5]] if line[5] else [clock(int(edge) / per_s, ".") for edge in line.group(2, 3) if edge]
        return f"[{' -> '.join(edges)}]" + (line[4] or "").replace("|", " ")

    return MARKS["COUNTED"].sub(time_line, MARKS["RATE"].sub("", text, count=1) if stated else text)


def strip_markup(text: str) -> str:
    """Return what is said of subtitles as a text. Raises InputError: as ``parse_subtitles``."""
    lines = [label.text for label in parse_subtitles(text, "the text").labels]
    names = find_speaker_names(lines)
    return "\n".join(extract_spoken_text(MARKS["WORD_TIME"].sub("", line), names) for line in lines)


def _read_lyrics(text: str, where: str) -> Iterator[TimedLabel]:
    """Yield the lines of lyrics in order, each to the next; several times before a line repeat it."""
    cues: list[TimedLabel] = []
    if re.search(r"\[\d\d:\d\d:[6-9]\d\]", text):  # hundredths
        text = re.sub(r"\[(\d\d:\d\d):(\d\d)\]", r"[\1.\2]", text)
    offset = re.search(r"\[offset:\s?([+-]?\d{1,7})\s?\]", text)
    early_s = int(offset[1]) / 1000 if offset else 0.0
    for number, row in enumerate(StringIO(text), 1):
        line = row.strip()
        timed = MARKS["LYRICS_LINE"].fullmatch(line)
        if timed is None:
            if cues and not re.fullmatch(MARKS["LYRICS_TAG"], line):
                cues[-1] = replace(cues[-1], text=f"{cues[-1].text}\n{line}")
            continue
        for time in MARKS["LYRICS_TIME"].finditer(timed[1]):
            check_count(len(cues), where)
            place = f"line {number}"
            edges_s = [require_time(edge, place, where) - early_s for edge in (time[1] or time[2], time[3]) if edge]
            cues.append(TimedLabel(max(edges_s[0], 0.0), (*edges_s, math.inf)[1], line[timed.end(1) :], place))
    cues.sort(key=lambda cue: cue.start_s)
    for cue, end_s in zip(cues, [*(cue.start_s for cue in cues[1:]), math.inf], strict=True):
        yield replace(cue, end_s=end_s if math.isinf(cue.end_s) else cue.end_s)


def _read_cues(text: str, where: str) -> Iterator[TimedLabel]:
    cue, lines, count = None, list[str](), 0
    for number, row in enumerate(StringIO(text), 1):
        line = MARKS["LOOSE"].sub(r"\1", row.rstrip("\r\n")) if "-->" in row else row.rstrip("\r\n")
        times = (MARKS["TIMES"].fullmatch(line) or MARKS["SBV"].fullmatch(line)) if ":" in line else None
        if times is None and (MARKS["CUE"].match(line) or MARKS["NO_ARROW"].match(line)):
            wanted = "00:00:01,000 --> 00:00:02,500"
            raise InputError(f"{where}: line {number} is {shorten(line.strip())!r}; required times as in {wanted}")
        if times is None:
            lines.append(line)
            continue
        if cue is not None:
            yield replace(cue, text=_join_shown(lines))
        count += 1
        check_count(count, where)
        cue, lines = TimedLabel(parse_clock(times[1]), parse_clock(times[2]), "", f"line {number}"), []
    if cue is not None:
        yield replace(cue, text=_join_shown([*lines, "", ""]))


def _join_shown(lines: list[str]) -> str:
    """Return the lines that a cue shows, of all up to the times of the next one: without that one's name, and notes."""
    blank = [number for number, line in enumerate(lines) if not line]
    if lines and (lines[-1].strip().isdecimal() or (blank and blank[-1] == len(lines) - 2)):
        lines = lines[:-1]  # the number or the name of the next cue
    parts: list[str] = []
    hidden = False
    for before, line in zip(["-", *lines], lines, strict=False):
        hidden = (hidden and bool(line)) or (not before and MARKS["NO_CUE"].match(line) is not None)
        if line.strip() and not hidden:
            parts.append(line)
    return "\n".join(parts)


def _drop_repetitions(cues: list[TimedLabel]) -> list[TimedLabel]:
    """Return cues without the lines that captions that scroll repeat."""
    untimed = ([" ".join(MARKS["WORD_TIME"].sub("", line).split()) for line in cue.text.split("\n")] for cue in cues)
    plain = [tuple(extract_spoken_text(line).strip() for line in lines) for lines in untimed]
    bridges = sum(
        cue.end_s - cue.start_s < BRIDGE_S and shown[-len(lines) :] == lines
        for cue, lines, shown in zip(cues[1:], plain[1:], plain, strict=False)
    )
    if bridges < max(BRIDGES_SHARE * len(cues), 1):
        return cues
    shortened_cues = cues[:1]
    for before, cue, shown, lines in zip(cues, cues[1:], plain, plain[1:], strict=False):
        longest = min(len(lines), len(shown)) if cue.start_s <= before.end_s + NEAR_S else 0
        repeated = next((n for n in range(longest, 0, -1) if shown[-n:] == lines[:n]), 0)
        shortened_cues.append(replace(cue, text="\n".join(cue.text.split("\n")[repeated:])))
    return shortened_cues


def _split_words(cue: TimedLabel) -> tuple[TimedLabel, ...]:
    """Return the words of a cue with times, where these stand between them."""
    text = cue.text
    marks = list(MARKS["WORD_TIME"].finditer(text))
    if not marks:
        return ()
    edges = [0, *(mark.end() for mark in marks)]
    ends = [*(mark.start() for mark in marks), len(text)]
    times_s = [cue.start_s, *(min(max(parse_clock(mark[1]), cue.start_s), cue.end_s) for mark in marks), cue.end_s]
    return tuple(
        TimedLabel(start_s, max(start_s, end_s), text[first:end], cue.position)
        for first, end, start_s, end_s in zip(edges, ends, times_s, times_s[1:], strict=False)
    )


def _read_dialogue(text: str, where: str) -> Iterator[TimedLabel]:
    """Yield the dialogue of SubStation Alpha, without drawings and tags of styles (``{\\an8}``, ``{\\i1}``)."""
    fields, in_events = DEFAULT_FIELDS, True
    for number, row in enumerate(StringIO(text), 1):
        line = row.strip()
        name, _, rest = line.partition(":")
        if line.startswith("["):
            in_events = line.lower() == "[events]"
        elif in_events and name.lower() == "format":
            fields = [field.strip().lower() for field in rest.split(",")]
        elif in_events and name.lower() == "dialogue":
            check_count(number, where)
            values = rest.split(",", maxsplit=len(fields) - 1)
            by_name = dict(zip(fields, values, strict=False))
            start, end = (re.fullmatch(MARKS["TIME"], by_name.get(edge, "").strip()) for edge in ("start", "end"))
            if start is None or end is None or len(values) < len(fields):
                wanted = "Dialogue: 0,0:00:01.00,0:00:02.50,Default,,0,0,0,,Words"
                raise InputError(f"{where}: line {number} is {shorten(line)!r}; required a line as {wanted}")
            shown, drawing = "", False
            for place, part in enumerate(MARKS["STYLES"].split(by_name.get("text", values[-1]))):
                modes = MARKS["DRAWING_MODE"].findall(part) if place % 2 else []  # of a tag
                drawing = modes[-1] != "0" if modes else drawing
                shown += "" if drawing or place % 2 else part
            times = (parse_clock(start[1]), parse_clock(end[1]))
            yield TimedLabel(*times, MARKS["BREAK"].sub("\n", shown), f"line {number}")


def clock(seconds: float, mark: str) -> str:
    """Return a time as ``HH:MM:SS.mmm``; ``mark``: what stands before the thousandths."""
    minutes, rest = divmod(round(seconds * 1000), 60_000)
    return f"{minutes // 60:02d}:{minutes % 60:02d}:{rest // 1000:02d}{mark}{rest % 1000:03d}"


def write_subtitles(path: Path, units: Timeline[Unit]) -> None:
    """Write the words in time as SubRip or WebVTT, or the phones where the name ends with ``.phones.srt``, one a cue.

    Words are those of ``units.group_words``; silence has no cue. After a failure there is no partial file.
    Raises ExportError: the file cannot be written.
    """
    cues = [(span.start_s, span.end_s, span.label) for span in group_words(units) if span.label]
    if path.stem.lower().endswith(PHONES):
        spoken = [span for span in units if not is_silent(span.label.phone)]
        cues = [(span.start_s, span.end_s, span.label.phone or span.label.unit) for span in spoken]
    if path.suffix.lower() == ".srt":
        lines = [f"{n}\n{clock(a, ',')} --> {clock(b, ',')}\n{text}\n\n" for n, (a, b, text) in enumerate(cues, 1)]
    else:
        blocks = (f"\n{clock(a, '.')} --> {clock(b, '.')}\n{text.translate(_ESCAPES)}\n" for a, b, text in cues)
        lines = ["WEBVTT\n", *blocks]
    with atomic_file(path) as temporary:
        temporary.write_text("".join(lines), encoding="utf-8", newline="\n")
