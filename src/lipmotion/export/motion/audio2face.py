"""``.a2f.json``: weights of ARKit's 52 blendshapes as NVIDIA Audio2Face exports them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from lipmotion.errors import InputError
from lipmotion.export.base import MotionFormat
from lipmotion.export.motion.audio2face_document import (
    FRAMES,
    NAMES,
    POSES,
    RATE,
    SOUND,
    WEIGHTS,
    audio2face_motion,
)
from lipmotion.export.motion.rounded import formatted_rows
from lipmotion.meshes.model.shape_names import ARKIT_52
from lipmotion.storage.json_text import as_json
from lipmotion.types import Generation, Motion, Timeline, Unit

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
    """Return the weights of a file, and an empty timeline. Raises InputError: it is none of Audio2Face."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"not JSON ({error}); export it again") from error
    return audio2face_motion(text)


MOTION_FORMAT = MotionFormat(write, read, curves="face", rate_hz=RATE_HZ, names_sound=True)
