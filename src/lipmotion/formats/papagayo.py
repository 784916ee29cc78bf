"""``pgo``: a project of Papagayo, version 1: phrases, words and Preston Blair's shapes in frames, to be edited there.

Source: what Papagayo and Papagayo-NG write and read. Frames count from 0; a shape lasts to the next one of its word or
to the word's last frame, which is included; outside of words the mouth is at rest.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from dataclasses import replace
from itertools import islice, takewhile

from lipmotion.articulation.cue_sheets import (
    CueSheet,
    build_cue_sheet,
    choose_chart,
    list_frame_shapes,
    parse_cue_time,
    parse_shape,
)
from lipmotion.errors import InputError, shorten
from lipmotion.printable import is_line, printable
from lipmotion.types import Span, Timeline
from lipmotion.units.phones import REST, SHAPES

MARK = "lipsync version 1"
FASTEST_FPS = 1000
WHOLE_RATE_TOLERANCE = 0.01
"""A rate that is so little over a whole one counts as that."""
UNKNOWN = "speech"
"""The text of speech without known words."""
Part = tuple[int, int, str]
"""First frame, last frame (included), and text."""


def project_text(sheet: CueSheet, sound_file: str) -> str:
    """Return the content of the file: one voice; a phrase lasts from rest to rest.

    Papagayo knows whole frame rates alone: of another one, frames are those of the next larger whole rate (30 for
    29.97) at the same times, so that they do not drift from the sound.
    """
    sheet = replace(sheet, fps=float(math.ceil(sheet.fps - WHOLE_RATE_TOLERANCE)))
    shown = list_frame_shapes(sheet)
    moving = [False, *(shape != REST for shape in shown), False]
    starts = [frame for frame in range(len(shown)) if moving[frame + 1] and not moving[frame]]
    ends = [frame for frame in range(len(shown)) if moving[frame + 1] and not moving[frame + 2]]
    phrases = [find_words_of_run(sheet, first, last) for first, last in zip(starts, ends, strict=True)]
    texts = [" ".join(word for *_, word in phrase) for phrase in phrases]
    lines = [MARK, _one_line(" ".join(sound_file.split())) or "sound.wav", f"{sheet.fps:.0f}", f"{len(shown)}"]
    lines += ["1", "\tVoice 1", f"\t{'|'.join(texts)}", f"\t{len(phrases)}"]
    for phrase, words in zip(phrases, texts, strict=True):
        lines += [f"\t\t{words}", f"\t\t{phrase[0][0]}", f"\t\t{phrase[-1][1]}", f"\t\t{len(phrase)}"]
        for first, last, word in phrase:
            changes = [frame for frame in range(first, last + 1) if frame == first or shown[frame] != shown[frame - 1]]
            lines.append(f"\t\t\t{word} {first} {last} {len(changes)}")
            lines += [f"\t\t\t\t{frame} {SHAPES[shown[frame]].blair}" for frame in changes]
    return "\n".join(lines) + "\n"


def find_words_of_run(sheet: CueSheet, first: int, last: int) -> list[Part]:
    """Return the words from one frame to another, each with at least one frame, without gaps.

    What is said in less than a frame is joined to the word before by a hyphen.
    """
    parts: list[Part] = []
    spans = sheet.words.spans
    begin = bisect_left(spans, first, key=lambda span: int(span.end_s * sheet.fps))
    for span in takewhile(lambda span: int(span.start_s * sheet.fps) <= last, islice(spans, begin, None)):
        start = int(span.start_s * sheet.fps)
        start = first if not parts else max(start, first)
        word = _one_line("".join(span.label.split())) or UNKNOWN
        if parts and start <= parts[-1][0]:
            parts[-1] = (parts[-1][0], last, f"{parts[-1][2]}-{word}")
            continue
        if parts:
            parts[-1] = (parts[-1][0], start - 1, parts[-1][2])
        parts.append((start, last, word))
    return parts or [(first, last, UNKNOWN)]


def _one_line(text: str) -> str:
    """Return a text without what ends a line here: ``|``, or control characters, which are shown as escapes."""
    text = text.replace("|", "/")
    return text if is_line(text) else printable(text)


class _Lines:
    """The lines of a file, one after another, with their numbers."""

    def __init__(self, text: str) -> None:
        self._lines, self.number = text.splitlines(), 0

    @property
    def place(self) -> str:
        return f"line {self.number}"

    def next(self) -> str:
        """Return the next line. Raises InputError: there is none."""
        self.number += 1
        if self.number > len(self._lines):
            raise InputError(f"the project ends after line {self.number - 1}; save it again in Papagayo")
        return self._lines[self.number - 1].strip()

    def count(self) -> int:
        """Return the number on the next line. Raises InputError: it is none."""
        return int(parse_cue_time(self.next(), self.place))


def parse_project(text: str) -> CueSheet:
    """Return the cues and the words of a project: those of its first voice.

    Raises InputError: not a project of version 1, cut short, or a shape that is none, with its line.
    """
    lines = _Lines(text)
    if lines.next() != MARK:
        raise InputError(f"not a project of Papagayo: the first line is no {MARK!r}; save it again")
    lines.next()
    fps, frames, voices = (lines.count() for _ in range(3))
    if not 1 <= fps <= FASTEST_FPS or not voices:
        raise InputError(
            f"{voices} voices at {fps} frames a second, required one, at 1 to {FASTEST_FPS}; save it again"
        )
    lines.next()
    lines.next()
    shapes: list[tuple[float, str, str]] = []
    words: list[Span[str]] = []
    for _ in range(lines.count()):
        for _ in range(3):
            lines.next()
        for _ in range(lines.count()):
            line = lines.next()
            fields = line.rsplit(maxsplit=3)
            if len(fields) != 4:
                wanted = "a word, its frames and the number of its shapes"
                raise InputError(f"{lines.place} is {shorten(line)!r}, required {wanted}")
            first, last, count = (int(parse_cue_time(field, lines.place)) for field in fields[1:])
            words.append(Span(first / fps, (last + 1) / fps, fields[0]))
            for _ in range(count):
                frame, _, name = lines.next().partition(" ")
                shapes.append((parse_cue_time(frame, lines.place) / fps, name, lines.place))
            shapes.append(((last + 1) / fps, "", ""))
    chart = choose_chart(name for _, name, _ in shapes if name)
    rows = [(start_s, parse_shape(name, chart, place) if name else REST) for start_s, name, place in shapes]
    lasting = [row for row, after in zip(rows, [*rows[1:], (math.inf, "")], strict=False) if row[0] < after[0]]
    return build_cue_sheet(lasting, frames / fps, float(fps), Timeline(tuple(words)))
