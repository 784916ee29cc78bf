"""Files of labels in time: the format is chosen by the suffix."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from lipmotion.errors import ExportError, shortened
from lipmotion.export.subrip import SRT_SUFFIX, write_subrip
from lipmotion.export.textgrid import TEXTGRID_SUFFIX, write_textgrid
from lipmotion.export.webvtt import VTT_SUFFIX, write_webvtt
from lipmotion.printable import is_line
from lipmotion.types import Timeline, Unit

_WRITERS: dict[str, Callable[[Path, Timeline[Unit]], None]] = {
    TEXTGRID_SUFFIX: write_textgrid,
    VTT_SUFFIX: write_webvtt,
    SRT_SUFFIX: write_subrip,
}
LABEL_SUFFIXES = tuple(_WRITERS)
"""Suffixes of label files, as programs write them; capitals do not matter."""


def write_labels(path: Path, units: Timeline[Unit]) -> None:
    """Write phones and words in time in the format of the suffix.

    Raises ExportError: a label that is no line of text, or the file cannot be written.
    """
    for label in [span.label for span in units]:
        if not is_line(label.phone + label.unit + label.word):
            raise ExportError(
                f"{path}: {shortened(repr(label))} has a line end, a control character or half a character"
            )
    write = next(write for suffix, write in _WRITERS.items() if suffix.lower() == path.suffix.lower())
    write(path, units)
