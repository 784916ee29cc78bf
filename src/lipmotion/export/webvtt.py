"""Words, or phones, in time as WebVTT: subtitles that browsers, players and video editors open.

Source: W3C, "WebVTT: The Web Video Text Tracks Format".
"""

from __future__ import annotations

from pathlib import Path

from lipmotion.storage.files import whole_file
from lipmotion.types import Timeline, Unit
from lipmotion.units import is_silent, words_in_time

VTT_SUFFIX = ".vtt"
PHONES_VTT_SUFFIX = ".phones.vtt"
"""A file whose name ends so holds phones, not words."""
_ESCAPES = {"&": "&amp;", "<": "&lt;", ">": "&gt;"}


def write_webvtt(path: Path, units: Timeline[Unit]) -> None:
    """Write the words in time, or the phones where the name ends with ``.phones.vtt``, one a cue; silence has none.

    Words are those of ``units.words_in_time``. After a failure there is no partial file.
    Raises ExportError: the file cannot be written.
    """
    if path.name.lower().endswith(PHONES_VTT_SUFFIX):
        spoken = [span for span in units if not is_silent(span.label.phone)]
        cues = [(span.start_s, span.end_s, span.label.phone or span.label.unit) for span in spoken]
    else:
        cues = [(span.start_s, span.end_s, span.label) for span in words_in_time(units) if span.label]
    lines = ["WEBVTT", ""]
    for start_s, end_s, text in cues:
        lines += [f"{_time(start_s)} --> {_time(end_s)}", "".join(_ESCAPES.get(letter, letter) for letter in text), ""]
    with whole_file(path) as temporary:
        temporary.write_text("\n".join(lines), encoding="utf-8", newline="\n")


def _time(seconds: float) -> str:
    """Return a time as ``HH:MM:SS.mmm``."""
    thousandths = round(seconds * 1000)
    minutes, rest = divmod(thousandths, 60_000)
    return f"{minutes // 60:02d}:{minutes % 60:02d}:{rest // 1000:02d}.{rest % 1000:03d}"
