"""What is said when in a long recording: the lines or words of a label file beside it, with their times."""

from __future__ import annotations

from pathlib import Path

from lipmotion.corpora.labels.label_files import each_labels_beside
from lipmotion.types import Span, TimedTranscript

Line = Span[tuple[str, ...]]
"""Words that are said from ``start_s`` to ``end_s``."""


def lines_in_time(recording: Path) -> list[Line]:
    """Return the lines in time of the first file beside a recording that has any; none if there is no such file.

    Read are the files that ``labels_beside`` reads: subtitles, what recognisers write, TextGrids and labels with times
    (HTK, Audacity); a label is a line, whether it holds one word or many. Lines that overlap are one. Those without a
    word, or without start and end, are left out. Raises InputError: a file cannot be read.
    """
    for _, labels in each_labels_beside(recording):
        lines = _lines(labels.transcript) if labels.transcript else []
        if lines:
            return lines
    return []


def _lines(transcript: TimedTranscript) -> list[Line]:
    lines: list[Line] = []
    for line in transcript.lines:
        start_s, end_s = line.start_s, line.end_s
        if start_s is None or end_s is None or end_s <= max(start_s, 0.0):
            continue
        words = tuple(word.word for word in line.words)
        if lines and start_s < lines[-1].end_s:
            before = lines.pop()
            lines.append(Span(before.start_s, max(before.end_s, end_s), before.label + words))
        else:
            lines.append(Span(max(start_s, 0.0), end_s, words))
    return lines
