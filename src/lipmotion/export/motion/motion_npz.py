"""``.npz``: the values without rounding, and the rest as JSON in a string array. Nothing is pickled."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lipmotion.errors import InputError
from lipmotion.export.base import MotionFormat
from lipmotion.export.motion.document import header, parse, units_and_origin
from lipmotion.storage.archive import UNREADABLE, array_in, check_archive
from lipmotion.storage.json_text import as_json
from lipmotion.types import Generation, Motion, Timeline, Unit

FRAMES_AT_ONCE = 4096
"""Frames whose variance is computed at once."""


def write(path: Path, generation: Generation, source: Mapping[str, str], model: Mapping[str, str]) -> None:
    """Write ``values`` and ``standard_deviations`` [each shape=(T, P)] and ``document``, the JSON without its values.

    A standard deviation is the model's, in the unit of its channel: the square root of ``Generation.variance``.
    ``confidence`` [shape=(T,)] is ``Generation.confidence``, where that is known.
    """
    document = as_json({**header(generation), **units_and_origin(generation, source, model)}, ensure_ascii=False)
    with path.open("wb") as file:  # given a path, NumPy would add a suffix of its own
        deviations = np.empty(generation.motion.values.shape, np.float32)
        for start in range(0, len(deviations), FRAMES_AT_ONCE):
            frames = slice(start, start + FRAMES_AT_ONCE)
            deviations[frames] = np.sqrt(np.maximum(generation.variance_of(frames), 0))
        arrays: dict[str, Any] = {
            "values": generation.motion.values,
            "standard_deviations": deviations,
            "document": np.array(document),
        }
        if (confidence := generation.confidence) is not None:
            arrays["confidence"] = confidence.astype(np.float32)
        np.savez(file, **arrays)


def read(path: Path) -> tuple[Motion, Timeline[Unit]]:
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


MOTION_FORMAT = MotionFormat(write, read)
