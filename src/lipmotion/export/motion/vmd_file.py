"""The binary format VMD of MikuMikuDance: keys of morphs and of bones, 30 frames a second.

Source: the layout as MikuMikuDance 9 writes it: a header, then counted lists of keys of bones (name, frame, place,
rotation, 64 bytes of interpolation), of morphs (name, frame, weight), of the camera, of lights and of shadows. Names
are in Shift JIS, or as other countries' programs write them. Camera, lights and shadows are passed over, and between
keys of bones everything is linear.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError

Array = NDArray[np.float64]
Keys = Sequence[tuple[int, float]]
"""Frames and values."""
Turns = Sequence[tuple[int, tuple[float, float, float, float]]]
"""Frames and rotations, as quaternions x, y, z, w."""

RATE_HZ = 30.0
MARK, OLD_MARK = b"Vocaloid Motion Data 0002", b"Vocaloid Motion Data file"
MARK_BYTES, MODEL_BYTES, OLD_MODEL_BYTES = 30, 20, 10
ENCODING = "cp932"
ENCODINGS = (ENCODING, "gb18030", "euc_jp", "utf-8", "big5", "euc_kr")
"""Encodings of names, the usual one first: programs in other countries write their own."""
BONE_KEY, MORPH_KEY, COUNT = struct.Struct("<15sI3f4f64s"), struct.Struct("<15sIf"), struct.Struct("<I")
_SLOW, _FAST = bytes([20]), bytes([107])
LINEAR = (
    *(_SLOW * 2 + bytes(2) + _SLOW * 4 + _FAST * 8),
    *(_SLOW * 7 + _FAST * 8 + bytes(1)),
    *(_SLOW * 6 + _FAST * 8 + bytes(2)),
    *(_SLOW * 5 + _FAST * 8 + bytes(3)),
)
"""The bytes of a bone's key that say: straight on to the next one."""
LARGEST_FILE_BYTES = 1 << 28
LAST_FRAME = 86_400 * 30
"""Frames of a day."""


@dataclass(frozen=True)
class VmdFile:
    """What a VMD file holds of a face: keys of morphs, and rotations of bones, by their names, in order of time.

    camera : number of keys of the camera
    """

    morphs: Mapping[str, Keys]
    bones: Mapping[str, Turns]
    camera: int = 0


def write_vmd(path: Path, file: VmdFile, model: str) -> None:
    """Write keys to a file; ``model``: the name of the model, of which 20 bytes are kept."""
    bones = [(frame, name, turn) for name, keys in file.bones.items() for frame, turn in keys]
    morphs = [(frame, name, value) for name, keys in file.morphs.items() for frame, value in keys]
    with path.open("wb") as written:
        written.write(MARK.ljust(MARK_BYTES, b"\0") + _named(model, MODEL_BYTES) + COUNT.pack(len(bones)))
        for frame, name, turn in sorted(bones, key=lambda key: key[0]):
            written.write(BONE_KEY.pack(_named(name, 15), frame, 0, 0, 0, *turn, bytes(LINEAR)))
        written.write(COUNT.pack(len(morphs)))
        for frame, name, value in sorted(morphs, key=lambda key: key[0]):
            written.write(MORPH_KEY.pack(_named(name, 15), frame, value))
        written.write(4 * COUNT.pack(0))  # camera, lights, shadows, and what newer versions hold of inverse kinematics


def _named(name: str, size: int) -> bytes:
    """Return a name in Shift JIS in so many bytes, cut between letters."""
    kept = name.encode(ENCODING, "replace")
    while len(kept) > size:
        name = name[:-1]
        kept = name.encode(ENCODING, "replace")
    return kept.ljust(size, b"\0")


def read_vmd(path: Path, is_known: Callable[[str], bool]) -> VmdFile:
    """Return the keys of a file. Of several keys of one frame, the last counts.

    is_known : whether a name means something: that shows the encoding of all names
    Raises InputError: not a VMD file, too large, cut short, or a value that is not finite.
    """
    size = path.stat().st_size
    if size > LARGEST_FILE_BYTES:
        raise InputError(f"{size} bytes, required at most {LARGEST_FILE_BYTES}: divide the motion")
    content = path.read_bytes()
    model_bytes = MODEL_BYTES if content.startswith(MARK) else OLD_MODEL_BYTES
    if not content.startswith((MARK, OLD_MARK)):
        raise InputError("not a motion of MikuMikuDance: its first bytes are not those of the format; save it again")
    at = MARK_BYTES + model_bytes
    bones: dict[bytes, dict[int, tuple[float, float, float, float]]] = {}
    morphs: dict[bytes, dict[int, float]] = {}
    camera = 0
    try:
        for name, frame, (_, _, _, x, y, z, w) in _keys(content, at, BONE_KEY):
            bones.setdefault(name, {})[frame] = (x, y, z, w)
        at += COUNT.size + COUNT.unpack_from(content, at)[0] * BONE_KEY.size
        for name, frame, (value,) in _keys(content, at, MORPH_KEY) if at < len(content) else ():
            morphs.setdefault(name, {})[frame] = value
        if at < len(content):
            at += COUNT.size + COUNT.unpack_from(content, at)[0] * MORPH_KEY.size
            camera = COUNT.unpack_from(content, at)[0] if at + COUNT.size <= len(content) else 0
    except struct.error as error:
        raise InputError("the motion of MikuMikuDance is cut short; save it again") from error
    encoding = max(ENCODINGS, key=lambda each: _understood((*morphs, *bones), each, is_known))
    return VmdFile(
        {name.decode(encoding, "replace"): sorted(keys.items()) for name, keys in morphs.items()},
        {name.decode(encoding, "replace"): sorted(keys.items()) for name, keys in bones.items()},
        camera,
    )


def _understood(names: Iterable[bytes], encoding: str, is_known: Callable[[str], bool]) -> tuple[int, int]:
    """Return how many names an encoding makes known ones, and minus how many letters it cannot read."""
    texts = [name.decode(encoding, "replace") for name in names]
    return sum(map(is_known, texts)), -sum(text.count("\ufffd") for text in texts)


def _keys(content: bytes, at: int, form: struct.Struct) -> Iterator[tuple[bytes, int, list[float]]]:
    """Yield the name of each key of a counted list, its frame and its numbers.

    Raises struct.error: it is cut short. Raises InputError: a frame of another day, or a value that is not finite.
    """
    (count,) = COUNT.unpack_from(content, at)
    if count * form.size > len(content) - at - COUNT.size:
        raise struct.error
    for raw, frame, *values in form.iter_unpack(content[at + COUNT.size : at + COUNT.size + count * form.size]):
        name = raw.partition(b"\0")[0]
        numbers = [value for value in values if isinstance(value, float)]
        if frame > LAST_FRAME or not np.isfinite(numbers).all():
            text = name.decode(ENCODING, "replace")
            raise InputError(f"a key of {text!r} at frame {frame} is none; save the motion again in MikuMikuDance")
        yield name, frame, numbers
