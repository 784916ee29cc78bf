"""What is said when in a long recording: the lines or words of a label file beside it, with their times."""

from __future__ import annotations

from pathlib import Path

from lipmotion.corpora.labels.label_files import FOR_WORDS, LARGEST_LABELS
from lipmotion.corpora.labels.textgrid import is_textgrid, parse_interval_tiers
from lipmotion.corpora.labels.tier import LabelTier, holds_phones, is_named_as_words
from lipmotion.corpora.labels.timed_lines import parse_timed_lines
from lipmotion.errors import InputError
from lipmotion.storage.files import read_text_file
from lipmotion.types import Span
from lipmotion.units import words_of

Line = Span[tuple[str, ...]]
"""Words that are said from ``start_s`` to ``end_s``."""


def lines_in_time(recording: Path) -> list[Line]:
    """Return the lines in time of the first label file beside a recording that has any; none if there is no such file.

    Read are TextGrids and labels with times (HTK, Audacity); a label is a line, whether it holds one word or many.
    Labels without a word (silence, marks) are left out. Raises InputError: a file cannot be read.
    """
    for suffix in FOR_WORDS:
        path = recording.with_suffix(suffix)
        if path.is_file():
            lines = [line for line in map(_line, _labels(path)) if line is not None]
            if lines:
                return lines
    return []


def _labels(path: Path) -> list[tuple[float, float, str]]:
    """Return start, end and text of the labels that are not phones."""
    text = read_text_file(path, "label file", LARGEST_LABELS)
    if is_textgrid(text):
        tiers = parse_interval_tiers(text, str(path))
    else:
        timed = parse_timed_lines(text, str(path))
        tiers = [] if timed is None else [timed]
    words: list[LabelTier] = [tier for tier in tiers if not holds_phones(tier)]
    chosen = next(filter(is_named_as_words, words), words[0] if words else None)
    return [(label.start_s, label.end_s, label.text) for label in chosen.labels] if chosen else []


def _line(label: tuple[float, float, str]) -> Line | None:
    start_s, end_s, text = label
    try:
        words = words_of(text)
    except InputError:
        return None
    return Span(start_s, end_s, words) if end_s > start_s else None
