"""Files that would pass as plain text, but hold more than words."""

from __future__ import annotations

import re

from lipmotion.corpora.labels.lines import timed_lines
from lipmotion.corpora.labels.textgrid import is_textgrid
from lipmotion.errors import InputError

MASTER = "#!MLF!#"
"""How the HTK files begin that hold the labels of many recordings."""
CUE = re.compile(r"^.{0,40}\d\s*-->\s*\d", re.MULTILINE)
"""The times of a subtitle."""
TIME = re.compile(r"[-+]?(?:\d*\.\d+|\d{5,})\s")
"""What a line of text does not begin with, again and again."""
TIMED_SHARE = 0.75
"""Lines of which this share begin with a time are labels of some kind."""


def check_plain(text: str, where: str) -> None:
    """Raise InputError unless a text is words alone: what stands in labels and subtitles besides would be read as such.

    where : the file's name, for messages
    """
    if is_textgrid(text) or timed_lines(text, where) is not None:
        raise InputError(f"{where}: holds labels in time, required the words alone; write them into a text file")
    check_other_labels(text, where)


def check_other_labels(text: str, where: str) -> None:
    """Raise InputError for labels and subtitles in forms that are not read."""
    if "\0" in text:
        raise InputError(f"{where}: holds NUL characters: is it UTF-16 without its mark? save it as UTF-8 text")
    if text.lstrip().startswith(MASTER):
        raise InputError(f"{where}: is a master label file of many recordings; write a .lab beside each")
    if CUE.search(text):
        raise InputError(f"{where}: is a file of subtitles, required the words alone; write them into a text file")
    lines = [line for line in text.splitlines() if line.strip()]
    if len(lines) > 1 and sum(TIME.match(line.lstrip()) is not None for line in lines) >= TIMED_SHARE * len(lines):
        raise InputError(
            f"{where}: its lines begin with times, but not as in a TextGrid, HTK's or Audacity's labels: line 1 is "
            f"{lines[0][:60]!r}; save it in one of these forms, or give the words alone"
        )
