"""Words, or phones, in time as WebVTT: subtitles that browsers, players and video editors open.

Source: W3C, "WebVTT: The Web Video Text Tracks Format".
"""

from __future__ import annotations

from pathlib import Path

from lipmotion.export.shown_labels import clock, shown_labels
from lipmotion.storage.files import whole_file
from lipmotion.types import Timeline, Unit

VTT_SUFFIX = ".vtt"
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
