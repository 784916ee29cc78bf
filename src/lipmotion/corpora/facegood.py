"""Reader of sounds with bare arrays of blendshape weights, as FACEGOOD-Audio2Face publishes them.

``NAME.wav``, ``bs_value_NAME.npy`` (frames × channels, 30 a second), and the channels' names in one
``*_bs_name.npy``.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.corpora.source_recordings import (
    AUDIO_SUFFIXES,
    LISTS,
    MotionFile,
    RecordingFolder,
    SourceRecording,
    assign_splits,
)
from lipmotion.errors import InputError
from lipmotion.formats.label_files import find_labels
from lipmotion.storage.archive import array_in
from lipmotion.storage.files import check_regular
from lipmotion.types import WEIGHT, Channel, Motion

KIND = "FACEGOOD blendshape weights"
NAMES, VALUES = "*_bs_name.npy", "bs_value_"
RATE_HZ = 30.0
LICENCE_CHARACTERS = 10_000
"""Characters of a licence file that are read for its name and its owner."""


def read_facegood(directory: Path) -> RecordingFolder | None:
    """Return the recordings of such a folder, or None if it has no list of names or no arrays.

    Raises InputError: the list of names is damaged, or there are several.
    """
    arrays, lists = sorted(directory.glob(f"{VALUES}*.npy")), sorted(directory.glob(NAMES))
    if not arrays or not lists:
        return None
    if len(lists) > 1:
        raise InputError(f"{directory}: {len(lists)} lists of channel names ({NAMES}); keep the one that belongs here")
    channels = read_channels(lists[0])
    sounds: dict[str, list[Path]] = {}
    for path in directory.iterdir():
        if path.suffix.lower() in AUDIO_SUFFIXES:
            sounds.setdefault(path.stem, []).append(path)
    ignored, rights, licence = frozenset(directory / name for name in LISTS), dict[str, str](), directory / "LICENSE"
    if licence.is_file():
        with licence.open(encoding="utf-8", errors="replace") as file:
            lines = [line.strip() for line in file.read(LICENCE_CHARACTERS).splitlines() if line.strip()]
        owners = [line for line in lines if line.lower().startswith("copyright")]
        rights = dict(zip(("licence", "attribution"), (*lines[:1], *owners[:1]), strict=False))
    recordings, problems = [], {}
    for path in arrays:
        name = path.stem.removeprefix(VALUES)
        same_name = sounds.get(name, [])
        try:
            if len(same_name) != 1:
                raise InputError(f"{path}: {len(same_name)} sounds named {name}, required one: {name}.wav")
            labels = find_labels(same_name[0], ignored=ignored)
            recording = SourceRecording(name, same_name[0], labels.words, rights=rights, phones=labels.phones)
            recordings.append(replace(recording, motion_file=MotionFile(path, RATE_HZ, channels)))
        except InputError as error:
            problems[name] = str(error)
    return assign_splits(RecordingFolder(KIND, tuple(recordings), problems), directory)


def read_channels(path: Path) -> tuple[Channel, ...]:
    """Return the channels of a file of names. Raises InputError: not a row of different texts."""
    names = _load(path)
    if names.dtype.kind != "U" or names.ndim != 1 or len(set(names.tolist())) != len(names):
        what = f"an array of {names.dtype} of shape {names.shape}"
        raise InputError(f"{path}: {what}, required one row of different texts")
    return tuple(Channel(str(name), WEIGHT) for name in names)


def read_bare_motion(motion_file: MotionFile) -> Motion:
    """Return the motion in a file with a bare array.

    Raises InputError: not an array of finite numbers with one column a channel.
    """
    values = _load(motion_file.file)
    if values.dtype.kind not in "fiu" or values.ndim != 2 or values.shape[1] != len(motion_file.channels):
        raise InputError(
            f"{motion_file.file}: an array of {values.dtype} of shape {values.shape}, "
            f"required numbers of shape (frames, {len(motion_file.channels)})"
        )
    if not np.isfinite(values).all():
        raise InputError(f"{motion_file.file}: holds values that are not finite; interpolate them first")
    return Motion(values.astype(np.float64), motion_file.rate_hz or RATE_HZ, motion_file.channels)


def _load(path: Path) -> NDArray[Any]:
    """Return an array from a file, never pickled objects; NumPy's warning of Python 2's sizes (``116L``) is hidden."""
    check_regular(path, "array")
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Reading `.npy`", category=UserWarning)
            return array_in(path.read_bytes())
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: not an array of numbers or texts ({error}); save it with numpy.save") from error
