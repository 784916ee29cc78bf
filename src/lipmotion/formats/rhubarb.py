"""Cues as Rhubarb writes them: letters of mouth shapes in seconds, and switch data of Moho.

``tsv``: one line per cue with its start and its shape; the last line is the end, with the shape at rest.
``xml``: metadata, and one element per cue with its start and end.
``json``: metadata and cues, each with start, end and value.
``dat``: switch data of Moho, also read by OpenToonz: frames and Preston Blair's names of the shapes.
"""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Sequence
from html import escape
from itertools import pairwise
from typing import Any

from lipmotion.articulation.cue_sheets import (
    CUES_FPS,
    CueSheet,
    build_cue_sheet,
    choose_chart,
    parse_cue_time,
    parse_shape,
)
from lipmotion.errors import InputError
from lipmotion.storage.json_text import as_json
from lipmotion.units.phones import LETTERS, SHAPES

_NOT_XML = re.compile("[^\t\n\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_CONTROL = re.compile("[\t\n\x7f]")
"""Characters that XML 1.0 cannot hold, and those that it would change."""
_CUE = re.compile(r"<mouthCue\s+start=\"([^\"<]{0,40})\"\s+end=\"([^\"<]{0,40})\"\s*>([^<]{0,40})</mouthCue>")
MOHO = "MohoSwitch1"
LISTS = ("mouthCues", "visemes", "cues", "events", "keyframes")
STARTS, NAMES = ("start", "time", "timestamp", "offset", "t"), ("value", "viseme", "shape", "name", "phoneme")
"""Names of lists, and of the start and the shape of an item; the first that is there counts."""
HEADER = re.compile(r"\W*(?:time|start|begin|seconds)\b[^\n]*", re.IGNORECASE)
LONGEST_LINE = 200


def format_tsv(sheet: CueSheet, _sound_file: str) -> str:
    """Return the content of a ``.tsv``."""
    return "".join(f"{time_s:.2f}\t{shape}\n" for time_s, shape in sheet.rows)


def parse_tsv(text: str) -> CueSheet:
    """Return the cues of a ``.tsv``, or of another table of cues: with commas or semicolons, names of columns, ends of
    cues, clocks, decimal commas. Raises InputError: a line of another form, with its number."""
    numbered = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    if numbered and HEADER.match(numbered[0][1]):
        numbered = numbered[1:]
    mark = next((mark for mark in "\t;" if numbered and mark in numbered[0][1]), ",")
    cues: list[tuple[str, list[str]]] = []
    for number, line in numbered:
        fields = next(csv.reader([line], delimiter=mark, skipinitialspace=True)) if len(line) < LONGEST_LINE else []
        if not 2 <= len(fields) <= 3:
            raise InputError(f"line {number}: required a time, a tab and a mouth shape; or two times and a shape")
        cues.append((f"line {number}", fields))
    spans = [fields for _, fields in cues if len(fields) == 3]
    follow = all(before[1] == after[0] for before, after in pairwise(spans))
    if mark == "," and not follow and all(f"{a}{b}".isdecimal() for a, b, _ in spans):  # decimal commas
        cues = [(place, [",".join(fields[:-1]), fields[-1]]) for place, fields in cues]
    chart = choose_chart((fields[-1] for _, fields in cues), LETTERS)
    return _build_sheet([(place, fields[0], fields[-2], fields[-1]) for place, fields in cues], chart)


def format_xml(sheet: CueSheet, sound_file: str) -> str:
    """Return the content of the file, in ASCII; characters that XML cannot hold are escaped as in Python."""
    name = _NOT_XML.sub(lambda match: match[0].encode("unicode_escape").decode(), sound_file)
    name = _CONTROL.sub(lambda match: f"&#{ord(match[0])};", escape(name, quote=False))
    cues = "".join(
        f'    <mouthCue start="{cue.start_s:.2f}" end="{cue.end_s:.2f}">{cue.label}</mouthCue>\n' for cue in sheet.cues
    )
    document = (
        '<?xml version="1.0" encoding="utf-8"?>\n<rhubarbResult>\n  <metadata>\n'
        f"    <soundFile>{name}</soundFile>\n    <duration>{sheet.duration_s:.2f}</duration>\n"
        f"  </metadata>\n  <mouthCues>\n{cues}  </mouthCues>\n</rhubarbResult>\n"
    )
    return document.encode("ascii", "xmlcharrefreplace").decode()


def parse_xml(text: str) -> CueSheet:
    """Return the cues of an ``.xml``. Raises InputError: there is none, or one is none, with its number."""
    cues = enumerate(_CUE.findall(text), 1)
    return _build_sheet([(f"cue {number}", start, end, letter) for number, (start, end, letter) in cues], LETTERS)


def _build_sheet(cues: Sequence[tuple[str, str, str, str]], chart: dict[str, str]) -> CueSheet:
    """Return cues of place, start, end and shape."""
    rows = [(parse_cue_time(start, place), parse_shape(shape, chart, place)) for place, start, _, shape in cues]
    return build_cue_sheet(rows, parse_cue_time(cues[-1][2], cues[-1][0]) if cues else 0.0, CUES_FPS)


def json_text(sheet: CueSheet, sound_file: str) -> str:
    """Return the content of the file: one line per cue, in ASCII."""
    cues = ",\n".join(
        f'    {{ "start": {cue.start_s:.2f}, "end": {cue.end_s:.2f}, "value": "{cue.label}" }}' for cue in sheet.cues
    )
    metadata = f'    "soundFile": {as_json(sound_file)},\n    "duration": {sheet.duration_s:.2f}\n'
    return f'{{\n  "metadata": {{\n{metadata}  }},\n  "mouthCues": [\n{cues}\n  ]\n}}\n'


def parse_json(text: str) -> CueSheet:
    """Return the cues of a ``.json``, also events of visemes.

    Raises InputError: it is no JSON, or a cue is none, with its number.
    """
    try:
        document: Any = json.loads(text)
        cues = document if isinstance(document, list) else next(document[name] for name in LISTS if name in document)
    except (ValueError, RecursionError, StopIteration, TypeError) as error:
        raise InputError(f"not a file of Rhubarb ({error or 'no mouthCues'}); export it again") from error
    items: list[tuple[str, str, str, str]] = []
    for number, cue in enumerate(cues if isinstance(cues, list) else [], 1):
        fields = cue if isinstance(cue, dict) else {}
        start, shape = (next((str(fields[n]) for n in names if n in fields), "None") for names in (STARTS, NAMES))
        items.append((f"cue {number}", start, str(fields.get("end", start)), shape))
    return _build_sheet(items, choose_chart((shape for *_, shape in items), LETTERS))


def format_dat(sheet: CueSheet, _sound_file: str) -> str:
    """Return the content of the file: the first frame is 1, the last line is the frame after the end, at rest."""
    frames = {1 + int(sheet.fps * cue.start_s): cue.label for cue in reversed(sheet.cues.spans)}
    end = max(1 + int(sheet.fps * sheet.duration_s), max(frames) + 1)
    rows = [*sorted(frames.items()), (end, sheet.rest)]
    return f"{MOHO}\n" + "".join(f"{frame} {SHAPES[shape].blair if sheet.blair else shape}\n" for frame, shape in rows)


def parse_dat(text: str, fps: float = CUES_FPS) -> CueSheet:
    """Return the cues of a file, whose frames count from 1; it does not say how many are a second.

    Raises InputError: another first line, or a line of another form, with its number.
    """
    lines = [(number, line.split()) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    if not lines or lines[0][1] != [MOHO]:
        raise InputError(f"not switch data of Moho: the first line is no {MOHO}; export it again")
    wrong = next((number for number, fields in lines[1:] if len(fields) != 2), None)
    if wrong is not None:
        raise InputError(f"line {wrong}: required a frame and a mouth shape")
    chart = choose_chart(name for _, (_, name) in lines[1:])
    rows = [
        (max(parse_cue_time(frame, f"line {number}") - 1, 0) / fps, parse_shape(name, chart, f"line {number}"))
        for number, (frame, name) in lines[1:]
    ]
    return build_cue_sheet(rows, 0.0, fps)
