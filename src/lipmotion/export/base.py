"""Motion files: the format follows from the file's suffix."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lipmotion.errors import ExportError, InputError
from lipmotion.export.motion import motion_csv, motion_json, motion_npz
from lipmotion.storage.files import check_regular, whole_file
from lipmotion.types import Generation, Motion, Timeline, Unit

About = Mapping[str, str]


@dataclass(frozen=True)
class MotionFormat:
    """How one kind of file is written and read; both functions are in the module named after it.

    write : path, what to write, and where its speech and its model came from
    read  : path → motion and units; raises InputError
    check : raises ExportError for motion that does not fit into such a file
    """

    write: Callable[[Path, Generation, About, About], None]
    read: Callable[[Path], tuple[Motion, Timeline[Unit]]]
    check: Callable[[Motion], None] = lambda _: None


_FORMATS: dict[str, MotionFormat] = {
    ".json": MotionFormat(motion_json.write, motion_json.read),
    ".csv": MotionFormat(motion_csv.write, motion_csv.read, motion_csv.check),
    ".npz": MotionFormat(motion_npz.write, motion_npz.read),
}
MOTION_SUFFIXES: tuple[str, ...] = tuple(_FORMATS)
"""The suffixes that ``write_motion`` knows."""
LARGEST_MOTION = 1 << 31
"""Bytes of a motion file: four hours of a hundred channels."""


def write_motion(path: Path, generation: Generation, *, source: dict[str, str], model: dict[str, str]) -> None:
    """Write motion and units to a file, whole or not at all; the format is that of the suffix.

    source, model : what the file says of the speech and of the model (``.csv`` has no room for it, nor for units)
    Raises ExportError: unknown suffix, values that are not finite, or the file cannot be written.
    """
    check_motion(path, generation.motion)
    with whole_file(path) as temporary:
        _FORMATS[path.suffix.lower()].write(temporary, generation, source, model)


def check_motion(path: Path, motion: Motion) -> None:
    """Raise ExportError if motion cannot be written to a file of that name: unknown suffix, or it does not fit."""
    chosen = _FORMATS.get(path.suffix.lower())
    if chosen is None:
        raise ExportError(f"{path}: cannot write motion as {_suffix(path)}; use one of {', '.join(MOTION_SUFFIXES)}")
    if not np.isfinite(motion.values).all():
        raise ExportError(f"{path}: the motion has values that are not finite; interpolate them before writing")
    chosen.check(motion)


def read_motion(path: str | Path) -> tuple[Motion, Timeline[Unit]]:
    """Read what ``write_motion`` wrote; a ``.csv`` has no units, so its timeline is empty.

    Raises InputError: unknown suffix, no such file, or not a motion file.
    """
    path = Path(path)
    chosen = _FORMATS.get(path.suffix.lower())
    if chosen is None:
        raise InputError(f"{path}: cannot read motion from {_suffix(path)}; use one of {', '.join(MOTION_SUFFIXES)}")
    check_regular(path, "motion file")
    try:
        size = path.stat().st_size
        if size > LARGEST_MOTION:
            raise InputError(f"{size} bytes, required at most {LARGEST_MOTION}: is it a motion file?")
        motion, units = chosen.read(path)
        if not np.isfinite(motion.values).all():
            raise InputError("there are values that are not finite; interpolate them first")
        return motion, units
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _suffix(path: Path) -> str:
    return f"{path.suffix!r}" if path.suffix else "a file without a suffix"
