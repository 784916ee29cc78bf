"""``.vmd``: a motion of MikuMikuDance: the morphs あ い う え お ん, blinks, brows, and the turns of head and eyes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from lipmotion.errors import InputError
from lipmotion.export.base import MotionFormat
from lipmotion.export.motion.keys import key_frames
from lipmotion.export.motion.vmd_file import RATE_HZ, Turns, VmdFile, read_vmd, write_vmd
from lipmotion.meshes.fitting.eyes_and_brows import MOVED_BY, gaze_weights, given_gaze
from lipmotion.meshes.model.head_angles import ANGLES, head_angles, head_quaternions
from lipmotion.meshes.model.other_shapes import CLOSED
from lipmotion.meshes.model.shape_names import ARKIT_MOUTH, VRM_VOWELS, arkit_name, vowel_name
from lipmotion.types import WEIGHT, Channel, Generation, Motion, Timeline, Unit
from lipmotion.types.motion import RADIAN

MORPHS: Mapping[str, tuple[str, ...]] = {
    "あ": ("aa",),
    "い": ("ih",),
    "う": ("ou",),
    "え": ("ee",),
    "お": ("oh",),
    "ん": (CLOSED,),
    "まばたき": ("eyeBlinkLeft", "eyeBlinkRight"),
    "上": ("browInnerUp",),
    "下": ("browDownLeft", "browDownRight"),
    "びっくり": ("eyeWideLeft", "eyeWideRight"),
}
"""The standard morphs of models, and the channels whose mean each is: vowels, pressed lips, blinks, raised brows; of
moods, lowered brows and wide eyes."""
HEAD, EYES = "頭", "両目"
"""The bones of the head, and of both eyes."""
MIRRORED = np.array([-1.0, -1.0, 1.0, 1.0])
"""Signs that turn a rotation of glTF's axes into one of MikuMikuDance's, whose z goes into the face, and back."""
TOLERANCE = 1e-7
"""Keys are left out where a straight line is that near."""


def write(path: Path, generation: Generation, _source: Mapping[str, str], _model: Mapping[str, str]) -> None:
    """Write keys of the morphs and of the head whose channels the motion has, in 30ths of a second."""
    motion = generation.motion
    time_s = motion.time_s
    frames = np.rint(time_s * RATE_HZ).astype(int).tolist()
    morphs = {}
    for morph, sources in MORPHS.items():
        if all(name in motion.names for name in sources):
            values = np.mean([motion[name] for name in sources], axis=0)
            stepped = bool({*sources} & {*generation.stepped})
            kept = key_frames(time_s, values, TOLERANCE, stepped=stepped)
            if stepped:  # between keys everything is linear
                kept = sorted({*kept, *(frame - 1 for frame in kept if frame)})
            morphs[morph] = [(frames[frame], float(values[frame])) for frame in kept]
    bones = {}
    for bone, angles in _angles(motion).items():
        turned = head_quaternions(angles) * MIRRORED
        turns: Turns = [(frame, (x, y, z, w)) for frame, (x, y, z, w) in zip(frames, turned.tolist(), strict=True)]
        bones[bone] = turns
    write_vmd(path, VmdFile(morphs, bones), "lipmotion")


def _angles(motion: Motion) -> dict[str, np.ndarray]:
    """Return the angles of the bones that a motion turns, as of ``head_quaternions`` [each shape=(T, 3)]."""
    curves = {name: motion[name].astype(np.float64) for name in (*ANGLES, *MOVED_BY["gaze"]) if name in motion.names}
    found = {}
    if {*ANGLES} <= {*curves}:
        found[HEAD] = np.stack([curves[name] for name in ANGLES], axis=1)
    if {*MOVED_BY["gaze"]} & {*curves}:
        still = dict.fromkeys(MOVED_BY["gaze"], np.zeros(len(motion.values)))
        found[EYES] = np.pad(given_gaze(still | curves), ((0, 0), (0, 1)))
    return found


def read(path: Path) -> tuple[Motion, Timeline[Unit]]:
    """Return the vowels, blinks, brows, gaze and head's angles of a file at 30 frames a second; an empty timeline.

    Weights are linear between keys, and constant before the first and after the last one. Raises InputError: no motion
    of MikuMikuDance, or none of its morphs is one of the mouth.
    """
    file = read_vmd(path, lambda name: bool(_channels(name)) or name in {HEAD, EYES})
    moved = {name for morph in file.morphs for name in _channels(morph)}
    if not moved & {*VRM_VOWELS, *ARKIT_MOUTH}:
        morphs = ", ".join([*file.morphs][:8]) or "none"
        raise InputError(
            f"the motion has none of the morphs あ い う え お; its morphs are: {morphs}; "
            f"it moves {len(file.bones)} bones and has {file.camera} keys of a camera; save the motion of the face"
        )
    last = max(keys[-1][0] for keys in (*file.morphs.values(), *file.bones.values()))
    frames = np.arange(last + 1)
    curves: dict[str, tuple[np.ndarray, str]] = {}
    for morph, keys in sorted(file.morphs.items(), key=lambda each: each[0] not in MORPHS):
        at, values = zip(*keys, strict=True)
        for name in _channels(morph):
            curves.setdefault(name, (np.interp(frames, at, values), WEIGHT))
    if HEAD in file.bones:
        curves |= {name: (curve, RADIAN) for name, curve in zip(ANGLES, _turned(file, HEAD, frames).T, strict=True)}
    if EYES in file.bones:
        looks = gaze_weights(_turned(file, EYES, frames)[:, :2])
        curves |= {name: (curve, WEIGHT) for name, curve in looks.items()}
    table = np.stack([curve for curve, _ in curves.values()], axis=1)
    return Motion(table, RATE_HZ, tuple(Channel(name, unit) for name, (_, unit) in curves.items())), Timeline(())


def _channels(morph: str) -> tuple[str, ...]:
    """Return the channels that a morph moves: a standard one, or a vowel or blendshape by its name; none of others."""
    known = vowel_name(morph) or arkit_name(morph)
    return MORPHS.get(morph, (known,) if known else ())


def _turned(file: VmdFile, bone: str, frames: np.ndarray) -> np.ndarray:
    """Return the angles of a bone at some frames [shape=(T, 3)]. Raises InputError: a rotation is none."""
    at, turns = zip(*file.bones[bone], strict=True)
    if not all(map(any, turns)):
        raise InputError(f"a rotation of the bone {bone} is none (0 0 0 0); save the motion again in MikuMikuDance")
    angles = np.unwrap(head_angles(np.array(turns) * MIRRORED), axis=0)
    return np.stack([np.interp(frames, at, column) for column in angles.T], axis=1)


MOTION_FORMAT = MotionFormat(write, read, curves="vowels", rate_hz=RATE_HZ, fixed_rate=True, keyed=True)
