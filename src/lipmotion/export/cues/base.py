"""Cue files, by format."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from lipmotion.errors import ExportError
from lipmotion.export.cues import moho_dat, papagayo_pgo, rhubarb_json, rhubarb_tsv, rhubarb_xml, spine_json
from lipmotion.export.cues.sheet import CueSheet
from lipmotion.storage.files import whole_file

CUE_FORMATS: dict[str, Callable[[CueSheet, str], str]] = {
    "tsv": rhubarb_tsv.text,
    "xml": rhubarb_xml.text,
    "json": rhubarb_json.text,
    "dat": moho_dat.text,
    "pgo": papagayo_pgo.text,
    "spine.json": spine_json.text,
}
"""Cues and the name of the recording → the text of a file, by format; a file's suffix is its format's name, of
several the longest."""


def format_of(path: Path) -> str:
    """Return the format of a file's suffix. Raises ExportError: no format has this suffix."""
    ends = [name for name in CUE_FORMATS if path.name.lower().endswith(f".{name}")]
    if not ends:
        known = " ".join(f".{known}" for known in CUE_FORMATS)
        raise ExportError(f"{path}: unknown cue format {path.suffix!r}; required one of: {known}")
    return max(ends, key=len)


def write_cue_file(path: Path, sheet: CueSheet, sound_file: str, form: str) -> None:
    """Write cues to a file; after a failure there is no partial file. Raises ExportError: it cannot be written."""
    with whole_file(path) as temporary:
        temporary.write_text(CUE_FORMATS[form](sheet, sound_file), encoding="utf-8", newline="\n")
