"""Linear blend skinning: vertices that follow weighted control points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scipy.sparse import csr_array


def skinned(weights: csr_array, matrices: NDArray[np.float64], vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the vertices under the blended transformations of the control points [shape=(N, 3)].

    weights  : of each control point on each vertex [shape=(N, C), sparse rows]; a row of sum below 1 leaves the rest of
               its vertex where it is
    matrices : rotation, scale and shift of each control point [shape=(C, 3, 4)]
    vertices : at rest [shape=(N, 3)]
    v′ = Σ wᵢ Mᵢ v + (1 − Σ wᵢ) v: the matrices are blended, then applied, which is the same and costs less.
    Source: Hofer 2008, Eq. 12.  Deviation: a fixed control point has what the weights leave of 1, so that the face
    beyond the mouth stands still.
    Cost: O(12 · (number of weights) + 12 N).
    """
    still = np.eye(3, 4)
    blended = (weights @ (matrices - still).reshape(len(matrices), 12)).reshape(-1, 3, 4)
    moved = blended[:, :, 0] * vertices[:, :1]
    moved += blended[:, :, 1] * vertices[:, 1:2]
    moved += blended[:, :, 2] * vertices[:, 2:]
    moved += blended[:, :, 3]
    moved += vertices
    return moved
