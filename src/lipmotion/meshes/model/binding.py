"""Control points: which vertices of a mesh follow which lip and jaw points, and how the mesh moves with them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from lipmotion.meshes.model.face_shapes import LipPlacement
from lipmotion.meshes.model.mesh import Mesh

if TYPE_CHECKING:
    from scipy.sparse import csr_array


def skin_vertices(
    weights: csr_array, matrices: NDArray[np.float64], vertices: NDArray[np.float64]
) -> NDArray[np.float64]:
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
    blended = (weights @ (matrices - np.eye(3, 4)).reshape(len(matrices), 12)).reshape(-1, 3, 4)
    moved = blended[:, :, 0] * vertices[:, :1]
    moved += blended[:, :, 1] * vertices[:, 1:2]
    moved += blended[:, :, 2] * vertices[:, 2:]
    moved += blended[:, :, 3]
    moved += vertices
    return moved


Array = NDArray[np.float64]
Rows = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class ControlBinding:
    """Weights of control points on the vertices of a mesh.

    placement : the control points: lip and jaw points of motion, each at a vertex
    rows      : the vertices that follow any of them, ascending [shape=(N,)]
    controls  : which control points a vertex follows, as rows of the placement; unused ones have weight 0
                [shape=(N, K)]
    weights   : how much, 0 to 1; what they leave of 1 is fixed to the head [shape=(N, K)]
    """

    placement: LipPlacement
    rows: Rows
    controls: Rows
    weights: Array

    @cached_property
    def matrix(self) -> csr_array:
        """The weights as sparse rows [shape=(N, C)]."""
        from scipy.sparse import csr_array

        count = self.controls.shape[1]
        starts = np.arange(0, self.controls.size + 1, count)
        shape = (len(self.rows), len(self.placement.points))
        return csr_array((self.weights.reshape(-1), self.controls.reshape(-1), starts), shape=shape)

    def moved(self, mesh: Mesh, displacements: Array) -> Array:
        """Return the vertices [shape=(V, 3)] under displacements of control points, eye distances [shape=(C, 3)]."""
        matrices = np.tile(np.eye(3, 4), (len(displacements), 1, 1))
        matrices[:, :, 3] = self.placement.to_mesh(displacements)
        return self.transformed(mesh, matrices)

    def transformed(self, mesh: Mesh, matrices: Array) -> Array:
        """Return the vertices [shape=(V, 3)] under transformations of the control points [shape=(C, 3, 4)] (Hofer 2008,
        Eq. 12).
        """
        vertices = mesh.vertices.copy()
        vertices[self.rows] = skin_vertices(self.matrix, matrices, mesh.vertices[self.rows])
        return vertices
