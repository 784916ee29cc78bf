"""Lists of words in time, one a line: NIST's CTM, and the texts of the lip-reading corpora LRS2 and LRS3."""

from __future__ import annotations

import re
from io import StringIO

from lipmotion.corpora.labels.tier import SILENCES, check_count, required_time
from lipmotion.errors import InputError, shortened
from lipmotion.types import TimedTranscript, TimedWord, TranscriptLine, in_order
from lipmotion.units.spoken_text import check_word_count, lines_by_pauses, spoken_text, timed_words

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,3})?|nan|inf"
LINE = re.compile(rf"(\S+)\s+(\S+)\s+({NUMBER})\s+({NUMBER})\s+(\S+)(?:\s+(?:{NUMBER}|NA))?(?:\s.*)?")
"""Recording, channel, start and duration in seconds, word, confidence."""
COMMENT = (";;", "#")
LRS_TEXT = re.compile(r"\s*Text:[ \t]+(\S.*)")
"""The first line of a text of LRS: what is said."""
LRS_WORDS = re.compile(r"^WORD[ \t]+START[ \t]+END\b.*$", re.MULTILINE)
LRS_WORD = re.compile(rf"(\S+)\s+({NUMBER})\s+({NUMBER})(?:\s.*)?")


def is_ctm(text: str) -> bool:
    """Return whether the first line that is no comment is one of a CTM, with a decimal fraction for a time."""
    first = next((line for row in StringIO(text) if (line := row.strip()) and not line.startswith(COMMENT)), "")
    found = LINE.fullmatch(first) if len(first) < 1000 else None
    return found is not None and "." in found[3] + found[4] and not re.fullmatch(NUMBER, found[5])


def parse_ctm(text: str, where: str) -> TimedTranscript:
    """Return the words of a CTM, in order of time; lines are made of words without a pause between them.

    where : the file's name, for messages
    Raises InputError: a line of another form, or with a time that is none (with its number), or several recordings.
    """
    words: list[tuple[float, list[TimedWord]]] = []
    recording, count = None, 0
    for number, row in enumerate(StringIO(text), 1):
        line = row.strip()
        if not line or line.startswith(COMMENT):
            continue
        check_count(len(words), where)
        found = LINE.fullmatch(line)
        if found is None:
            wanted = "recording channel start duration word"
            raise InputError(f"{where}: line {number} is {shortened(line)!r}; required, as in line 1: {wanted}")
        recording = recording or found[1]
        if found[1] != recording:
            names = f"{shortened(recording)!r} and {shortened(found[1])!r}"
            raise InputError(f"{where}: line {number}: words of two recordings, {names}; keep those of one")
        start_s, duration_s = (required_time(time, f"line {number}", where) for time in found.group(3, 4))
        if duration_s < 0:
            raise InputError(f"{where}: line {number}: a duration of {duration_s:g} s, required 0 or more")
        if found[5].lower() not in SILENCES:
            words.append((start_s, timed_words(spoken_text(found[5]), start_s, start_s + duration_s, where)))
            count += len(words[-1][1])
            check_word_count(count, where)
    words.sort(key=lambda item: item[0])
    return in_order(lines_by_pauses([word for _, several in words for word in several]))


def is_lrs(text: str) -> bool:
    """Return whether the first line is that of a text of LRS: ``Text:  WORDS IN CAPITALS``."""
    return LRS_TEXT.match(text) is not None


def parse_lrs(text: str, where: str) -> TimedTranscript:
    """Return the words of a text of LRS: with times where it has a table ``WORD START END`` of seconds.

    where : the file's name, for messages
    Raises InputError: a line of the table of another form, or with a time that is none (with its number).
    """
    heading = LRS_WORDS.search(text)
    if heading is None:
        said = LRS_TEXT.match(text)
        words = timed_words(spoken_text(said[1] if said else ""), where=where)
        return TimedTranscript((TranscriptLine(tuple(words)),) if words else ())
    first = text.count("\n", 0, heading.end()) + 2
    timed: list[TimedWord] = []
    for number, row in enumerate(StringIO(text[heading.end() :].lstrip("\r\n")), first):
        if not row.strip():
            break
        found = LRS_WORD.fullmatch(row.strip())
        if found is None:
            raise InputError(f"{where}: line {number} is {shortened(row.strip())!r}; required: word start end")
        start_s, end_s = (required_time(time, f"line {number}", where) for time in found.group(2, 3))
        if end_s < start_s:
            raise InputError(
                f"{where}: line {number} ends at {end_s:g} s, before its start at {start_s:g} s; correct it"
            )
        timed += timed_words(spoken_text(found[1]), start_s, end_s, where)
        check_word_count(len(timed), where)
    return in_order(lines_by_pauses(timed))
