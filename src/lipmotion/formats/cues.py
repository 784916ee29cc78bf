"""Cue files by format, cues as motion (phones in time, and curves that faces draw), and cues for Spine.

Every shape becomes one phone with its mouth, and an opening and a width, which the lips reach and leave as those of
phones (``articulation.phone_targets``). So p, b and m stay closed, and lips and tongue follow from the phones.

``spine.json``: a skeleton of Spine 4 with one slot, ``mouth``, whose attachments, one a shape, an animation changes.
Source: Esoteric Software, "JSON export format" (Spine 4.2). The slot, its attachments and the animation ``speech`` can
be taken into a skeleton of one's own; the pictures are ``A.png`` to ``X.png`` beside the file.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lipmotion.articulation.contact import gap_to_opening
from lipmotion.articulation.cue_sheets import CueSheet
from lipmotion.articulation.lip_points import build_mouth
from lipmotion.articulation.phone_targets import crossfade_phones
from lipmotion.errors import ExportError, InputError
from lipmotion.formats import papagayo, rhubarb
from lipmotion.printable import is_line
from lipmotion.storage.files import atomic_file
from lipmotion.storage.json_text import as_json
from lipmotion.storage.sources import read_text_file
from lipmotion.types import Channel, Motion, Span, Timeline, Unit
from lipmotion.units import SILENCE
from lipmotion.units.phones import REST, SHAPES

VERSION, SLOT, ANIMATION = "4.2.0", "mouth", "speech"
PIXELS = 256
"""Width and height of a mouth until Spine has its picture."""


def write_skeleton(sheet: CueSheet, sound_file: str) -> str:
    """Return the content of the file, in ASCII; the last key is the end, with the shape at rest."""
    shapes = {shape: {"width": PIXELS, "height": PIXELS} for shape in sheet.drawn}
    moved: dict[str, Any] = {
        "slots": {SLOT: {"attachment": [{"time": round(time_s, 2), "name": shape} for time_s, shape in sheet.rows]}}
    }
    document: dict[str, Any] = {
        "skeleton": {"spine": VERSION, "images": "./"},
        "bones": [{"name": "root"}],
        "slots": [{"name": SLOT, "bone": "root", "attachment": sheet.rest}],
        "skins": [{"name": "default", "attachments": {SLOT: shapes}}],
    }
    if sound_file:
        document["events"] = {ANIMATION: {"audio": sound_file}}
        moved["events"] = [{"time": 0, "name": ANIMATION}]
    return as_json({**document, "animations": {ANIMATION: moved}}, indent=1) + "\n"


class CueFormat(NamedTuple):
    """How one kind of cue file is written and read.

    text  : cues and the name of the recording → the text of a file
    parse : the text of a file → its cues, or raises InputError; None: the format is not read
    """

    text: Callable[[CueSheet, str], str]
    parse: Callable[[str], CueSheet] | None = None


CUE_FORMATS = {
    "tsv": CueFormat(rhubarb.format_tsv, rhubarb.parse_tsv),
    "xml": CueFormat(rhubarb.format_xml, rhubarb.parse_xml),
    "json": CueFormat(rhubarb.json_text, rhubarb.parse_json),
    "dat": CueFormat(rhubarb.format_dat, rhubarb.parse_dat),
    "pgo": CueFormat(papagayo.project_text, papagayo.parse_project),
    "spine.json": CueFormat(write_skeleton),
}
"""Formats by name; the end of a file's name is that of its format, of several the longest."""
PHONE_OF = {"A": "p", "B": "s", "C": "eh", "D": "aa", "E": "ao", "F": "uw", "G": "f", "H": "l", "X": SILENCE}
"""A phone with the mouth of each shape."""
SHAPE_OF = {phone: shape for shape, phone in PHONE_OF.items()}
RATE_HZ = 100.0
FASTEST_FPS = 1000.0
WIDEST_GAP = 0.25
"""The gap between the lips of a shape whose opening is 1, in eye distances: that of wide vowels of typical talkers."""
WIDENING = 0.12
"""By how much the mouth is wider than at rest where the spread of a shape is 1, as a share."""
LARGEST_BYTES = 1 << 24


def format_of(path: Path) -> str:
    """Return the format of a file's suffix. Raises ExportError: no format has this suffix."""
    ends = [name for name in CUE_FORMATS if path.name.lower().endswith(f".{name}")]
    if not ends:
        known = " ".join(f".{known}" for known in CUE_FORMATS)
        raise ExportError(f"{path}: unknown cue format {path.suffix!r}; required one of: {known}")
    return max(ends, key=len)


def write_cue_file(path: Path, sheet: CueSheet, sound_file: str, form: str) -> None:
    """Write cues to a file; after a failure there is no partial file. Raises ExportError: it cannot be written."""
    with atomic_file(path) as temporary:
        temporary.write_text(CUE_FORMATS[form].text(sheet, sound_file), encoding="utf-8", newline="\n")


def read_cues(path: Path, fps: float | None = None) -> CueSheet:
    """Return the cues of a file in the form of its suffix.

    fps : frames a second of a ``.dat``, which does not say it; None: ``CUES_FPS``
    Raises InputError: it cannot be read, or is damaged, or has times and needs no rate.
    """
    chosen = CUE_FORMATS.get("tsv" if path.suffix.lower() == ".csv" else path.suffix.lower().removeprefix("."))
    if chosen is None or chosen.parse is None:
        readable = " ".join(f".{name}" for name, form in CUE_FORMATS.items() if form.parse)
        raise InputError(f"{path}: no cues are read from {path.suffix!r}; use one of {readable}")
    text = read_text_file(path, "file of cues", LARGEST_BYTES)
    if fps is None:
        return chosen.parse(text)
    if path.suffix.lower() != ".dat":
        raise InputError(f"{path}: its cues have times, and need no rate; leave it out")
    if not 1 <= fps <= FASTEST_FPS:
        raise InputError(f"{path}: {fps:g} frames a second, required 1 to {FASTEST_FPS:.0f}")
    return rhubarb.parse_dat(text, fps)


def read_cue_motion(path: Path, fps: float | None = None) -> tuple[Motion, Timeline[Unit]]:
    """Return the cues of a file as motion and phones in time. Raises InputError: as ``read_cues``."""
    return convert_cues(read_cues(path, fps))


def convert_cues(sheet: CueSheet) -> tuple[Motion, Timeline[Unit]]:
    """Return the motion of cues: ``opening`` and ``width`` at 100 frames a second, and a phone for every shape."""
    words = sheet.words.spans
    starts_s = [span.start_s for span in words]
    spans = []
    for cue in sheet.cues:
        phone, middle_s = PHONE_OF[cue.label], (cue.start_s + cue.end_s) / 2
        place = bisect_right(starts_s, middle_s) - 1
        inside = place >= 0 and middle_s < words[place].end_s and phone != SILENCE and is_line(words[place].label)
        spans.append(Span(cue.start_s, cue.end_s, Unit(phone, word=words[place].label if inside else "")))
    units = Timeline(tuple(spans))
    time_s = np.arange(int(sheet.duration_s * RATE_HZ + 1e-6) + 1) / RATE_HZ
    weights = crossfade_phones(units, time_s, lambda phone: SHAPE_OF.get(phone, REST))
    gap = np.sum([SHAPES[name].opening * weight for name, weight in weights.items()], axis=0) * WIDEST_GAP
    spread = np.sum([SHAPES[name].spread * weight for name, weight in weights.items()], axis=0)
    width = build_mouth().width * (1 + WIDENING * spread)
    values = np.stack([gap_to_opening(np.where(gap < 1e-6, 0.0, gap)), width], axis=1)
    return Motion(values, RATE_HZ, (Channel("opening"), Channel("width"))), units
