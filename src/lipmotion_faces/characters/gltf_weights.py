"""Animations of glTF as motion: the weights of morph targets, the expressions of a VRM animation, turns of the head.

Source: glTF 2.0 Specification, 3.11 and Appendix C (interpolation); VRMC_vrm_animation 1.0 (VRM Consortium): the
weight of an expression is the x of the translation of its node.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.expression import PREFIX
from lipmotion.errors import InputError
from lipmotion.formats.steady_rate import choose_columns, exact_rate
from lipmotion.meshes.model.mesh import ANGLES, HEAD, NECK, find_head_angles
from lipmotion.meshes.model.shape_names import ARKIT_MOUTH, VRM_EMOTIONS, find_spoken_name, to_arkit
from lipmotion.types import WEIGHT, Channel, Motion, Timeline, Unit
from lipmotion.types.delivery import MOODS
from lipmotion.types.motion import RADIAN
from lipmotion_faces.characters.gltf_document import (
    GltfArrays,
    GltfDocument,
    clean_name,
    find_bone_kind,
    place_nodes,
    read_gltf_document,
)
from lipmotion_faces.characters.gltf_scene import name_mesh_targets

Array = NDArray[np.float64]
LOG = logging.getLogger("lipmotion")
STEP, CUBIC = "STEP", "CUBICSPLINE"
SAMPLED_HZ = 60.0  # frames a second where the keys are not even
EVEN_SHARE = 0.02  # keys are even where steps differ by no more than this share of one
SLOWEST_HZ = 10.0  # even keys further apart are those of an animator, not frames
LONGEST_S = 86_400.0
ROUNDING_FRAMES = 0.01  # times are in single precision: a key may be that much beside its frame
KNOWN_AS = {
    "blink": ("eyeBlinkLeft", "eyeBlinkRight"),
    "blinkLeft": ("eyeBlinkLeft",),
    "blinkRight": ("eyeBlinkRight",),
    **{mood: (PREFIX + mood,) for mood in MOODS if mood in VRM_EMOTIONS},
}
"""Expressions of VRM that are blendshapes of ARKit, or moods."""
STILL = 0.01  # weights that change by no more than this do not move
_POINTER = re.compile(r"/(nodes|meshes)/(\d{1,9})/(weights|rotation|translation)(/\d{1,9})?", re.ASCII)
QUATERNION = ("x", "y", "z", "w")
TURNING = (NECK, HEAD)  # the bones whose turns, one after the other, are those of the head


@dataclass(frozen=True, eq=False)
class _Track:
    """Curves of one channel of an animation: K times, and keys [shape=(K, S); of splines (K, 3, S)]."""

    names: tuple[str, ...]
    time_s: Array
    keys: Array
    kind: str

    def sample(self, time_s: Array) -> Array:
        """Return values at frames' times [shape=(len(time_s), S)]; a frame that is nearly a key has its value."""
        rounding = ROUNDING_FRAMES * time_s[1] if len(time_s) > 1 else 0.0
        before = np.clip(np.searchsorted(self.time_s, time_s + rounding, "right") - 1, 0, len(self.time_s) - 1)
        inside = np.where(np.abs(self.time_s[before] - time_s) <= rounding, self.time_s[before], time_s)
        inside = np.clip(inside, self.time_s[0], self.time_s[-1])
        after = np.minimum(before + 1, len(self.time_s) - 1)
        if self.kind == STEP:
            return np.asarray(self.keys[before])
        step = np.maximum(self.time_s[after] - self.time_s[before], 1e-9)
        share = ((inside - self.time_s[before]) / step)[:, None]
        if self.kind != CUBIC:
            return np.asarray((1 - share) * self.keys[before] + share * self.keys[after])
        leaving, arriving = step[:, None] * self.keys[before, 2], step[:, None] * self.keys[after, 0]
        first, last = self.keys[before, 1], self.keys[after, 1]
        square, cube = share**2, share**3
        return np.asarray(
            (2 * cube - 3 * square + 1) * first
            + (cube - 2 * square + share) * leaving
            + (3 * square - 2 * cube) * last
            + (cube - square) * arriving
        )


def read_gltf_motion(path: Path) -> tuple[Motion, Timeline[Unit]]:
    """Return the first animation of a file that moves a mouth, or else a face, as weights; an empty timeline.

    Channels have the names of the targets; of several meshes with one name the one that moves most counts. Keys that
    are even are the frames, others are sampled 60 times a second, from 0 on. A warning names other animations.
    Raises InputError: the file is damaged or too large, or it has no such animation.
    """
    document = read_gltf_document(path)
    arrays = GltfArrays(document)
    animation, tracks = _choose_animation(document, arrays, path)
    turns = _read_turns(document, arrays, animation)
    longest = max(tracks, key=lambda track: len(track.time_s))
    end_s = max(float(track.time_s[-1]) for track in tracks)
    hertz = _find_rate(longest.time_s)
    count = int(np.floor(end_s * hertz + ROUNDING_FRAMES)) + 1
    document.budget.spend("numbers", count * sum(len(track.names) for track in tracks))
    time_s = np.arange(count) / hertz
    every = [
        (known, curve)
        for track in tracks
        for name, curve in zip(track.names, track.sample(time_s).T, strict=True)
        for known in KNOWN_AS.get(name, (name,))
    ]
    columns = choose_columns([to_arkit(name) or name for name, _ in every], np.stack([row for _, row in every], 1))
    curves = dict(every[column] for column in columns)
    channels = [Channel(name, WEIGHT) for name in curves]
    if turns:
        angles = np.unwrap(find_head_angles(_turn_head(document, turns, time_s)), axis=0)
        curves |= dict(zip(ANGLES, angles.T, strict=True))
        channels += [Channel(name, RADIAN) for name in ANGLES]
    return Motion(np.stack(list(curves.values()), axis=1), hertz, tuple(channels)), Timeline(())


def _choose_animation(document: GltfDocument, arrays: GltfArrays, path: Path) -> tuple[dict[str, Any], list[_Track]]:
    """Return the first animation that moves a mouth, or else a face, and its tracks; warn of others."""
    animations = [
        (each, tracks) for each in document.get("animations") if (tracks := list(_read_tracks(document, arrays, each)))
    ]
    if not animations:
        raise InputError("it has no animation of morph targets or expressions; export the animation with the character")

    def moves_mouth(track: _Track) -> bool:
        keys = track.keys[:, 1] if track.kind == CUBIC else track.keys
        mouth = [find_spoken_name(name) is not None or to_arkit(name) in ARKIT_MOUTH for name in track.names]
        return bool((np.ptp(keys, axis=0) > STILL)[mouth].any())

    which = next((n for n, (_, tracks) in enumerate(animations) if any(map(moves_mouth, tracks))), 0)
    if len(animations) > 1:
        named = [clean_name(each.get("name", "")) or "without a name" for each, _ in animations]
        listed = ", ".join(named)
        LOG.warning("%s: %d animations move the face: %s; read: %s", path, len(named), listed, named[which])
    return animations[which]


def _read_turns(document: GltfDocument, arrays: GltfArrays, animation: dict[str, Any]) -> dict[int, _Track]:
    """Return the rotations of the first neck and the first head, in this order, by the numbers of their nodes."""
    turns: dict[str, tuple[int, _Track]] = {}
    for number, target, sampler in _list_targets(document, animation):
        kind = find_bone_kind(document.get("nodes")[number].get("name", ""))
        if target == "rotation" and kind in TURNING and kind not in turns:
            turns[kind] = number, _track(arrays, sampler, QUATERNION, 4)
    return dict(turns[kind] for kind in TURNING if kind in turns)


def _turn_head(document: GltfDocument, turns: Mapping[int, _Track], time_s: Array) -> Array:
    """Return how the head is turned against its rest pose, in the axes of the scene, as quaternions [shape=(T, 4)]."""
    from scipy.spatial.transform import Rotation

    placed, turned = place_nodes(document), Rotation.identity()
    try:
        for number, track in turns.items():
            if number in placed:
                local = Rotation.from_quat(document.get("nodes")[number].get("rotation", (0.0, 0.0, 0.0, 1.0)))
                at_rest = Rotation.from_matrix(placed[number].matrix[:3, :3])
                turned = turned * (at_rest * local.inv() * Rotation.from_quat(track.sample(time_s)) * at_rest.inv())
    except ValueError as error:  # a quaternion of zeros, a bone without size
        raise InputError(f"a rotation of the head is none ({error}); export the animation again") from error
    return np.asarray(np.broadcast_to(turned.as_quat(), (len(time_s), 4)))


def _find_rate(time_s: Array) -> float:
    """Return the frames a second of even keys that begin at 0, else ``SAMPLED_HZ``."""
    steps = np.diff(time_s)
    if len(steps) < 2 or time_s[0] > steps[0] * EVEN_SHARE or np.ptp(steps) > EVEN_SHARE * steps.mean():
        return SAMPLED_HZ
    hertz = float(len(steps) / (time_s[-1] - time_s[0]))
    return exact_rate(round(hertz, 3), 1e-3) if hertz >= SLOWEST_HZ else SAMPLED_HZ


def _list_targets(document: GltfDocument, animation: dict[str, Any]) -> Iterator[tuple[int, str, dict[str, Any]]]:
    """Yield the node, the path and the sampler of every channel of an animation that has keys."""
    samplers = animation.get("samplers", [])
    for channel in animation.get("channels", []):
        target, number = channel.get("target", {}), channel.get("sampler", -1)
        node, path = target.get("node", -1), target.get("path", "")
        pointer = _POINTER.fullmatch(target.get("extensions", {}).get("KHR_animation_pointer", {}).get("pointer", ""))
        if path == "pointer" and pointer:
            node, path = int(pointer[2]), pointer[3] + (pointer[4] or "")
            if pointer[1] == "meshes":
                node = next((n for n, each in enumerate(document.get("nodes")) if each.get("mesh") == node), -1)
        if (
            0 <= number < len(samplers)
            and 0 <= node < len(document.get("nodes"))
            and {"input", "output"} <= samplers[number].keys()
        ):
            yield node, path, samplers[number]


def _read_tracks(document: GltfDocument, arrays: GltfArrays, animation: dict[str, Any]) -> Iterator[_Track]:
    """Yield what moves a face in an animation. Raises InputError: its keys are damaged."""
    stored = document.parts.get("extensions", {}).get("VRMC_vrm_animation", {}).get("expressions", {})
    expressions = {
        each["node"]: clean_name(name)
        for kind in ("preset", "custom")
        for name, each in stored.get(kind, {}).items()
        if "node" in each
    }
    for node, path, sampler in _list_targets(document, animation):
        if path.startswith("weights"):
            owner, one = document.get("nodes")[node].get("mesh", -1), path.partition("/")[2]
            names = name_mesh_targets(document, document.get("meshes")[owner]) if owner >= 0 else ()
            names = names[int(one) :][:1] if one else names
            if names:
                yield _track(arrays, sampler, names, 1)
        elif path == "translation" and node in expressions:
            yield _track(arrays, sampler, (expressions[node],), 3)


def _track(arrays: GltfArrays, sampler: dict[str, Any], names: tuple[str, ...], width: int) -> _Track:
    """Return the keys of a sampler; of vectors (``width`` 3) the first numbers, of quaternions (4) all."""
    times = arrays.read_floats(sampler["input"], 1)[:, 0]
    if not len(times) or not 0 <= times[0] <= times[-1] <= LONGEST_S or not (np.diff(times) > 0).all():
        raise InputError("the times of an animation do not rise from 0 on, within a day; export it again")
    kind, turns = sampler.get("interpolation", "LINEAR"), width == len(QUATERNION)
    rows = (3 if kind == CUBIC else 1) * (1 if turns else len(names))
    values = arrays.read_floats(sampler["output"], width, rows * len(times))[:, : width if turns else 1]
    shape = (len(times), 3, len(names)) if kind == CUBIC else (len(times), len(names))
    return _Track(names, times, values.reshape(shape), kind)
