"""Faces of the page: meshes with morph targets as ``.glb``, and the numbers that move them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from lipmotion.articulation.expression import with_moods
from lipmotion.errors import InputError, shorten
from lipmotion.pipeline.outputs.output import OutputSettings, ShownFace
from lipmotion.storage.locks import open_temporary
from lipmotion.types import FRAME_RATE_HZ, Channel, Generation, Motion, StateTrace, Timeline
from lipmotion.types.delivery import MOODS, MoodKey
from lipmotion_faces.characters.character_files import load_character
from lipmotion_faces.characters.file_limits import Budget
from lipmotion_faces.filmed.face import SUFFIX
from lipmotion_faces.mesh import MeshFace
from lipmotion_faces.outputs.scenes import ANIMATED_SUFFIXES, build_head_scene, write_scene
from lipmotion_faces.outputs.shown_faces import shown_face
from lipmotion_faces.registry import FACES

HEAD, HEAD_OF_MOODS = "head", "head-moods"
"""The 3D head, and the same with the shapes of moods: motion that has moods moves the second one."""
TURN = tuple(f"head.rotation.{axis}" for axis in "xyzw")  # names of the numbers of a quaternion that turns the head


class Faces:
    """The faces of a project by name: built in, its own characters, and filmed faces, also those made here."""

    def __init__(self, characters: Mapping[str, Path], made: Callable[[], Mapping[str, Path]] = dict) -> None:
        self._chosen, self._made = characters, made
        self._shown: dict[str, ShownFace] = {}
        self._meshes: dict[str, bytes] = {}

    @property
    def _characters(self) -> dict[str, Path]:
        return {**self._made(), **self._chosen}

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
        if path is None and name not in (HEAD, HEAD_OF_MOODS):
            raise InputError(f"no mesh {shorten(repr(name))}; required one of: {HEAD}, {HEAD_OF_MOODS}")
        motion = Motion(np.zeros((1, 1)), FRAME_RATE_HZ, (Channel("opening"),))  # a frame of a closed mouth
        if name == HEAD_OF_MOODS and path is None:
            motion = with_moods(motion, [MoodKey(0.0, MOODS[0])])
        trace = StateTrace(("",), np.zeros(1, np.intp))
        still = Generation(motion, np.zeros(motion.values.shape), Timeline(()), trace)
        if path is None:
            scene = build_head_scene(still)
        else:
            scene = self.open_face(name).build_scene(still, OutputSettings(self.open_face(name)), None)
        with open_temporary() as folder:
            write_scene(folder / "face.glb", scene)
            self._meshes[name] = (folder / "face.glb").read_bytes()
        return self._meshes[name]
