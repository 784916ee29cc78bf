"""SubStation Alpha subtitles (``.ass``, ``.ssa``): the dialogue that they show, as cues."""

from __future__ import annotations

import re
from collections.abc import Iterator
from io import StringIO

from lipmotion.corpora.labels.cue import CLOCK, SubtitleCue, checked_cue, clock_seconds
from lipmotion.corpora.labels.tier import check_count
from lipmotion.errors import InputError, shortened

HEADER = re.compile(r"\s*\[Script Info\]", re.IGNORECASE)
"""The start of such a file."""
DIALOGUE = re.compile(rf"^Dialogue:[^,\n]{{0,40}},\s*{CLOCK}\s*,\s*{CLOCK}\s*,", re.MULTILINE)
"""The start of a line that is shown: its layer, its start, its end. Editors may save the lines without the header."""
FORMAT_LINE, DIALOGUE_LINE = "format:", "dialogue:"
DEFAULT_FIELDS = "layer start end style name marginl marginr marginv effect text".split()
"""The fields of a line where no line ``Format:`` says them."""
TAGS = re.compile(r"(\{[^{}]{0,200}\})")
DRAWING_MODE = re.compile(r"\\p(\d)")
"""Begins a drawing (``{\\p1}``) or ends it (``{\\p0}``): the numbers in between are no words."""
BREAK = re.compile(r"\\[Nnh]")
"""Line breaks and hard blanks within the text."""


def is_substation(text: str) -> bool:
    """Return whether a text is a file of SubStation Alpha."""
    return HEADER.match(text) is not None or DIALOGUE.search(text) is not None


def substation_cues(text: str, where: str) -> Iterator[SubtitleCue]:
    """Yield the dialogue of a file, without drawings; comments, styles and what else it holds are left out.

    The tags of styles (``{\\an8}``, ``{\\i1}``) stay in the text: ``spoken_text`` takes them out, as of all subtitles.
    where : the file's name, for messages
    Raises InputError: a line of dialogue with too few fields, times that are none, or an end before the start, with its
    line; too many lines.
    """
    fields, in_events = DEFAULT_FIELDS, True
    for number, row in enumerate(StringIO(text), 1):
        line = row.strip()
        if line.startswith("["):
            in_events = line.lower() == "[events]"
        elif in_events and line.lower().startswith(FORMAT_LINE):
            fields = [name.strip().lower() for name in line[len(FORMAT_LINE) :].split(",")]
        elif in_events and line.lower().startswith(DIALOGUE_LINE):
            check_count(number, where)
            yield _cue(line, number, fields, where)


def _cue(line: str, number: int, fields: list[str], where: str) -> SubtitleCue:
    """Return one line of dialogue; the text is the last field, and may hold commas."""
    values = line[len(DIALOGUE_LINE) :].split(",", maxsplit=len(fields) - 1)
    by_name = dict(zip(fields, values, strict=False))
    start, end = (re.fullmatch(CLOCK, by_name.get(name, "").strip()) for name in ("start", "end"))
    if start is None or end is None or len(values) < len(fields):
        wanted = "Dialogue: 0,0:00:01.00,0:00:02.50,Default,,0,0,0,,Words"
        raise InputError(f"{where}: line {number} is {shortened(line)!r}; required a line as {wanted}")
    shown = BREAK.sub("\n", _without_drawings(by_name.get("text", values[-1])))
    cue = SubtitleCue(number, clock_seconds(start, 1), clock_seconds(end, 1), tuple(shown.split("\n")))
    return checked_cue(cue, where)


def _without_drawings(text: str) -> str:
    """Return a text without drawings and without tags."""
    shown, drawing = [], False
    for number, part in enumerate(TAGS.split(text)):
        if number % 2:  # a tag
            modes = DRAWING_MODE.findall(part)
            drawing = modes[-1] != "0" if modes else drawing
        elif not drawing:
            shown.append(part)
    return "".join(shown)
