"""Checks that a plain text holds words alone, not labels, subtitles or markup."""

from __future__ import annotations

import re
from collections.abc import Iterator
from io import StringIO
from itertools import islice

from lipmotion.corpora.labels.subtitles import NO_ARROW, is_subtitles
from lipmotion.corpora.labels.textgrid import is_textgrid
from lipmotion.corpora.labels.timed_lines import line_tiers
from lipmotion.errors import InputError, shortened

MASTER = "#!MLF!#"
"""The start of HTK's master label files, which hold the labels of many recordings."""
MARKUP = re.compile(r'\{\\rtf|<[!?a-zA-Z]|\{\s*"|\[\s*[\[{]')
"""The start of RTF, HTML, XML and JSON."""
JUDGED_LINES = 1000
"""Lines of a text that are judged for whether they hold times."""
NUMBERED = re.compile(r"[-+.]?\d|nan\b|[-+]?inf\b")
TIME = re.compile(r"(?<![\w.])(?:\d*\.\d+|\d{5,})(?![\w.])")
"""Seconds with decimals, or a number that counts parts of a second."""


def check_plain_text(text: str, where: str) -> None:
    """Raise InputError unless a text is words alone: times and marks of labels and subtitles would be read as words.

    where : the file's name, for messages
    """
    if is_textgrid(text) or line_tiers(text, where) is not None:
        raise InputError(f"{where}: holds labels in time, required the words alone; write them into a text file")
    check_no_labels(text, where)


def check_no_labels(text: str, where: str) -> None:
    """Raise InputError for labels, subtitles and documents in forms that are not read."""
    start = text[:200].lstrip()
    if "\0" in text:
        raise InputError(f"{where}: holds NUL characters: is it UTF-16 without its mark? save it as UTF-8 text")
    if start.startswith(MASTER):
        raise InputError(f"{where}: is a master label file of many recordings; write a .lab beside each")
    if MARKUP.match(start):
        raise InputError(f"{where}: begins with {shortened(start[:20])!r}, required the words alone; save it as text")
    if is_subtitles(text):
        raise InputError(f"{where}: is a file of subtitles, required the words alone; write them into a text file")
    found = NO_ARROW.search(text)
    if found:
        raise InputError(
            f"{where}: has the line {shortened(found[0].strip())!r}, two times as in subtitles; required: times as in "
            "00:00:01,000 --> 00:00:02,500, or the words alone"
        )
    if _seems_timed(text):
        raise InputError(
            f"{where}: its lines hold times, but not as in a TextGrid, HTK's or Audacity's labels; save it in one of "
            "these forms, or give the words alone"
        )


def _seems_timed(text: str) -> bool:
    """Return whether most of the first lines begin with a number and some with a time, or half hold two times."""
    lines = numbered = timed = with_two = 0
    for line in islice(_body(text), JUDGED_LINES):
        lines += 1
        numbered += NUMBERED.match(line) is not None
        times = sum(1 for _, _ in zip(TIME.finditer(line), "12", strict=False))
        timed += TIME.match(line) is not None
        with_two += times > 1
    return lines > 1 and ((2 * numbered > lines and timed > 0) or 2 * with_two >= lines)


def _body(text: str) -> Iterator[str]:
    """Yield the lines that are not blank; of a file with a header, as of ESPS, those after the header."""
    header = re.search(r"^#$", text[:2000], re.MULTILINE)
    for line in StringIO(text[header.end() if header else 0 :]):
        if line.strip():
            yield line.strip()
