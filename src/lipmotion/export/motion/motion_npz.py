"""``.npz``: the values without rounding, and the rest as JSON in a string array. Nothing is pickled."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
