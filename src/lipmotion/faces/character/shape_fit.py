"""Poses of the character as weights of its blendshapes: the nearest that sums of blendshapes come to what is drawn."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lipmotion.faces.character.figure import Figure
from lipmotion.faces.character.lips import COLUMNS, VISIBLE
from lipmotion.faces.character.pose import CharacterPose
from lipmotion.faces.character.skin import REST
from lipmotion.rig.bounded_curves import CurveCosts, bounded_curves
from lipmotion.rig.mesh import Mesh

Real = NDArray[np.float64]

FROM_POSE = {"tongueOut": "tongue_out", "tongueUp": "tongue_up", "mouthPressLeft": "press", "mouthPressRight": "press"}
"""Shapes whose weight is a number of the pose."""
_NOT_OF_LIPS = ("eye", "brow", *FROM_POSE)
_OPENING = ("mouthFunnel", "mouthRollLower", "mouthUpperUp", "mouthLowerDown")
"""Shapes that part the lips, beside ``jawOpen``."""
APART = 12.0
"""How much the distance between the lips counts against the places of their vertices."""
HARDLY = 0.02
"""Below this gap the shapes that part the lips fade out, in eye distances: at gap 0 the lips meet."""
COSTS = CurveCosts(ridge=1e-3, smooth=2e-3)


def mouth_weights(figure: Figure, mesh: Mesh, poses: Sequence[CharacterPose]) -> dict[str, Real]:
    """Return the weights of the shapes of lips, jaw and tongue in every pose, 0 to 1 [each shape=(T,)].

    mesh : of this figure, from ``head_mesh``
    Where the gap of a pose is 0, the lips of the mesh meet as they do at rest.
    """
    names = [name for name in mesh.shape_names if not name.startswith(_NOT_OF_LIPS)]
    fixed = {name: np.array([getattr(pose, field) for pose in poses], float) for name, field in FROM_POSE.items()}
    moved = mesh.displacements(np.arange(len(figure.skin.rest)))
    rows = {name: _rows(figure, moved[mesh.shape_names.index(name)]) for name in (*names, *FROM_POSE)}
    matrix = np.stack([rows[name] for name in names])
    # of targets only what the shapes span counts, so they are projected at once: (T, S) numbers, not (T, vertices)
    spanned, triangle = np.linalg.qr(matrix.T)
    rest = figure.skin.places(REST)
    targets = np.stack([_rows(figure, figure.skin.places(pose) - rest) @ spanned for pose in poses])
    for name, curve in fixed.items():
        targets -= np.outer(curve, rows[name] @ spanned)
    weights = bounded_curves(triangle.T, targets, COSTS)
    curves = dict(zip(names, weights.T, strict=True)) | fixed
    parted = np.clip(np.array([pose.gap for pose in poses]) / HARDLY, 0, 1)
    for name in names:
        if name.startswith(_OPENING):
            curves[name] = curves[name] * parted
    curves["mouthClose"] = np.clip(curves["jawOpen"] - parted * (curves["jawOpen"] - curves["mouthClose"]), 0, 1)
    return curves


def _rows(figure: Figure, moved: Real) -> Real:
    """Return displacements of the skin as rows of a least squares problem: places around the mouth, and gaps."""
    lips = figure.skin.lip_rows()
    around = np.flatnonzero(figure.skin.lip_weight > 0)[::3]
    edge = moved[lips[VISIBLE - 1]]
    half = COLUMNS // 2
    upper, lower = edge[1:half], edge[:half:-1]
    gaps = APART * (upper - lower)[:, 1]
    visible = moved[lips[:VISIBLE]].reshape(-1, 3)
    return np.concatenate([visible.ravel(), 0.5 * moved[around].ravel(), gaps])
