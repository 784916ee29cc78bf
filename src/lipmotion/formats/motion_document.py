"""lipmotion's own motion files: a document with everything besides the values, and the values.

``.json``: the document with its values, one row of values per line.
``.npz``: the values without rounding, and the rest as JSON in a string array. Nothing is pickled.

The document has ``format``, ``version``, ``rate_hz``, ``channels`` (name and unit), ``units`` (phones in time),
``recognised`` (if phones were), ``outlook`` (if known), ``source`` and ``model``. The confidence of every frame is a
member of it, or an array beside the values; the standard deviations are an array.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, shorten
from lipmotion.formats.base import MotionFormat, read_members, write_json
from lipmotion.printable import is_line
from lipmotion.storage.archive import UNREADABLE, array_in, check_archive
from lipmotion.storage.json_text import as_json, json_errors
from lipmotion.types import Channel, Generation, Motion, Span, Timeline, Unit
from lipmotion.types.values import items, members, number, require, text, truth
from lipmotion.units import RECOGNISED, RecognisedPhone, list_recognised_phones, restore_confidences

FORMAT = "lipmotion.motion"
VERSION = 1
FRAMES_AT_ONCE = 4096
"""Frames whose variance is computed at once."""


def _describe(
    generation: Generation, source: Mapping[str, str], model: Mapping[str, str]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the members before the values, and after. Raises InputError: a channel's name would not be read."""
    motion = generation.motion
    channels = [{"name": channel.name, "unit": channel.unit} for channel in motion.channels]
    checked = require(items(members(_CHANNEL)), channels, "channels")
    outlook = {} if generation.outlook is None else {"outlook": asdict(generation.outlook)}
    after = {**list_unit_rows(generation.units), **outlook, "source": dict(source), "model": dict(model)}
    return {"format": FORMAT, "version": VERSION, "rate_hz": float(motion.rate_hz), "channels": checked}, after


def list_unit_rows(units: Timeline[Unit]) -> dict[str, Any]:
    """Return the members ``units`` and ``recognised`` (if phones were), for ``parse_units``."""
    rows = []
    for span in units:
        label = span.label
        row = {"start_s": span.start_s, "end_s": span.end_s, "phone": label.phone, "unit": label.unit}
        rows.append(row | ({"word": label.word} if label.word else {}) | ({"again": True} if label.again else {}))
    recognised = list_recognised_phones(units)
    return {"units": rows} | ({RECOGNISED: recognised} if recognised else {})


def parse(document: Any, values: Any) -> tuple[Motion, Timeline[Unit]]:
    """Return the motion and the units of a document and its values.

    Raises InputError: not a motion document, a newer version, or members that are missing or do not fit.
    """
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise InputError(f"not a motion document: its 'format' must be {FORMAT!r}")
    version = document.get("version")
    if not isinstance(version, int) or version < 1:
        raise InputError(f"the motion document has version {version!r}, required {VERSION}; export it again")
    if version > VERSION:
        newer = f"the motion document has version {version}"
        raise InputError(f"{newer}, this lipmotion reads up to {VERSION}: upgrade lipmotion")
    with json_errors("the motion document"):
        checked = _DOCUMENT(document)
        channels = tuple(Channel(**channel) for channel in checked["channels"])
        if isinstance(values, np.ndarray) and values.dtype.kind not in "fiu":
            raise InputError(f"the motion document has values of {values.dtype}, required numbers; export it again")
        array = np.asarray(values, dtype=np.float64)
        motion = Motion(array.reshape(0, len(channels)) if array.size == 0 else array, checked["rate_hz"], channels)
    return motion, parse_units(document.get("units"), document.get(RECOGNISED))


def parse_units(rows: Any, recognised: Any = None) -> Timeline[Unit]:
    """Return the units of the member ``units``: objects with ``start_s``, ``end_s`` and ``phone`` or ``unit``.

    recognised : the member ``recognised``, where there is one: units that are in it, too, are not known
    Raises InputError: rows of another kind, without a time or a name, or with times that no recording has.
    """
    with json_errors("the motion document"):
        confidences = [
            RecognisedPhone(_TIME(start_s), _TIME(end_s), _TEXT(name), number(0, 1)(confidence))
            for start_s, end_s, name, confidence in _ROWS(recognised or [])
        ]
        return restore_confidences(Timeline(tuple(map(_read_span, _UNITS(rows)))), confidences)


def _read_span(row: Any) -> Span[Unit]:
    unit = Unit(row["phone"], row.get("unit", ""), row.get("word", ""), again=row.get("again", False))
    span = Span(row["start_s"], row["end_s"], unit)
    if not is_line(span.label.phone + span.label.unit + span.label.word):
        label = shorten(repr(span.label))
        raise InputError(f"{label} has a line end, a control character or half a character in it; correct it")
    if not span.start_s >= 0 or span.end_s == float("inf"):
        lasts = f"the unit {span.label.phone!r} lasts from {span.start_s} to {span.end_s} s"
        raise InputError(f"{lasts}, required: finite times from 0")
    return span


_TEXT, _TIME = text(10_000), number()
_UNITS = items(
    members(
        {"start_s": _TIME, "end_s": _TIME, "phone": _TEXT, "unit": _TEXT, "word": _TEXT, "again": truth},
        ("start_s", "end_s", "phone"),
    )
)
_ROWS = items(items(lambda value: value, 4, 4))
_CHANNEL = {"name": _TEXT, "unit": _TEXT}
_DOCUMENT = members(
    {"channels": items(members(_CHANNEL, _CHANNEL)), "rate_hz": number(), "units": lambda value: value},
    ("channels", "rate_hz", "units"),
)
"""What is used of a document, and its types."""


def write_json_file(path: Path, generation: Generation, source: Mapping[str, str], model: Mapping[str, str]) -> None:
    """Write one JSON object: format, version, rate_hz, channels, values, confidence, units, source, model."""
    certain = {} if (confidence := generation.confidence) is None else {"confidence": confidence.round(2).tolist()}
    before, after = _describe(generation, source, model)
    write_json(path, before, "values", generation.motion.values, certain | after)


def read_json(path: Path) -> tuple[Motion, Timeline[Unit]]:
    """Return motion and units of a file. Raises InputError: not JSON, or not a motion document."""
    with json_errors("the motion document"):
        text = path.read_text(encoding="utf-8-sig")
        if text.lstrip().startswith("["):
            raise InputError(f"not a motion document: its 'format' must be {FORMAT!r}")
        document = read_members(text, "values", "confidence")
    return parse(document, document.get("values"))


def read_json_units(path: Path) -> Timeline[Unit] | None:
    """Return the units of a file with the member ``units`` and neither values nor channels; None of any other file.

    Raises InputError: units that are damaged.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
        document = json.loads(text) if '"values"' not in text and text.lstrip().startswith("{") else None
    except (ValueError, RecursionError):  # reported by ``read_json``
        return None
    if document is None or "units" not in document or "channels" in document:
        return None
    return parse_units(document["units"], document.get(RECOGNISED))


def write_npz(path: Path, generation: Generation, source: Mapping[str, str], model: Mapping[str, str]) -> None:
    """Write ``values`` and ``standard_deviations`` [each shape=(T, P)] and ``document``, the JSON without its values.

    A standard deviation is the model's, in the unit of its channel: the square root of ``Generation.variance``.
    ``confidence`` [shape=(T,)] is ``Generation.confidence``, where that is known.
    """
    before, after = _describe(generation, source, model)
    document = as_json(before | after, ensure_ascii=False)
    values = generation.motion.values
    rows: dict[str, Callable[[slice], NDArray[np.floating[Any]]]] = {
        "values": lambda frames: values[frames],
        "standard_deviations": lambda frames: np.sqrt(np.maximum(generation.variance_of(frames), 0)).astype(np.float32),
    }
    with zipfile.ZipFile(path, "w") as file:  # as ``np.savez``, which would want all deviations at once
        for name, some in rows.items():
            with file.open(f"{name}.npy", "w", force_zip64=True) as member:
                head = {"descr": some(slice(0, 1)).dtype.str, "fortran_order": False, "shape": values.shape}
                np.lib.format.write_array_header_1_0(member, head)
                for start in range(0, len(values), FRAMES_AT_ONCE):
                    member.write(np.ascontiguousarray(some(slice(start, start + FRAMES_AT_ONCE))).data)
        arrays = {"document": np.array(document)}
        if (confidence := generation.confidence) is not None:
            arrays["confidence"] = confidence.astype(np.float32)
        for name, array in arrays.items():
            with file.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, array, allow_pickle=False)


def read_npz(path: Path) -> tuple[Motion, Timeline[Unit]]:
    """Return motion and units of a file. Raises InputError: not an .npz file, or not a motion document."""
    try:
        with zipfile.ZipFile(path) as file:
            check_archive(file)
            values = array_in(file.read("values.npy"))
            document = json.loads(str(array_in(file.read("document.npy"))))
    except OSError:
        raise
    except UNREADABLE as error:
        raise InputError(f"not a motion file ({error}); export it again") from error
    return parse(document, values)


JSON = MotionFormat(write_json_file, read_json, units=read_json_units)
NPZ = MotionFormat(write_npz, read_npz)
