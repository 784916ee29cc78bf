"""Poses of the character as weights of its blendshapes: the nearest that sums of blendshapes come to what is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from lipmotion.faces.head.figure import Figure
from lipmotion.faces.head.lips import COLUMNS, VISIBLE_RINGS
from lipmotion.faces.head.pose import CharacterPose
from lipmotion.faces.head.skin import REST
from lipmotion.meshes.fitting.bounded_curves import CurveCosts, bounded_curves
from lipmotion.meshes.fitting.shape_weights import with_gap
from lipmotion.meshes.model.face_shapes import FaceShapes
from lipmotion.meshes.model.mesh import Mesh

Real = NDArray[np.float64]

FROM_POSE = {"tongueOut": "tongue_out", "tongueUp": "tongue_up", "mouthPressLeft": "press", "mouthPressRight": "press"}
"""Shapes whose weight is a number of the pose."""
_NOT_OF_LIPS = ("eye", "brow", "cheek", "nose", *FROM_POSE)
PARTING = ("jawOpen", "mouthClose", "mouthLowerDown", "mouthUpperUp")
"""Shapes that are changed first so that the lips are apart as in the pose; the others where that is not enough."""
GAP_WEIGHT = 12.0
"""How much the distance between the lips counts against the places of their vertices."""
COSTS = CurveCosts(ridge=1e-3, smooth=2e-3)


def mouth_weights(figure: Figure, mesh: Mesh, poses: Sequence[CharacterPose]) -> dict[str, Real]:
    """Return the weights of the shapes of lips, jaw and tongue in every pose, 0 to 1 [each shape=(T,)].

    mesh : of this figure, from ``head_mesh``
    The middles of the lips are apart as in the pose.
    """
    return _mouth_fit(figure, mesh).weights(poses)


class _MouthFit:
    """What weights of any poses are fitted with: the displacements of the shapes around the mouth."""

    def __init__(self, figure: Figure, mesh: Mesh) -> None:
        self._figure = figure
        names = [name for name in mesh.shape_names if not name.startswith(_NOT_OF_LIPS)]
        moved = mesh.displacements(np.arange(len(figure.skin.rest)))
        rows = {name: _rows(figure, moved[mesh.shape_names.index(name)]) for name in (*names, *FROM_POSE)}
        # of targets only what the shapes span counts, so they are projected at once: (T, S) numbers, not (T, vertices)
        self._spanned, self._triangle = np.linalg.qr(np.stack([rows[name] for name in names]).T)
        self._fixed = {name: rows[name] @ self._spanned for name in FROM_POSE}
        self._rest = figure.skin.places_without_lids(REST)
        parting = np.array([lip_gap(figure, moved[mesh.shape_names.index(name)]) for name in names])
        self._shapes = FaceShapes(tuple(names), tuple(names), np.zeros((len(names), 0, 3)), parting, "arkit")

    def weights(self, poses: Sequence[CharacterPose]) -> dict[str, Real]:
        """Return the weights of ``mouth_weights``."""
        names, spanned = self._shapes.names, self._spanned
        fixed = {name: np.array([getattr(pose, field) for pose in poses], float) for name, field in FROM_POSE.items()}
        targets, gap = np.empty((len(poses), spanned.shape[1])), np.empty(len(poses))
        for number, pose in enumerate(poses):
            change = self._figure.skin.places_without_lids(pose) - self._rest
            targets[number], gap[number] = _rows(self._figure, change) @ spanned, lip_gap(self._figure, change)
        for name, curve in fixed.items():
            targets -= np.outer(curve, self._fixed[name])
        weights = bounded_curves(self._triangle.T, targets, COSTS)
        jaw, close = names.index("jawOpen"), names.index("mouthClose")
        weights[:, close] = np.minimum(weights[:, close], weights[:, jaw])
        kept = [name for name in names if not name.startswith(PARTING)]
        weights = with_gap(with_gap(weights, self._shapes, gap, kept), self._shapes, gap)
        return dict(zip(names, weights.T, strict=True)) | fixed


@lru_cache(maxsize=2)
def _mouth_fit(figure: Figure, mesh: Mesh) -> _MouthFit:
    return _MouthFit(figure, mesh)


def lip_gap(figure: Figure, moved: Real) -> float:
    """Return by how much displacements of the vertices part the middle of the lips, in eye distances."""
    edge = figure.skin.lip_rows()[VISIBLE_RINGS - 1]
    half = COLUMNS // 2
    upper, lower = edge[1:half], edge[:half:-1]
    middle = len(upper) // 2
    return float(moved[upper[middle], 1] - moved[lower[middle], 1])


def _rows(figure: Figure, moved: Real) -> Real:
    """Return displacements of the skin as rows of a least squares problem: places around the mouth, and gaps."""
    lips = figure.skin.lip_rows()
    around = np.flatnonzero(figure.skin.lip_weight > 0)[::3]
    edge = moved[lips[VISIBLE_RINGS - 1]]
    half = COLUMNS // 2
    upper, lower = edge[1:half], edge[:half:-1]
    gaps = GAP_WEIGHT * (upper - lower)[:, 1]
    visible = moved[lips[:VISIBLE_RINGS]].reshape(-1, 3)
    return np.concatenate([visible.ravel(), 0.5 * moved[around].ravel(), gaps])
