"""``.json``: the document with its values, one row of values per line."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from lipmotion.errors import InputError
from lipmotion.export.base import MotionFormat
from lipmotion.export.motion.document import FORMAT, header, parse, parse_units, units_and_origin
from lipmotion.export.motion.json_stream import read_members
from lipmotion.export.motion.keys import formatted_rows
from lipmotion.storage.json_text import as_json, json_errors
from lipmotion.types import Generation, Motion, Timeline, Unit
from lipmotion.units import RECOGNISED


def write(path: Path, generation: Generation, source: Mapping[str, str], model: Mapping[str, str]) -> None:
    """Write one JSON object: format, version, rate_hz, channels, values, confidence, units, source, model."""
    before = as_json(header(generation), ensure_ascii=False)
    after = as_json(units_and_origin(generation, source, model), ensure_ascii=False)
    with path.open("w", encoding="utf-8") as file:
        file.write(f'{before[:-1]}, "values": [\n')
        for number, row in enumerate(formatted_rows(generation.motion.values)):
            file.write(f",\n[{row}]" if number else f"[{row}]")
        if (confidence := generation.confidence) is not None:
            file.write(f'\n], "confidence": {confidence.round(2).tolist()}, {after[1:]}\n')
        else:
            file.write(f"\n], {after[1:]}\n")


def read(path: Path) -> tuple[Motion, Timeline[Unit]]:
    """Return motion and units of a file. Raises InputError: not JSON, or not a motion document."""
    with json_errors("the motion document"):
        text = path.read_text(encoding="utf-8-sig")
        if text.lstrip().startswith("["):
            raise InputError(f"not a motion document: its 'format' must be {FORMAT!r}")
        document = read_members(text, "values", "confidence")
    return parse(document, document.get("values"))


def read_units(path: Path) -> Timeline[Unit] | None:
    """Return the units of a file with the member ``units`` and neither values nor channels; None of any other file.

    Raises InputError: units that are damaged.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
        document = json.loads(text) if '"values"' not in text and text.lstrip().startswith("{") else None
    except (ValueError, RecursionError):  # reported by ``read``
        return None
    if document is None or "units" not in document or "channels" in document:
        return None
    return parse_units(document["units"], document.get(RECOGNISED))


MOTION_FORMAT = MotionFormat(write, read, units=read_units)
