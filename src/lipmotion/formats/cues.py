"""Cue files by format, and cues as motion (phones in time, and curves that faces draw).

Every shape becomes one phone with its mouth, and an opening and a width, which the lips reach and leave as those of
phones (``articulation.phone_targets``). So p, b and m stay closed, and lips and tongue follow from the phones.

``tsv``: one line per cue with its start and its shape; the last line is the end, with the shape at rest.
``xml``: metadata, and one element per cue with its start and end.
``json``: metadata and cues, each with start, end and value.
``dat``: switch data of Moho, also read by OpenToonz: frames and Preston Blair's names of the shapes.
``pgo``: a project of Papagayo, version 1: phrases, words and Preston Blair's shapes in frames, to be edited there.
Frames count from 0; a shape lasts to the next one of its word or to the word's last frame, which is included; outside
of words the mouth is at rest. Source: what Papagayo and Papagayo-NG write and read.
``spine.json``: a skeleton of Spine 4 with one slot, ``mouth``, whose attachments, one a shape, an animation changes.
Source: Esoteric Software, "JSON export format" (Spine 4.2). The slot, its attachments and the animation ``speech`` can
be taken into a skeleton of one's own; the pictures are ``A.png`` to ``X.png`` beside the file.
"""

from __future__ import annotations

import csv
import json
import math
import re
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Sequence
from dataclasses import replace
from html import escape
from itertools import islice, pairwise, takewhile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lipmotion.articulation.contact import gap_to_opening
from lipmotion.articulation.cue_sheets import (
    CUES_FPS,
    CueSheet,
    build_cue_sheet,
    choose_chart,
    list_frame_shapes,
    parse_cue_time,
    parse_shape,
)
from lipmotion.articulation.lip_points import build_mouth
from lipmotion.articulation.phone_targets import crossfade_phones
from lipmotion.errors import ExportError, InputError, shorten
from lipmotion.motion.frame_labels import find_runs
from lipmotion.printable import is_line, printable
from lipmotion.storage.files import atomic_file
from lipmotion.storage.json_text import as_json
from lipmotion.storage.sources import read_text_file
from lipmotion.types import Channel, Motion, Span, Timeline, Unit
from lipmotion.units import SILENCE
from lipmotion.units.phones import LETTERS, REST, SHAPES

_NOT_XML = re.compile("[^\t\n\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_CONTROL = re.compile("[\t\n\x7f]")  # characters that XML 1.0 cannot hold, and those that it would change
_CUE = re.compile(r"<mouthCue\s+start=\"([^\"<]{0,40})\"\s+end=\"([^\"<]{0,40})\"\s*>([^<]{0,40})</mouthCue>")
MOHO = "MohoSwitch1"
LISTS = ("mouthCues", "visemes", "cues", "events", "keyframes")
STARTS, NAMES = ("start", "time", "timestamp", "offset", "t"), ("value", "viseme", "shape", "name", "phoneme")
"""Names of lists, and of the start and the shape of an item; the first that is there counts."""
HEADER = re.compile(r"\W*(?:time|start|begin|seconds)\b[^\n]*", re.IGNORECASE)
LONGEST_LINE = 200
MIN_GAP_S, MIN_GAP = 0.02, 0.05
"""Between cues that are further apart, in seconds and as a share of the first one, the mouth is at rest."""
MARK = "lipsync version 1"
FASTEST_FPS = 1000
WHOLE_RATE_TOLERANCE = 0.01  # a rate that is so little over a whole one counts as that
UNKNOWN = "speech"  # the text of speech without known words
Part = tuple[int, int, str]  # first frame, last frame (included), and text
VERSION, SLOT, ANIMATION = "4.2.0", "mouth", "speech"
PIXELS = 256  # width and height of a mouth until Spine has its picture


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
    """Return the content of an ``.xml``, in ASCII; what XML cannot hold is escaped as in Python."""
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
    """Return cues of place, start, end and shape; the mouth is at rest between the end of one and the next.

    An end that is the start is not known: that cue lasts to the next one.
    """
    rows, end_s, lasts_s = list[tuple[float, str]](), 0.0, 0.0
    for place, start, end, shape in cues:
        start_s = parse_cue_time(start, place)
        if lasts_s > 0 and rows[-1][1] != REST and start_s - end_s > MIN_GAP_S + MIN_GAP * lasts_s:
            rows.append((end_s, REST))
        rows.append((start_s, parse_shape(shape, chart, place)))
        end_s = parse_cue_time(end, place)
        lasts_s = end_s - start_s
    return build_cue_sheet(rows, end_s, CUES_FPS)


def format_json(sheet: CueSheet, sound_file: str) -> str:
    """Return the content of a ``.json``: one line per cue, in ASCII."""
    cues = ",\n".join(
        f'    {{ "start": {cue.start_s:.2f}, "end": {cue.end_s:.2f}, "value": "{cue.label}" }}' for cue in sheet.cues
    )
    metadata = f'    "soundFile": {as_json(sound_file)},\n    "duration": {sheet.duration_s:.2f}\n'
    return f'{{\n  "metadata": {{\n{metadata}  }},\n  "mouthCues": [\n{cues}\n  ]\n}}\n'


def parse_json(text: str) -> CueSheet:
    """Return the cues of a ``.json``, also events of visemes. Raises InputError: no JSON, or a cue that is none."""
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
    """Return the content of a ``.dat``: the first frame is 1, the last line is the frame after the end, at rest."""
    frames = {1 + int(sheet.fps * cue.start_s): cue.label for cue in reversed(sheet.cues.spans)}
    end = max(1 + int(sheet.fps * sheet.duration_s), max(frames) + 1)
    rows = [*sorted(frames.items()), (end, sheet.rest)]
    return f"{MOHO}\n" + "".join(f"{frame} {SHAPES[shape].blair if sheet.blair else shape}\n" for frame, shape in rows)


def parse_dat(text: str, fps: float = CUES_FPS) -> CueSheet:
    """Return the cues of a ``.dat``, whose frames count from 1. Raises InputError: another or a damaged file."""
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


def format_project(sheet: CueSheet, sound_file: str) -> str:
    """Return the content of a ``.pgo``: one voice; a phrase lasts from rest to rest."""
    # Papagayo knows whole rates alone: 29.97 becomes 30 at the same times, so that frames do not drift from the sound
    sheet = replace(sheet, fps=float(math.ceil(sheet.fps - WHOLE_RATE_TOLERANCE)))
    names = list_frame_shapes(sheet)
    runs = find_runs(np.array([shape != REST for shape in names], bool)).tolist()
    phrases = [_list_words(sheet, first, stop - 1) for first, stop in runs]
    texts = [" ".join(word for *_, word in phrase) for phrase in phrases]
    lines = [MARK, _escape_line(" ".join(sound_file.split())) or "sound.wav", f"{sheet.fps:.0f}", f"{len(names)}"]
    lines += ["1", "\tVoice 1", f"\t{'|'.join(texts)}", f"\t{len(phrases)}"]
    for phrase, words in zip(phrases, texts, strict=True):
        lines += [f"\t\t{words}", f"\t\t{phrase[0][0]}", f"\t\t{phrase[-1][1]}", f"\t\t{len(phrase)}"]
        for first, last, word in phrase:
            changes = [frame for frame in range(first, last + 1) if frame == first or names[frame] != names[frame - 1]]
            lines.append(f"\t\t\t{word} {first} {last} {len(changes)}")
            lines += [f"\t\t\t\t{frame} {SHAPES[names[frame]].blair}" for frame in changes]
    return "\n".join(lines) + "\n"


def _list_words(sheet: CueSheet, first: int, last: int) -> list[Part]:
    """Return the words from one frame to another without gaps; what is said within a frame joins the one before."""
    parts: list[Part] = []
    spans = sheet.words.spans
    begin = bisect_left(spans, first, key=lambda span: int(span.end_s * sheet.fps))
    for span in takewhile(lambda span: int(span.start_s * sheet.fps) <= last, islice(spans, begin, None)):
        start = int(span.start_s * sheet.fps)
        start = first if not parts else max(start, first)
        word = _escape_line("".join(span.label.split())) or UNKNOWN
        if parts and start <= parts[-1][0]:
            parts[-1] = (parts[-1][0], last, f"{parts[-1][2]}-{word}")
            continue
        if parts:
            parts[-1] = (parts[-1][0], start - 1, parts[-1][2])
        parts.append((start, last, word))
    return parts or [(first, last, UNKNOWN)]


def _escape_line(text: str) -> str:
    """Return a text without what ends a line here: ``|``, or control characters, which are shown as escapes."""
    text = text.replace("|", "/")
    return text if is_line(text) else printable(text)


def parse_papagayo(text: str) -> CueSheet:
    """Return the cues and the words of the first voice. Raises InputError: another version, cut short, or no shape."""
    numbered, number = enumerate(text.splitlines(), 1), 0

    def take() -> str:
        nonlocal number
        before, (number, line) = number, next(numbered, (0, ""))
        if not number:
            raise InputError(f"the project ends after line {before}; save it again in Papagayo")
        return line.strip()

    def count() -> int:
        return int(parse_cue_time(take(), f"line {number}"))

    if take() != MARK:
        raise InputError(f"not a project of Papagayo: the first line is no {MARK!r}; save it again")
    take()
    fps, frames, voices = (count() for _ in range(3))
    if not 1 <= fps <= FASTEST_FPS or not voices:
        raise InputError(f"{voices} voices at {fps} frames a second, required one at 1 to {FASTEST_FPS}; save it again")
    take()
    take()
    shapes: list[tuple[float, str, str]] = []
    words: list[Span[str]] = []
    for _ in range(count()):
        for _ in range(3):
            take()
        for _ in range(count()):
            line = take()
            fields = line.rsplit(maxsplit=3)
            if len(fields) != 4:
                wanted = "a word, its frames and the number of its shapes"
                raise InputError(f"line {number} is {shorten(line)!r}, required {wanted}")
            first, last, changes = (int(parse_cue_time(field, f"line {number}")) for field in fields[1:])
            words.append(Span(first / fps, (last + 1) / fps, fields[0]))
            for _ in range(changes):
                frame, _, name = take().partition(" ")
                shapes.append((parse_cue_time(frame, f"line {number}") / fps, name, f"line {number}"))
            shapes.append(((last + 1) / fps, "", ""))
    chart = choose_chart(name for _, name, _ in shapes if name)
    rows = [(start_s, parse_shape(name, chart, place) if name else REST) for start_s, name, place in shapes]
    lasting = [row for row, after in zip(rows, [*rows[1:], (math.inf, "")], strict=False) if row[0] < after[0]]
    return build_cue_sheet(lasting, frames / fps, float(fps), Timeline(tuple(words)))


def format_skeleton(sheet: CueSheet, sound_file: str) -> str:
    """Return the content of the file, in ASCII; the last key is the end, with the shape at rest."""
    shapes = {shape: {"width": PIXELS, "height": PIXELS} for shape in sheet.drawn}
    animation: dict[str, Any] = {
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
        animation["events"] = [{"time": 0, "name": ANIMATION}]
    return as_json({**document, "animations": {ANIMATION: animation}}, indent=1) + "\n"


class CueFormat(NamedTuple):
    """How one kind of cue file is written and read.

    text  : cues and the name of the recording → the text of a file
    parse : the text of a file → its cues, or raises InputError; None: the format is not read
    """

    text: Callable[[CueSheet, str], str]
    parse: Callable[[str], CueSheet] | None = None


CUE_FORMATS = {
    "tsv": CueFormat(format_tsv, parse_tsv),
    "xml": CueFormat(format_xml, parse_xml),
    "json": CueFormat(format_json, parse_json),
    "dat": CueFormat(format_dat, parse_dat),
    "pgo": CueFormat(format_project, parse_papagayo),
    "spine.json": CueFormat(format_skeleton),
}
"""Formats by name; the end of a file's name is that of its format, of several the longest."""
PHONE_OF = {"A": "p", "B": "s", "C": "eh", "D": "aa", "E": "ao", "F": "uw", "G": "f", "H": "l", "X": SILENCE}
"""A phone with the mouth of each shape."""
SHAPE_OF = {phone: shape for shape, phone in PHONE_OF.items()}
RATE_HZ = 100.0
WIDEST_GAP = 0.25
"""The gap between the lips of a shape whose opening is 1, in eye distances: that of wide vowels of typical talkers."""
WIDENING = 0.12  # by how much the mouth is wider than at rest where the spread of a shape is 1, as a share
LARGEST_BYTES = 1 << 24


def find_format(path: Path) -> str:
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
    """Return the cues of a file; ``fps``: of a ``.dat``, the only one without a rate. Raises InputError: unreadable."""
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
        raise InputError(f"{path}: {fps:g} frames a second, required 1 to {FASTEST_FPS}")
    return parse_dat(text, fps)


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
