"""``.vmd``: a motion of MikuMikuDance: the morphs あ い う え お ん, blinks, brows, and the turns of head and eyes.

Source: the layout as MikuMikuDance 9 writes it: a header, then counted lists of keys of bones (name, frame, place,
rotation, 64 bytes of interpolation), of morphs (name, frame, weight), of the camera, of lights and of shadows, 30
frames a second. Names are in Shift JIS, or as other countries' programs write them. Camera, lights and shadows are
passed over, and between keys of bones everything is linear.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from lipmotion.errors import InputError, shorten_list
from lipmotion.formats.base import LOG, MotionFormat, list_key_frames
from lipmotion.meshes.fitting.eyes_and_brows import MOVED_BY, gaze_to_weights, weights_to_gaze
from lipmotion.meshes.model.mesh import ANGLES, find_head_angles, turn_head
from lipmotion.meshes.model.shape_names import ARKIT_MOUTH, VRM_VOWELS, find_vowel, to_arkit
from lipmotion.types import WEIGHT, Channel, Generation, Motion, Timeline, Unit
from lipmotion.types.motion import RADIAN
from lipmotion.units.spelling import read_table

Keys = Sequence[tuple[int, float]]  # frames and values
Turns = Sequence[tuple[int, tuple[float, float, float, float]]]  # frames and rotations, as quaternions x, y, z, w
RATE_HZ = 30.0
MARK, OLD_MARK = b"Vocaloid Motion Data 0002", b"Vocaloid Motion Data file"
MARK_BYTES, MODEL_BYTES, OLD_MODEL_BYTES = 30, 20, 10
ENCODING = "cp932"
ENCODINGS = (ENCODING, "gb18030", "euc_jp", "utf-8", "big5", "euc_kr")
"""Encodings of names, the usual one first: programs in other countries write their own."""
BONE_KEY, MORPH_KEY, COUNT = struct.Struct("<15sI3f4f64s"), struct.Struct("<15sIf"), struct.Struct("<I")
LINEAR = bytes.fromhex(
    "14140000" + "14" * 4 + "6b" * 8 + "".join("14" * n + "6b" * 8 + "00" * (8 - n) for n in (7, 6, 5))
)
"""The bytes of a bone's key that say: straight on to the next one."""
LAST_FRAME = 86_400 * 30  # frames of a day
MORPHS = {morph: tuple(channels.split()) for morph, channels in read_table("vmd_morphs").items()}
"""The standard morphs of models, and the channels whose mean each is: vowels, pressed lips, blinks, raised brows; of
moods, lowered brows and wide eyes."""
HEAD, EYES = "頭", "両目"  # the bones of the head, and of both eyes
MIRRORED = np.array([-1.0, -1.0, 1.0, 1.0])
"""Signs that turn a rotation of glTF's axes into one of MikuMikuDance's, whose z goes into the face, and back."""
TOLERANCE = 1e-7  # keys are left out where a straight line is that near


def write(path: Path, generation: Generation, _source: Mapping[str, str], _model: Mapping[str, str]) -> None:
    """Write keys of the morphs and of the head whose channels the motion has, in 30ths of a second."""
    motion = generation.motion
    time_s = motion.time_s
    frames = np.rint(time_s * RATE_HZ).astype(int).tolist()
    morphs: list[tuple[int, str, float]] = []
    for morph, sources in MORPHS.items():
        if all(name in motion.names for name in sources):
            values = np.mean([motion[name] for name in sources], axis=0)
            stepped = bool({*sources} & {*generation.stepped})
            keys = list_key_frames(time_s, values, TOLERANCE, stepped=stepped)
            if stepped:  # between keys everything is linear
                keys = sorted({*keys, *(frame - 1 for frame in keys if frame)})
            morphs += [(frames[frame], morph, float(values[frame])) for frame in keys]
    curves = {name: motion[name].astype(np.float64) for name in (*ANGLES, *MOVED_BY["gaze"]) if name in motion.names}
    angles = {}
    if {*ANGLES} <= {*curves}:
        angles[HEAD] = np.stack([curves[name] for name in ANGLES], axis=1)
    if {*MOVED_BY["gaze"]} & {*curves}:
        still = dict.fromkeys(MOVED_BY["gaze"], np.zeros(len(motion.values)))
        angles[EYES] = np.pad(weights_to_gaze(still | curves), ((0, 0), (0, 1)))
    turns = {bone: (turn_head(turned) * MIRRORED).tolist() for bone, turned in angles.items()}
    bones = [(frame, bone, turn[row]) for row, frame in enumerate(frames) for bone, turn in turns.items()]
    with path.open("wb") as file:
        file.write(MARK.ljust(MARK_BYTES, b"\0") + _encode_name("lipmotion", MODEL_BYTES) + COUNT.pack(len(bones)))
        for frame, bone, turn in bones:
            file.write(BONE_KEY.pack(_encode_name(bone, 15), frame, 0, 0, 0, *turn, LINEAR))
        file.write(COUNT.pack(len(morphs)))
        for frame, morph, value in sorted(morphs, key=lambda key: key[0]):
            file.write(MORPH_KEY.pack(_encode_name(morph, 15), frame, value))
        file.write(4 * COUNT.pack(0))  # camera, lights, shadows, and what newer versions hold of inverse kinematics


def read(path: Path) -> tuple[Motion, Timeline[Unit]]:
    """Return the vowels, blinks, brows, gaze and head's angles of a file at 30 frames a second; an empty timeline.

    Weights are linear between keys, and constant before the first and after the last one. Raises InputError: no motion
    of MikuMikuDance, or none of its morphs is one of the mouth.
    """
    morphs, bones, camera = _read_keys(path, lambda name: bool(_find_channels(name)) or name in {HEAD, EYES})
    channels = {name for morph in morphs for name in _find_channels(morph)}
    if not channels & {*VRM_VOWELS, *ARKIT_MOUTH}:
        named = ", ".join([*morphs][:8]) or "none"
        what = f"the motion has none of the morphs あ い う え お; its morphs are: {named}; it moves {len(bones)} bones"
        raise InputError(f"{what} and has {camera} keys of a camera; save the motion of the face")
    unread = [morph for morph, keys in morphs.items() if not _find_channels(morph) and any(value for _, value in keys)]
    if unread:
        LOG.warning("%s: %d morphs that move are not known: %s", path, len(unread), shorten_list(unread, 8))
    frames = np.arange(max(keys[-1][0] for keys in (*morphs.values(), *bones.values())) + 1)
    curves: dict[str, tuple[np.ndarray, str]] = {}
    for morph, keys in sorted(morphs.items(), key=lambda each: each[0] not in MORPHS):
        at, values = zip(*keys, strict=True)
        for name in _find_channels(morph):
            curves.setdefault(name, (np.interp(frames, at, values), WEIGHT))
    if HEAD in bones:
        turned = _turn_bone(HEAD, bones[HEAD], frames)
        curves |= {name: (curve, RADIAN) for name, curve in zip(ANGLES, turned.T, strict=True)}
    if EYES in bones:
        looks = gaze_to_weights(_turn_bone(EYES, bones[EYES], frames)[:, :2])
        curves |= {name: (curve, WEIGHT) for name, curve in looks.items()}
    table = np.stack([curve for curve, _ in curves.values()], axis=1)
    return Motion(table, RATE_HZ, tuple(Channel(name, unit) for name, (_, unit) in curves.items())), Timeline(())


def _find_channels(morph: str) -> tuple[str, ...]:
    """Return the channels that a morph moves: a standard one, or a vowel or blendshape by its name; none of others."""
    known = find_vowel(morph) or to_arkit(morph)
    return MORPHS.get(morph, (known,) if known else ())


def _turn_bone(bone: str, keys: Turns, frames: np.ndarray) -> np.ndarray:
    """Return the angles of a bone at some frames [shape=(T, 3)]. Raises InputError: a rotation is none."""
    at, turns = zip(*keys, strict=True)
    if not all(map(any, turns)):
        raise InputError(f"a rotation of the bone {bone} is none (0 0 0 0); save the motion again in MikuMikuDance")
    angles = np.unwrap(find_head_angles(np.array(turns) * MIRRORED), axis=0)
    return np.stack([np.interp(frames, at, column) for column in angles.T], axis=1)


def _encode_name(name: str, size: int) -> bytes:
    """Return a name in Shift JIS in so many bytes, cut between letters."""
    while len(name.encode(ENCODING, "replace")) > size:
        name = name[:-1]
    return name.encode(ENCODING, "replace").ljust(size, b"\0")


def _read_keys(path: Path, is_known: Callable[[str], bool]) -> tuple[Mapping[str, Keys], Mapping[str, Turns], int]:
    """Return the keys of morphs and bones by their names, in order, and the number of the camera's."""
    content = path.read_bytes()
    model_bytes = MODEL_BYTES if content.startswith(MARK) else OLD_MODEL_BYTES
    if not content.startswith((MARK, OLD_MARK)):
        raise InputError("not a motion of MikuMikuDance: its first bytes are not those of the format; save it again")
    at = MARK_BYTES + model_bytes
    bones: dict[bytes, dict[int, tuple[float, float, float, float]]] = {}
    morphs: dict[bytes, dict[int, float]] = {}
    camera = 0
    for name, frame, (_, _, _, x, y, z, w) in _unpack_keys(content, at, BONE_KEY):
        bones.setdefault(name, {})[frame] = (x, y, z, w)
    at += COUNT.size + COUNT.unpack_from(content, at)[0] * BONE_KEY.size
    for name, frame, (value,) in _unpack_keys(content, at, MORPH_KEY) if at < len(content) else ():
        morphs.setdefault(name, {})[frame] = value
    if at < len(content):
        at += COUNT.size + COUNT.unpack_from(content, at)[0] * MORPH_KEY.size
        camera = COUNT.unpack_from(content, at)[0] if at + COUNT.size <= len(content) else 0

    def judge(encoding: str) -> tuple[int, int]:  # how many names it makes known, and minus the letters it cannot read
        texts = [name.decode(encoding, "replace") for name in (*morphs, *bones)]
        return sum(map(is_known, texts)), -sum(text.count("\ufffd") for text in texts)

    encoding = max(ENCODINGS, key=judge)
    named_morphs = {name.decode(encoding, "replace"): sorted(keys.items()) for name, keys in morphs.items()}
    named_bones = {name.decode(encoding, "replace"): sorted(keys.items()) for name, keys in bones.items()}
    return named_morphs, named_bones, camera


def _unpack_keys(content: bytes, at: int, form: struct.Struct) -> Iterator[tuple[bytes, int, list[float]]]:
    """Yield the name of each key of a counted list, its frame and its numbers. Raises InputError: cut short."""
    (count,) = COUNT.unpack_from(content, at)
    if count * form.size > len(content) - at - COUNT.size:
        raise InputError("the motion of MikuMikuDance is cut short; save it again")
    for raw, frame, *values in form.iter_unpack(content[at + COUNT.size : at + COUNT.size + count * form.size]):
        name = raw.partition(b"\0")[0]
        numbers = [value for value in values if isinstance(value, float)]
        if frame > LAST_FRAME or not np.isfinite(numbers).all():
            text = name.decode(ENCODING, "replace")
            raise InputError(f"a key of {text!r} at frame {frame} is none; save the motion again in MikuMikuDance")
        yield name, frame, numbers


MOTION_FORMAT = MotionFormat(
    write, read, curves="vowels", rate_hz=RATE_HZ, fixed_rate=True, keyed=True, max_bytes=1 << 28
)
