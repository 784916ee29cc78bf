"""Phones in time from a motion file, and the motion generated from them."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

from fuzz.inputs import Files, Good
from fuzz.readers.plausible import check_generation, good_model, short_speech
from lipmotion import animate, read_motion, write
from lipmotion.pipeline.request import Request
from robustness.motion_cases import GOOD


def seeds(good: Good) -> list[Files]:
    """Return motion files of ``animate``, and a minimal one."""
    found: list[Files] = [{"a.json": json.dumps(GOOD).encode()}]
    result = animate(Request(short_speech(good), recogniser="own"), model=good_model(good))
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / "a.json", Path(folder) / "a.npz"]
        write(result, paths, channels=["opening"])
        return found + [{path.name: path.read_bytes()} for path in paths]


def read(folder: Path, good: Good) -> None:
    """Animate a short sound with these phones."""
    (path,) = folder.iterdir()
    units = read_motion(path)[1]
    check_generation(animate(Request(short_speech(good), units=units, recogniser="own"), model=good_model(good)))
