"""Readers of captured faces: VOCASET, and sounds with bare arrays of weights, as FACEGOOD-Audio2Face publishes them.

VOCASET: sounds in one folder, and in another a mesh of FLAME (``.ply``) for each sixtieth of a second.
FACEGOOD: ``NAME.wav``, ``bs_value_NAME.npy`` (frames × channels, 30 a second), and the channels' names in one
``*_bs_name.npy``.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError, shorten
from lipmotion.formats.c3d import measure_markers, to_head_frame
from lipmotion.formats.label_files import find_labels
from lipmotion.storage.archive import take_array
from lipmotion.storage.sources import AUDIO_SUFFIXES, check_regular
from lipmotion.types import WEIGHT, Channel, Motion
from lipmotion_faces.corpus.folder import RESEARCH, gather_recordings
from lipmotion_faces.corpus.source_recordings import LISTS, MotionFile, RecordingFolder, SourceRecording

KIND = "VOCASET meshes"
MESHES, SOUNDS = "unposedcleaneddata", "audio"
RATE_HZ = 60.0
RIGHTS = RESEARCH | {"attribution": "VOCASET (Cudeiro, Bolkart, Laidlaw, Ranjan, Black 2019)"}
MESH = ".ply"
FLAME_VERTICES = 5023
FLAME_MARKERS = {
    **{"EYE_L": 1162, "EYE_R": 2431, "NASION": 3553},
    **{"LIP_0": 3541, "LIP_13": 3533, "LIP_14": 3504, "LIP_17": 3511, "LIP_61": 2845, "LIP_291": 1730, "JAW_152": 3414},
}
"""Vertices at the outer eye corners, at the root of the nose, and at points of the face mesh, chosen by eye on a face
at rest: where the lips meet, the edges of their red, their corners, the chin."""
METRES = "m"
MAX_HEADER_BYTES = 1 << 14
MAX_MESH_BYTES = 1 << 26
MAX_MESHES = 1 << 20  # meshes of four hours
NUMBER = re.compile(r"(\d+)$")
PLY_TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"float": "f4", "double": "f8", "float32": "f4", "float64": "f8"},
}
PLY_BYTE_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}


def read_vocaset(directory: Path) -> RecordingFolder | None:
    """Return the recordings of a folder with the two folders of VOCASET, or None if it does not have them.

    ``audio/PERSON/sentence01.wav`` is the sound of ``unposedcleaneddata/PERSON/sentence01/*.ply``; labels lie beside
    the sound. The motion file is the first mesh.
    """
    meshes, sounds = directory / MESHES, directory / SOUNDS
    if not (meshes.is_dir() and sounds.is_dir()):
        return None

    def read_recording(name: str, sound: Path) -> SourceRecording:
        speaker, sentence = sound.parent.name, meshes / sound.parent.name / sound.stem
        first = min(sentence.glob(f"*{MESH}"), default=None)
        if first is None:
            raise InputError(f"{sentence}: no meshes (.ply) of {sound}; unpack them, or remove the sound")
        labels = find_labels(sound)
        return SourceRecording(
            name,
            sound,
            labels.words,
            rights=RIGHTS,
            speaker=speaker,
            phones=labels.phones,
            motion_file=MotionFile(first, RATE_HZ),
        )

    by_name = {f"{sound.parent.name}-{sound.stem}": [sound] for sound in sorted(sounds.glob("*/*.wav"))}
    return gather_recordings(KIND, by_name, read_recording, directory)


def list_mesh_files(first: Path) -> list[Path]:
    """Return the files of a mesh's sequence: all beside it whose names differ in the last number alone."""
    start = NUMBER.sub("", first.stem)
    return sorted(path for path in first.parent.glob(f"*{MESH}") if NUMBER.sub("", path.stem) == start)


def read_mesh_motion(first: Path, rate_hz: float) -> Motion:
    """Return lip distances and lip points of a sequence of meshes, in the head's frame, in eye distances.

    first   : one of its meshes; where numbers are missing, the motion is interpolated
    Raises InputError: a file that is no mesh with the vertices of FLAME, in metres.
    """
    files = list_mesh_files(first)
    numbers = [int(match[1]) if (match := NUMBER.search(path.stem)) else 1 for path in files]
    if not files or max(numbers) > MAX_MESHES:
        what = f"{len(files)} meshes up to number {max(numbers, default=0)}"
        raise InputError(f"{first}: {what}, required 1 to {MAX_MESHES}")
    vertices = list(FLAME_MARKERS.values())
    places = np.stack([read_vertices(path, vertices) for path in files])
    frames = np.arange(1, max(numbers) + 1)
    markers = {
        name: np.stack([np.interp(frames, numbers, axis) for axis in places[:, column].T], axis=1)
        for column, name in enumerate(FLAME_MARKERS)
    }
    try:
        return measure_markers(to_head_frame(markers, METRES), rate_hz)
    except InputError as error:
        raise InputError(f"{first}: {error}") from error


def read_vertices(path: Path, chosen: Sequence[int]) -> NDArray[np.float64]:
    """Return the places of some vertices of a ``.ply`` [shape=(N, 3)].

    Raises InputError: damaged, without ``x``, ``y``, ``z``, not finite, or not ``FLAME_VERTICES`` vertices.
    """
    size = path.stat().st_size
    if size > MAX_MESH_BYTES:
        raise InputError(f"{path}: {size} bytes, required at most {MAX_MESH_BYTES}: is it the mesh of a head?")
    head, mark, body = path.read_bytes().partition(b"end_header")
    lines = [line.split() for line in head[:MAX_HEADER_BYTES].decode("ascii", "replace").splitlines()]
    try:
        if lines[:1] != [["ply"]]:
            raise ValueError("its first line is not 'ply'")
        (order,) = (PLY_BYTE_ORDERS[words[1]] for words in lines if words[:1] == ["format"])  # empty: as text
        first, *others = [number for number, words in enumerate(lines) if words[:1] == ["element"]]
        _, element, count = lines[first]
        if element != "vertex" or int(count) != FLAME_VERTICES:
            wanted = f"{FLAME_VERTICES} vertices: of others, no lip points are known"
            raise ValueError(f"it begins with {count} of {element!r}, required {wanted}")
        properties = [words for words in lines[first + 1 : others[0] if others else None] if words[:1] == ["property"]]
        columns = [(name, PLY_TYPES[kind]) for _, kind, name in properties]
        if not mark:
            raise ValueError("its header has no end")
        body = body[body.index(b"\n") + 1 :]
        if order:
            rows = np.frombuffer(body, np.dtype([(name, order + kind) for name, kind in columns]), FLAME_VERTICES)
            places = np.stack([rows[axis][list(chosen)] for axis in "xyz"], axis=1).astype(np.float64)
        else:
            lines_of_text, names = body.split(b"\n", FLAME_VERTICES), [name for name, _ in columns]
            texts = [lines_of_text[vertex].split() for vertex in chosen]
            places = np.array([[float(row[names.index(axis)]) for axis in "xyz"] for row in texts])
    except (ValueError, KeyError, IndexError, TypeError) as error:
        raise InputError(f"{path}: not a mesh of FLAME in .ply ({shorten(str(error))}); export it again") from error
    if not np.isfinite(places).all():
        raise InputError(f"{path}: has vertices that are not finite; export it again")
    return places


FACEGOOD = "FACEGOOD blendshape weights"
NAMES_FILE, VALUES_PREFIX = "*_bs_name.npy", "bs_value_"
FACEGOOD_HZ = 30.0
MAX_LICENCE_CHARACTERS = 10_000  # a licence file is read so far for its name and its owner


def read_facegood(directory: Path) -> RecordingFolder | None:
    """Return the recordings of a folder of FACEGOOD, or None if it has no list of names or no arrays.

    Raises InputError: the list of names is damaged, or there are several.
    """
    arrays, lists = sorted(directory.glob(f"{VALUES_PREFIX}*.npy")), sorted(directory.glob(NAMES_FILE))
    if not arrays or not lists:
        return None
    if len(lists) > 1:
        raise InputError(f"{directory}: {len(lists)} lists of channel names ({NAMES_FILE}); keep the right one")
    channels = read_channels(lists[0])
    sounds: dict[str, list[Path]] = {}
    for path in directory.iterdir():
        if path.suffix.lower() in AUDIO_SUFFIXES:
            sounds.setdefault(path.stem, []).append(path)
    ignored, rights, licence = frozenset(directory / name for name in LISTS), dict[str, str](), directory / "LICENSE"
    if licence.is_file():
        with licence.open(encoding="utf-8", errors="replace") as file:
            lines = [line.strip() for line in file.read(MAX_LICENCE_CHARACTERS).splitlines() if line.strip()]
        owners = [line for line in lines if line.lower().startswith("copyright")]
        rights = dict(zip(("licence", "attribution"), (*lines[:1], *owners[:1]), strict=False))

    def read_recording(name: str, path: Path) -> SourceRecording:
        same_name = sounds.get(name, [])
        if len(same_name) != 1:
            raise InputError(f"{path}: {len(same_name)} sounds named {name}, required one: {name}.wav")
        labels, motion_file = find_labels(same_name[0], ignored=ignored), MotionFile(path, FACEGOOD_HZ, channels)
        return SourceRecording(
            name, same_name[0], labels.words, rights=rights, phones=labels.phones, motion_file=motion_file
        )

    by_name = {path.stem.removeprefix(VALUES_PREFIX): [path] for path in arrays}
    return gather_recordings(FACEGOOD, by_name, read_recording, directory)


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
    return Motion(values.astype(np.float64), motion_file.rate_hz or FACEGOOD_HZ, motion_file.channels)


def _load(path: Path) -> NDArray[Any]:
    """Return an array from a file, never pickled objects; NumPy's warning of Python 2's sizes (``116L``) is hidden."""
    check_regular(path, "array")
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Reading `.npy`", category=UserWarning)
            return take_array(path.read_bytes())
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: not an array of numbers or texts ({error}); save it with numpy.save") from error
