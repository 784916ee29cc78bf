"""Files of labels in time: the format is chosen by the suffix."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from lipmotion.errors import ExportError, shortened
from lipmotion.printable import is_line
from lipmotion.storage.files import whole_file
from lipmotion.types import Timeline, Unit
from lipmotion.units import RECOGNISED, is_silent, recognised_phones, words_in_time

PHONES = ".phones"
"""A file whose name ends so before its suffix, as ``talk.phones.vtt``, holds phones, not words."""


def shown_labels(path: Path, units: Timeline[Unit]) -> list[tuple[float, float, str]]:
    """Return start, end and text of each word, or of each phone where the name of the file asks for them; no silence.

    Words are those of ``units.words_in_time``.
    """
    if path.stem.lower().endswith(PHONES):
        spoken = [span for span in units if not is_silent(span.label.phone)]
        return [(span.start_s, span.end_s, span.label.phone or span.label.unit) for span in spoken]
    return [(span.start_s, span.end_s, span.label) for span in words_in_time(units) if span.label]


def clock(seconds: float, mark: str) -> str:
    """Return a time as ``HH:MM:SS.mmm``; ``mark``: what stands before the thousandths."""
    thousandths = round(seconds * 1000)
    minutes, rest = divmod(thousandths, 60_000)
    return f"{minutes // 60:02d}:{minutes % 60:02d}:{rest // 1000:02d}{mark}{rest % 1000:03d}"


def write_subrip(path: Path, units: Timeline[Unit]) -> None:
    """Write the words in time, or the phones where the name ends with ``.phones.srt``, one a cue; silence has none.

    After a failure there is no partial file. Raises ExportError: the file cannot be written.
    """
    lines: list[str] = []
    for number, (start_s, end_s, text) in enumerate(shown_labels(path, units), 1):
        lines += [f"{number}", f"{clock(start_s, ',')} --> {clock(end_s, ',')}", text, ""]
    with whole_file(path) as temporary:
        temporary.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8", newline="\n")


_ESCAPES = {"&": "&amp;", "<": "&lt;", ">": "&gt;"}


def write_webvtt(path: Path, units: Timeline[Unit]) -> None:
    """Write the words in time, or the phones where the name ends with ``.phones.vtt``, one a cue; silence has none.

    After a failure there is no partial file. Raises ExportError: the file cannot be written.
    """
    lines = ["WEBVTT", ""]
    for start_s, end_s, text in shown_labels(path, units):
        shown = "".join(_ESCAPES.get(letter, letter) for letter in text)
        lines += [f"{clock(start_s, '.')} --> {clock(end_s, '.')}", shown, ""]
    with whole_file(path) as temporary:
        temporary.write_text("\n".join(lines), encoding="utf-8", newline="\n")


TEXTGRID_SUFFIX = ".TextGrid"
"""As Praat writes it; case does not matter."""
Interval = tuple[float, float, str]
"""Start and end in seconds, and the text."""


def write_textgrid(path: Path, units: Timeline[Unit]) -> None:
    """Write phones in time to a TextGrid in long text form, with the tiers ``phones`` and ``words``.

    units : the phones; where a label has no phone, the name of its unit is written
    Words are those of ``units.words_in_time``. If phones were recognised, a third tier, ``recognised``, holds these
    with their confidence (``p 0.37``), so that a reader can tell them from corrected ones (``units.recognised``).
    Times are as exact as floats are. After a failure there is no partial file.
    Raises ExportError: the file cannot be written.
    Source: Praat manual, "TextGrid file formats".
    """
    phones = [(float(span.start_s), float(span.end_s), span.label.phone or span.label.unit) for span in units]
    words = [(float(span.start_s), float(span.end_s), span.label) for span in words_in_time(units)]
    tiers = [("phones", phones), ("words", words)]
    recognised = [
        (phone.start_s, phone.end_s, f"{phone.name} {phone.confidence}") for phone in recognised_phones(units)
    ]
    if recognised:
        tiers.append((RECOGNISED, recognised))
    end_s = max((float(span.end_s) for span in units), default=0.0)
    lines = ['File type = "ooTextFile"', 'Object class = "TextGrid"', "", "xmin = 0", f"xmax = {end_s}"]
    lines += ["tiers? <exists>", f"size = {len(tiers)}", "item []:"]
    for number, (name, intervals) in enumerate(tiers, 1):
        whole = _without_gaps(intervals, end_s)
        lines += [f"    item [{number}]:", '        class = "IntervalTier"', f'        name = "{name}"']
        lines += ["        xmin = 0", f"        xmax = {end_s}", f"        intervals: size = {len(whole)}"]
        for place, (start_s, stop_s, text) in enumerate(whole, 1):
            quoted = text.replace('"', '""')
            lines += [f"        intervals [{place}]:", f"            xmin = {start_s}", f"            xmax = {stop_s}"]
            lines.append(f'            text = "{quoted}"')
    with whole_file(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _without_gaps(intervals: list[Interval], duration_s: float) -> list[Interval]:
    """Return intervals from 0 s to the end that follow each other; what was a gap has no text. Praat requires that."""
    whole: list[Interval] = []
    end_s = 0.0
    for start_s, stop_s, text in intervals:
        if start_s > end_s:
            whole.append((end_s, start_s, ""))
        whole.append((end_s if start_s < end_s else start_s, stop_s, text))
        end_s = stop_s
    return [*whole, (end_s, duration_s, "")] if end_s < duration_s else whole


_WRITERS: dict[str, Callable[[Path, Timeline[Unit]], None]] = {
    TEXTGRID_SUFFIX: write_textgrid,
    ".vtt": write_webvtt,
    ".srt": write_subrip,
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
