"""Faces of the page: meshes with morph targets as ``.glb``, and the numbers that move them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from lipmotion.articulation.expression import is_mood, with_moods
from lipmotion.errors import InputError, shorten
from lipmotion.pipeline.outputs.output import OutputSettings, ShownFace
from lipmotion.storage.locks import open_temporary
from lipmotion.types import FRAME_RATE_HZ, Channel, Generation, Motion, StateTrace, Timeline
from lipmotion.types.delivery import MOODS, MoodKey
from lipmotion_faces.characters.character_files import load_character
from lipmotion_faces.characters.file_limits import Budget
from lipmotion_faces.characters.scene import Scene
from lipmotion_faces.filmed.face import SUFFIX
from lipmotion_faces.mesh import MeshFace
from lipmotion_faces.outputs.scenes import ANIMATED_SUFFIXES, build_head_scene, write_scene
from lipmotion_faces.outputs.shown_faces import shown_face
from lipmotion_faces.registry import FACES

HEAD, HEAD_OF_MOODS = "head", "head-moods"
"""The 3D head, and the same with the shapes of moods: motion that has moods moves the second one."""
TURN = tuple(f"head.rotation.{axis}" for axis in "xyzw")
"""Names of the numbers of a quaternion that turns the head."""


class Faces:
    """The faces of a project by name: built in, its own characters, and filmed faces, also those made here."""

    def __init__(self, characters: Mapping[str, Path], made: Callable[[], Mapping[str, Path]] = dict) -> None:
        self._given, self._made = characters, made
        self._shown: dict[str, ShownFace] = {}
        self._meshes: dict[str, bytes] = {}

    @property
    def _characters(self) -> dict[str, Path]:
        return {**self._made(), **self._given}

    @property
    def names(self) -> dict[str, bool]:
        """The names of all faces, and whether each is a mesh."""
        added = {name: path.suffix.lower() != SUFFIX for name, path in self._characters.items()}
        return {name: name == HEAD for name in FACES.names} | added

    def is_filmed(self, name: str) -> bool:
        """Return whether a face is a filmed one, which is shown as a video alone."""
        path = self._characters.get(name)
        return path is not None and path.suffix.lower() == SUFFIX

    def open_face(self, name: str) -> ShownFace:
        """Return a face. Raises InputError: there is none of that name, or its file cannot be read."""
        if name not in self._shown:
            if name not in self.names:
                raise InputError(f"no face {shorten(repr(name))}; required one of: {', '.join(self.names)}")
            path = self._characters.get(name)
            face = name if path is None else path if self.is_filmed(name) else MeshFace(load_character(path))
            self._shown[name] = shown_face(face)
        return self._shown[name]

    def name_mesh(self, name: str, motion: Motion) -> str:
        """Return the name of the mesh that a motion's weights are of."""
        return HEAD_OF_MOODS if name == HEAD and any(map(is_mood, motion.names)) else name

    def load_mesh(self, name: str) -> bytes:
        """Return the ``.glb`` of a face at rest. Raises InputError: there is none of that name, or it is no mesh."""
        if name in self._meshes:
            return self._meshes[name]
        path = self._characters.get(name)
        if self.is_filmed(name):
            raise InputError(f"{name} is a filmed face, and no mesh; ask for a video of it")
        if path is not None and path.suffix.lower() in ANIMATED_SUFFIXES:
            self._meshes[name] = Budget().read_bytes(path, "character")
            return self._meshes[name]
        if path is not None:
            scene = self.open_face(name).build_scene(_create_still(), OutputSettings(self.open_face(name)), None)
        elif name in (HEAD, HEAD_OF_MOODS):
            scene = build_head_scene(_create_still(*((MoodKey(0.0, MOODS[0]),) if name == HEAD_OF_MOODS else ())))
        else:
            raise InputError(f"no mesh {shorten(repr(name))}; required one of: {HEAD}, {HEAD_OF_MOODS}")
        with open_temporary() as folder:
            write_scene(folder / "face.glb", scene)
            self._meshes[name] = (folder / "face.glb").read_bytes()
        return self._meshes[name]


def _create_still(*keys: MoodKey) -> Generation:
    """Return a frame of a closed mouth, with the channels of moods."""
    closed = Motion(np.zeros((1, 1)), FRAME_RATE_HZ, (Channel("opening"),))
    motion = with_moods(closed, keys) if keys else closed
    return Generation(motion, np.zeros(motion.values.shape), Timeline(()), StateTrace(("",), np.zeros(1, np.intp)))


def with_turn(scene: Scene) -> Motion:
    """Return the weights of a scene, and the quaternion of its head, where it turns."""
    weights = scene.weights
    if weights is None:
        raise InputError("the face has no morph targets; choose the head, or a character with blendshapes")
    if scene.turn is None:
        return weights
    values = np.concatenate([weights.values, scene.turn.rotations], axis=1)
    return Motion(values, weights.rate_hz, weights.channels + tuple(map(Channel, TURN)))
