"""Subtitles: SubRip (``.srt``), WebVTT (``.vtt``), SubStation (``.ass``), and Whisper's table of lines (``.tsv``)."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from io import StringIO

from lipmotion.corpora.labels.cue import CLOCK, SubtitleCue, checked_cue, clock_seconds
from lipmotion.corpora.labels.substation import is_substation, substation_cues
from lipmotion.corpora.labels.tier import check_count
from lipmotion.errors import InputError, shortened
from lipmotion.types import TimedTranscript, TimedWord, TranscriptLine, in_order
from lipmotion.units.spoken_text import check_word_count, line_words, speaker_names, spoken_text, timed_words

ARROW = r"(?:(?:[-=–—−]\s?){1,3}(?:[>›»]|&gt;)|→)"
"""The arrow between the times, also as people and programs damage it: ``->``, ``- ->``, ``–>``, ``--&gt;``."""
CUE = re.compile(
    rf"^.{{0,40}}\d\s*-->\s*\d|^.{{0,20}}:\d{{1,2}}(?:[.,]\d{{1,6}})?\s{{0,4}}{ARROW}\s{{0,4}}\d{{1,4}}:\d",
    re.MULTILINE,
)
"""The times of a subtitle."""
FULL_CLOCK = r"(?:\d{1,4}:\d{1,2}:\d{1,2}(?:[.,]\d{1,6})?|\d{1,2}:\d{1,2}[.,]\d{1,6})"
NO_ARROW = re.compile(rf"^\s{{0,20}}{FULL_CLOCK}[^\w\n]{{1,12}}{FULL_CLOCK}\s{{0,20}}$", re.MULTILINE)
"""A line of two times without an arrow that is known; times of day, as 5:30, do not count."""
TIMES = re.compile(rf"\s*{CLOCK}\s*{ARROW}\s*{CLOCK}(?:\s.*)?")
WORD_TIME = re.compile(rf"<{CLOCK}>")
"""The time at which the words after it are said, as in the captions that YouTube makes."""
NO_CUE = re.compile(r"(?:NOTE|STYLE|REGION)(?:\s|$)")
"""The start of a block of WebVTT that is not shown."""
HEADER = "start\tend\ttext"
"""The first line of Whisper's table; times are in milliseconds."""
ROW = re.compile(r"(\d{1,12})\t(\d{1,12})\t(.*)")
BRIDGE_S, BRIDGES_SHARE, NEAR_S = 0.1, 0.2, 0.1
"""Captions that scroll repeat each line, and between them are bridges shorter than this; if so large a share of cues
of a file are bridges, lines that the cue before, which ends so near, showed already are left out."""


def is_subtitles(text: str) -> bool:
    """Return whether a text is a file of subtitles, or Whisper's table of lines."""
    begins = text.startswith(("WEBVTT", HEADER))
    return begins or is_substation(text) or CUE.search(text) is not None


def parse_subtitles(text: str, where: str) -> TimedTranscript:
    """Return the words of subtitles; every cue is a line.

    Left out are tags, descriptions of sounds, names of speakers (``spoken_text``), notes and styles, the repetitions of
    captions that scroll, and what stands before the first cue. Numbers of cues may be missing, and blank lines too.
    where : the file's name, for messages
    Raises InputError: times that are damaged or end before they start, with their line; too many cues or words.
    """
    cues = list(_all_cues(text, where))
    names = speaker_names("\n".join(cue.lines) for cue in cues)
    lines, count = [], 0
    for cue in _without_repetitions(cues):
        words = _words(cue, names, f"{where}: line {cue.number}")
        count += len(words)
        check_word_count(count, where)
        lines.append(TranscriptLine(tuple(words), cue.start_s, cue.end_s))
    return in_order(lines)


def _all_cues(text: str, where: str) -> Iterator[SubtitleCue]:
    if text.startswith(HEADER):
        return _rows(text, where)
    return substation_cues(text, where) if is_substation(text) else _cues(text, where)


def _cues(text: str, where: str) -> Iterator[SubtitleCue]:
    cue, lines, count = None, list[str](), 0
    for number, row in enumerate(StringIO(text), 1):
        line = row.rstrip("\r\n")
        times = TIMES.fullmatch(line) if ":" in line else None
        if times is None and (CUE.match(line) or NO_ARROW.match(line)):
            wanted = "00:00:01,000 --> 00:00:02,500"
            raise InputError(f"{where}: line {number} is {shortened(line.strip())!r}; required times as in {wanted}")
        if times is None:
            lines.append(line)
            continue
        if cue is not None:
            yield replace(cue, lines=_shown(lines))
        count += 1
        check_count(count, where)
        cue, lines = checked_cue(SubtitleCue(number, clock_seconds(times, 1), clock_seconds(times, 5), ()), where), []
    if cue is not None:
        yield replace(cue, lines=_shown([*lines, "", ""]))


def _shown(lines: list[str]) -> tuple[str, ...]:
    """Return the lines that a cue shows, of all up to the times of the next one: without that one's name, and notes."""
    blank = [number for number, line in enumerate(lines) if not line]
    if lines and (lines[-1].strip().isdecimal() or (blank and blank[-1] == len(lines) - 2)):
        lines = lines[:-1]  # the number or the name of the next cue
    shown: list[str] = []
    hidden = False
    for before, line in zip(["-", *lines], lines, strict=False):
        hidden = (hidden and bool(line)) or (not before and NO_CUE.match(line) is not None)
        if line.strip() and not hidden:
            shown.append(line)
    return tuple(shown)


def _rows(text: str, where: str) -> Iterator[SubtitleCue]:
    """Yield the rows of Whisper's table as cues."""
    for number, row in enumerate(StringIO(text), 1):
        line = row.rstrip("\r\n")
        if number == 1 or not line.strip():
            continue
        check_count(number, where)
        found = ROW.fullmatch(line)
        if found is None:
            raise InputError(f"{where}: line {number} is {shortened(line)!r}; required: start, end and text, with tabs")
        yield checked_cue(SubtitleCue(number, int(found[1]) / 1000, int(found[2]) / 1000, (found[3],)), where)


def _without_repetitions(cues: list[SubtitleCue]) -> list[SubtitleCue]:
    """Return cues without the lines that captions that scroll repeat."""
    plain = [tuple(" ".join(WORD_TIME.sub("", line).split()) for line in cue.lines) for cue in cues]
    plain = [tuple(spoken_text(line).strip() for line in lines) for lines in plain]
    bridges = sum(
        cue.end_s - cue.start_s < BRIDGE_S and shown[-len(lines) :] == lines
        for cue, lines, shown in zip(cues[1:], plain[1:], plain, strict=False)
    )
    if bridges < BRIDGES_SHARE * len(cues) or bridges < 2:
        return cues
    kept = cues[:1]
    for before, cue, shown, lines in zip(cues, cues[1:], plain, plain[1:], strict=False):
        near = cue.start_s <= before.end_s + NEAR_S
        kept.append(replace(cue, lines=cue.lines[_repeated(shown, lines) if near else 0 :]))
    return kept


def _repeated(shown: tuple[str, ...], lines: tuple[str, ...]) -> int:
    """Return how many of the first lines are the last ones that were shown before."""
    return next((n for n in range(min(len(lines), len(shown)), 0, -1) if shown[-n:] == lines[:n]), 0)


def _words(cue: SubtitleCue, names: frozenset[str], where: str) -> list[TimedWord]:
    """Return the words of a cue, with times where these stand between them."""
    text = "\n".join(cue.lines)
    if WORD_TIME.search(text) is None:
        return [TimedWord(word) for word in line_words(spoken_text(text, names), where)]
    marks = list(WORD_TIME.finditer(text))
    edges = [0, *(mark.end() for mark in marks)]
    ends = [*(mark.start() for mark in marks), len(text)]
    times_s = [cue.start_s, *(min(max(clock_seconds(mark, 1), cue.start_s), cue.end_s) for mark in marks), cue.end_s]
    return [
        word
        for first, end, start_s, end_s in zip(edges, ends, times_s, times_s[1:], strict=False)
        for word in timed_words(spoken_text(text[first:end], names), start_s, max(start_s, end_s), where)
    ]
