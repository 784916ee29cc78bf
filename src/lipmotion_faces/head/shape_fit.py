"""Poses of the character as weights of its blendshapes: the nearest that sums of blendshapes come to what is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from lipmotion.meshes.fitting.shape_weights import CurveCosts, fit_bounded_curves, with_gap
from lipmotion.meshes.model.face_shapes import FaceShapes
from lipmotion.meshes.model.mesh import Mesh
from lipmotion_faces.head.figure import Figure
from lipmotion_faces.head.lips import COLUMNS, VISIBLE_RINGS
from lipmotion_faces.head.pose import CharacterPose, stack_poses
from lipmotion_faces.head.skin import REST

Real = NDArray[np.float64]

FROM_POSE = {"tongueOut": "tongue_out", "tongueUp": "tongue_up", "mouthPressLeft": "press", "mouthPressRight": "press"}
"""Shapes whose weight is a number of the pose."""
_NOT_OF_LIPS = ("eye", "brow", "cheek", "nose", *FROM_POSE)
PARTING = ("jawOpen", "mouthClose", "mouthLowerDown", "mouthUpperUp")
"""Shapes that are changed first so that the lips are apart as in the pose; the others where that is not enough."""
GAP_WEIGHT = 12.0
"""How much the distance between the lips counts against the places of their vertices."""
AT_ONCE = 256
"""Poses that are computed together."""
COSTS = CurveCosts(ridge=1e-3, smooth=2e-3)


def mouth_weights(figure: Figure, mesh: Mesh, poses: Sequence[CharacterPose]) -> dict[str, Real]:
    """Return the weights of the shapes of lips, jaw and tongue in every pose, 0 to 1 [each shape=(T,)]."""
    return _cached_fit(figure, mesh).weights(poses)


class _MouthFit:
    """What weights of any poses are fitted with: the displacements of the shapes around the mouth."""

    def __init__(self, figure: Figure, mesh: Mesh) -> None:
        self._skin = figure.skin
        names = [name for name in mesh.shape_names if not name.startswith(_NOT_OF_LIPS)]
        moved = mesh.displacements(np.arange(len(figure.skin.rest)))
        around = np.flatnonzero(figure.skin.lip_weight > 0)[::3]
        self._around, rings = figure.skin.binding.select(around), figure.skin.lip_rows()
        every = _rows(moved[:, rings], moved[:, around])
        rows = {name: every[mesh.shape_names.index(name)] for name in (*names, *FROM_POSE)}
        # of targets only what the shapes span counts, so they are projected at once: (T, S) numbers, not (T, vertices)
        self._spanned, self._triangle = np.linalg.qr(np.stack([rows[name] for name in names]).T)
        self._fixed = {name: rows[name] @ self._spanned for name in FROM_POSE}
        self._rest = figure.skin.lips_and_face(REST, self._around)
        parting = lip_gap(moved[:, rings])[[mesh.shape_names.index(name) for name in names]]
        self._shapes = FaceShapes(tuple(names), tuple(names), np.zeros((len(names), 0, 3)), parting, "arkit")

    def weights(self, poses: Sequence[CharacterPose]) -> dict[str, Real]:
        """Return the weights of ``mouth_weights``."""
        names = self._shapes.names
        fixed = {name: np.array([getattr(pose, field) for pose in poses], float) for name, field in FROM_POSE.items()}
        parts = [self._wanted(poses[first : first + AT_ONCE]) for first in range(0, len(poses), AT_ONCE)]
        targets, gap = (np.concatenate(column) for column in zip(*parts, strict=True))
        for name, curve in fixed.items():
            targets -= np.outer(curve, self._fixed[name])
        weights = fit_bounded_curves(self._triangle.T, targets, COSTS)
        jaw, close = names.index("jawOpen"), names.index("mouthClose")
        weights[:, close] = np.minimum(weights[:, close], weights[:, jaw])
        others = [name for name in names if not name.startswith(PARTING)]
        weights = with_gap(with_gap(weights, self._shapes, gap, others), self._shapes, gap)
        return dict(zip(names, weights.T, strict=True)) | fixed

    def _wanted(self, poses: Sequence[CharacterPose]) -> tuple[Real, Real]:
        """Return poses as what the shapes span [shape=(T, S)], and by how much they part the lips [shape=(T,)]."""
        lips, around = (
            places - rest
            for places, rest in zip(self._skin.lips_and_face(stack_poses(poses), self._around), self._rest, strict=True)
        )
        return _rows(lips, around) @ self._spanned, lip_gap(lips)


_cached_fit = lru_cache(maxsize=2)(_MouthFit)


def lip_gap(moved: Real) -> Real:
    """Return by how much displacements [shape=(..., RINGS, COLUMNS, 3)] part the lips' middle [shape=(...,)]."""
    upper, lower = _edges(moved)
    middle = upper.shape[-1] // 2
    return np.asarray(upper[..., middle] - lower[..., middle])


def _edges(moved: Real) -> tuple[Real, Real]:
    """Return the upward displacements of the edges of the upper and the lower lip that meet [shape=(..., N), both]."""
    edge, half = moved[..., VISIBLE_RINGS - 1, :, 1], COLUMNS // 2
    return edge[..., 1:half], edge[..., :half:-1]


def _rows(lips: Real, around: Real) -> Real:
    """Return displacements of lips and of the skin around them as rows of a least squares problem, with gaps."""
    upper, lower = _edges(lips)
    shape = (*lips.shape[:-3], -1)
    visible = lips[..., :VISIBLE_RINGS, :, :].reshape(shape)
    return np.concatenate([visible, 0.5 * around.reshape(shape), GAP_WEIGHT * (upper - lower)], axis=-1)
