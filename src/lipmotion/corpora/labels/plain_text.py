"""Files that would pass as plain text, but hold more than words."""

from __future__ import annotations

import re
from collections.abc import Iterator
from io import StringIO
from itertools import islice

from lipmotion.corpora.labels.textgrid import is_textgrid
from lipmotion.corpora.labels.timed_lines import parse_timed_lines
from lipmotion.errors import InputError, shortened

MASTER = "#!MLF!#"
"""How the HTK files begin that hold the labels of many recordings."""
MARKUP = re.compile(r'\{\\rtf|<[!?a-zA-Z]|\{\s*"|\[\s*[\[{]')
"""How word processors' files, HTML, XML and JSON begin."""
CUE = re.compile(r"^.{0,40}\d\s*-->\s*\d", re.MULTILINE)
"""The times of a subtitle."""
LINES_JUDGED = 1000
"""Lines of a text that tell whether it holds times."""
NUMBERED = re.compile(r"[-+.]?\d|nan\b|[-+]?inf\b")
TIME = re.compile(r"(?<![\w.])(?:\d*\.\d+|\d{5,})(?![\w.])")
"""Seconds with decimals, or a number that counts parts of a second."""


def check_plain_text(text: str, where: str) -> None:
    """Raise InputError unless a text is words alone: what stands in labels and subtitles besides would be read as such.

    where : the file's name, for messages
    """
    if is_textgrid(text) or parse_timed_lines(text, where) is not None:
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
    if CUE.search(text):
        raise InputError(f"{where}: is a file of subtitles, required the words alone; write them into a text file")
    if _seems_timed(text):
        raise InputError(
            f"{where}: its lines hold times, but not as in a TextGrid, HTK's or Audacity's labels; save it in one of "
            "these forms, or give the words alone"
        )


def _seems_timed(text: str) -> bool:
    """Whether most of the first lines begin with a number, some with a time, or every other one holds two times."""
    lines = numbered = timed = twice = 0
    for line in islice(_body(text), LINES_JUDGED):
        lines += 1
        numbered += NUMBERED.match(line) is not None
        times = sum(1 for _, _ in zip(TIME.finditer(line), "12", strict=False))
        timed += TIME.match(line) is not None
        twice += times > 1
    return lines > 1 and ((2 * numbered > lines and timed > 0) or 2 * twice >= lines)


def _body(text: str) -> Iterator[str]:
    """Give the lines that are not blank; of a file with a header, as ESPS writes it, those after its end."""
    header = re.search(r"^#$", text[:2000], re.MULTILINE)
    for line in StringIO(text[header.end() if header else 0 :]):
        if line.strip():
            yield line.strip()
