"""One person through a video: over cuts, past other faces, and not into them."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack

import numpy as np
from numpy.typing import NDArray

from lipmotion.vision.image_similarity import face_thumbnail, image_correlation, scene_thumbnail
from lipmotion.vision.landmarks import EYE_CORNERS, TRACKED_POINTS
from lipmotion.vision.mesh import FaceMesh

Image = NDArray[np.uint8]
Array = NDArray[np.float64]

MOST_FACES = 4
"""Faces looked for where a scene begins."""
CUT_LEVELS = 6.0
"""A new scene: the small picture changes by more grey levels from one frame to the next (GRID: up to 1.3)."""
JUMP, GROWTH = 0.6, 1.25
"""A face does not move by more eye distances in a frame (GRID: up to 0.03), nor change its size more (1.06)."""
LOST_FRAMES = 10
"""A face that was away for longer must be recognised."""
SAME_PERSON = 0.9
"""Likeness of the upper face to one seen before. GRID: 0.90 to 1 within a clip; two people, 0.2 to 0.87 in 14 pairs of
15, and 0.94 in one."""
LOOK_STEP, LOOKS = 5, 20
"""Every so many frames of a scene the face is kept to compare with, up to so many."""

_EYES = [TRACKED_POINTS.index(index) for index in EYE_CORNERS]


class FaceFollower:
    """Finds one face in every scene of a clip, frame by frame, and says at the end in which scenes it is one person's.

    Use it as a context manager.
    """

    def __init__(self) -> None:
        self._scenes = [_Scene(())]
        self._picture: Array | None = None
        self._found: list[int | None] = []  # by frame: the scene whose face was found

    def __enter__(self) -> FaceFollower:
        return self

    def __exit__(self, *_: object) -> None:
        self._scenes[-1].close()

    def points(self, image: Image) -> Array | None:
        """Return the points of a face in the next frame, as ``FaceMesh`` gives them; None: there is none.

        Of several, the one followed so far; where a scene begins, one that is known, else the largest and most central.
        """
        before, self._picture = self._picture, scene_thumbnail(image)
        is_cut = before is not None and np.abs(self._picture - before).mean() > CUT_LEVELS
        if is_cut or self._scenes[-1].away > LOST_FRAMES:
            self._begin_scene()
        face = self._scenes[-1].next_face(image)
        if face is None and self._scenes[-1].is_elsewhere:
            self._begin_scene()
            face = self._scenes[-1].next_face(image)
        self._found.append(None if face is None else len(self._scenes) - 1)
        return face

    def person(self) -> NDArray[np.bool_]:
        """Return by frame whether the face found is the person's: the one with the most frames."""
        kept = self._kept()
        return np.array([scene in kept for scene in self._found])

    def cuts(self) -> list[int]:
        """Return the frames from which the picture shows the person from elsewhere, or somebody else, or again."""
        kept, cuts, last = self._kept(), [], None
        for index, scene in enumerate(self._scenes):
            if scene.looks:
                if last is not None and (index in kept, True) != (last in kept, scene.is_near(self._scenes[last])):
                    cuts.append(self._found.index(index))
                last = index
        return cuts

    def _begin_scene(self) -> None:
        self._scenes[-1].close()
        self._scenes.append(_Scene([look for scene in self._scenes for look in scene.looks]))

    def _kept(self) -> set[int]:
        counts = [self._found.count(index) for index in range(len(self._scenes))]
        kept = {int(np.argmax(counts))}
        while True:
            looks = [look for index in kept for look in self._scenes[index].looks]
            more = {i for i, scene in enumerate(self._scenes) if _likeness(scene.looks, looks) > SAME_PERSON} - kept
            if not more:
                return kept
            kept |= more


class _Scene:
    """The frames between two cuts, and the face followed through them.

    looks        : the face, every so often
    away         : frames since it was last found, 0 before it was
    is_elsewhere : the mesh, which follows one face, has gone over to another
    """

    def __init__(self, known: Sequence[Array]) -> None:
        self.looks: list[Array] = []
        self.away = 0
        self.is_elsewhere = False
        self._known = known
        self._first: Array | None = None
        self._last: Array | None = None
        self._seen = 0
        self._open = ExitStack()
        self._mesh: FaceMesh | None = None
        self._is_crowd = False

    def close(self) -> None:
        self._open.close()

    def next_face(self, image: Image) -> Array | None:
        """Return the followed face in the next frame, None where it is not."""
        face = self._first_face(image) if self._last is None else self._same_face(image, self._last)
        if face is None:
            self.away += self._last is not None
            return None
        if self._seen % LOOK_STEP == 0 and len(self.looks) < LOOKS:
            self.looks.append(face_thumbnail(image, face[_EYES, :2]))
        self._seen += 1
        self._last, self.away = face, 0
        return face

    def is_near(self, before: _Scene) -> bool:
        """Whether this scene's face begins where the other's ended."""
        return self._first is not None and before._last is not None and before._could_be(self._first, before._last)

    def _first_face(self, image: Image) -> Array | None:
        faces = self._faces(image)
        if faces:
            faces = self._several(image) or faces
            self._first = max(faces, key=lambda face: self._claim(image, face))
        return self._first

    def _same_face(self, image: Image, last: Array) -> Array | None:
        faces = self._faces(image)
        near = [face for face in faces if self._could_be(face, last)]
        self.is_elsewhere = bool(faces) and not near and not self._is_crowd
        return min(near, key=lambda face: _distance(face, last), default=None)

    def _could_be(self, face: Array, last: Array) -> bool:
        growth = _size(face) / _size(last)
        return _distance(face, last) < JUMP * (1 + self.away) and 1 / GROWTH < growth < GROWTH

    def _faces(self, image: Image) -> list[Array]:
        if self._mesh is None:
            self._mesh = self._open.enter_context(FaceMesh())
        return self._mesh.faces(image)

    def _several(self, image: Image) -> list[Array]:
        """Return all faces if there are several, and follow them from now on; it takes twice the time."""
        crowd = self._open.enter_context(FaceMesh(MOST_FACES))
        faces = crowd.faces(image)
        if len(faces) < 2:
            return []
        self._mesh, self._is_crowd = crowd, True
        return faces

    def _claim(self, image: Image, face: Array) -> tuple[bool, float]:
        """Return what the face is chosen by: known before; then its size, half of it at the edge of the picture."""
        is_known = _likeness([face_thumbnail(image, face[_EYES, :2])], self._known) > SAME_PERSON
        return is_known, _size(face) * (1 - abs(float(_middle(face)[0]) / image.shape[1] - 0.5))


def _likeness(looks: Sequence[Array], others: Sequence[Array]) -> float:
    """Return how alike the two most alike faces are."""
    if not looks or not others:
        return 0.0
    return float(image_correlation(np.stack(looks)[:, None], np.stack(others)).max())


def _distance(face: Array, other: Array) -> float:
    return float(np.linalg.norm(_middle(face) - _middle(other))) / _size(other)


def _middle(face: Array) -> Array:
    middle: Array = face[_EYES, :2].mean(axis=0)
    return middle


def _size(face: Array) -> float:
    return float(np.linalg.norm(face[_EYES[1], :2] - face[_EYES[0], :2]))
