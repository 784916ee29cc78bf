"""``.a2f.json``: weights of ARKit's 52 blendshapes as NVIDIA Audio2Face exports them.

``facsNames`` names the columns of ``weightMat``, one row a frame: ARKit's 52 names, or the 46 of Audio2Face's own
solver, which ``meshes.model.other_shapes`` understands.

Source: NVIDIA, "Audio2Face, Export" and "Blendshape conversion"; files of versions 2022 and 2023.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from lipmotion.errors import InputError
from lipmotion.export.base import MotionFormat
from lipmotion.export.motion.json_stream import read_members
from lipmotion.export.motion.keys import formatted_rows
from lipmotion.meshes.model.shape_names import ARKIT_52
from lipmotion.storage.json_text import as_json, json_errors
from lipmotion.types import WEIGHT, Channel, Generation, Motion, Timeline, Unit
from lipmotion.types.values import items, members, number, text

LOG = logging.getLogger("lipmotion")
NAMES, WEIGHTS, RATE, SOUND, POSES, FRAMES = (
    *("facsNames", "weightMat", "exportFps", "trackPath", "numPoses", "numFrames"),
)
"""The members of a file."""
RATE_HZ = 60.0
"""What Audio2Face exports by default."""


def write(path: Path, generation: Generation, source: Mapping[str, str], _model: Mapping[str, str]) -> None:
    """Write one JSON object; blendshapes that the motion does not have are 0."""
    motion = generation.motion
    table = np.zeros((len(motion.values), len(ARKIT_52)))
    for column, name in enumerate(ARKIT_52):
        if name in motion.names:
            table[:, column] = motion[name]
    document = {RATE: motion.rate_hz, SOUND: source.get("path", ""), POSES: len(ARKIT_52), FRAMES: len(table)}
    before = as_json({**document, NAMES: list(ARKIT_52)}, ensure_ascii=False)
    with path.open("w", encoding="utf-8") as file:
        file.write(f'{before[:-1]}, "{WEIGHTS}": [\n')
        for number, row in enumerate(formatted_rows(table)):
            file.write(f",\n[{row}]" if number else f"[{row}]")
        file.write("\n]}\n")


def read(path: Path) -> tuple[Motion, Timeline[Unit]]:
    """Return the weights of a file, and an empty timeline. Joints, where a file has them, are passed over.

    Raises InputError: not such a file, no rate, or rows that do not fit the names.
    """
    with json_errors("the file of Audio2Face"):
        document = read_members(path.read_text(encoding="utf-8-sig"), WEIGHTS)
        found = _MEMBERS(document)
        names, rows, rate_hz = found[NAMES], document[WEIGHTS], found[RATE]
    stated = document.get(FRAMES)
    if isinstance(stated, int) and stated != len(rows):
        LOG.warning("%s: %d frames are stated, %d are there", path, stated, len(rows))
    if not isinstance(rows, np.ndarray) or rows.ndim != 2 or rows.shape[1] != len(names):
        shape = rows.shape if isinstance(rows, np.ndarray) else "no"
        raise InputError(
            f"the member {WEIGHTS!r} has {shape} rows and columns, required a column for each of {NAMES!r}"
        )
    return Motion(rows, rate_hz, tuple(Channel(name, WEIGHT) for name in names)), Timeline(())


_MEMBERS = members({NAMES: items(text(1000)), RATE: number()}, (NAMES, RATE))


MOTION_FORMAT = MotionFormat(write, read, curves="face", rate_hz=RATE_HZ, names_sound=True)
