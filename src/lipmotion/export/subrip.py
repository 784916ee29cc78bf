"""Words, or phones, in time as SubRip: subtitles that players and video editors open.

Source: the files of SubRip 1.20: a number, two times with commas, the text, a blank line.
"""

from __future__ import annotations

from pathlib import Path

from lipmotion.export.shown_labels import clock, shown_labels
from lipmotion.storage.files import whole_file
from lipmotion.types import Timeline, Unit

SRT_SUFFIX = ".srt"


def write_subrip(path: Path, units: Timeline[Unit]) -> None:
    """Write the words in time, or the phones where the name ends with ``.phones.srt``, one a cue; silence has none.

    After a failure there is no partial file. Raises ExportError: the file cannot be written.
    """
    lines: list[str] = []
    for number, (start_s, end_s, text) in enumerate(shown_labels(path, units), 1):
        lines += [f"{number}", f"{clock(start_s, ',')} --> {clock(end_s, ',')}", text, ""]
    with whole_file(path) as temporary:
        temporary.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8", newline="\n")
