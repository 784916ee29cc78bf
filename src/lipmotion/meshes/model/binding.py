"""Control points: which vertices of a mesh follow which lip and jaw points, and how the mesh moves with them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.lip_points import build_mouth
from lipmotion.errors import InputError
from lipmotion.meshes.fitting.lip_placement import LipPlacement
from lipmotion.meshes.model.mesh import Mesh
from lipmotion.meshes.model.surface import MeshSurface

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

UPPER_REACH, LOWER_REACH, JAW_REACH = 0.32, 0.45, 0.65
"""How far a control point of the upper lip and the corners, of the lower lip, of the jaw reaches along the surface, in
eye distances."""
MAX_WEIGHTS = 8
"""Most control points that a vertex follows."""
MIN_WEIGHT = 1e-3
VERTICES_AT_ONCE = 1 << 13
SOFTNESS = 0.03
"""Added to all distances, in eye distances: without it every control point would stick out of its surroundings."""
PLATEAU_SHARE = 0.4
"""Within this share of the reach of a control point nothing of a vertex is fixed to the head."""
JAW_FOLLOWERS = (152, 199, 200, 175)
"""What lies inside the mouth below the lips (lower teeth, tongue) follows the mean of these points."""
_CAVITY_REACH = 0.75
"""The mouth's inside reaches so many eye distances back from the lips, and so far down."""


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
        """Return the vertices [shape=(V, 3)] when control points are displaced, in eye distances, head frame [shape=(C,
        3)].
        """
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


def bind(mesh: Mesh, surface: MeshSurface, placement: LipPlacement) -> ControlBinding:
    """Return the weights of the control points on a mesh, by distance along its surface.

    A control point acts within its reach: wᵢ ∝ ((Rᵢ − dᵢ) / (Rᵢ (dᵢ + s)))², normalised over the control points; all of
    them together fade out as the nearest one gets out of reach. Distances are measured along the surface, so the
    upper lip does not drag the lower, however near it is. Pieces inside the mouth below the lips follow the jaw as one.
    Source: Hofer 2008, Eq. 12, which gives no form of the weights; Franke & Nielson 1980 (modified Shepard weights).
    """
    template = build_mouth()
    reach = np.where(template.jaw, JAW_REACH, np.where(template.lower, LOWER_REACH, UPPER_REACH))[:, None]
    limit = float(reach.max()) * placement.scale
    distances = surface.place_distances(placement.vertices, limit)
    # pieces that lie inside the mouth, below where the lips meet: lower teeth, tongue
    places = mesh.vertices @ placement.axes / placement.scale
    lips = places[placement.vertices[~template.jaw]]
    centre, front = lips.mean(axis=0), float(lips[:, 2].max())
    across, up, _ = (places - centre).T
    within = (np.abs(across) < 0.6 * float(np.ptp(lips[:, 0]))) & (np.abs(up) < _CAVITY_REACH)
    within &= (places[:, 2] < front) & (places[:, 2] > front - 2 * _CAVITY_REACH)
    count = int(surface.pieces.max(initial=-1)) + 1
    sizes = np.bincount(surface.pieces, minlength=count)
    heights = np.bincount(surface.pieces, places[:, 1], count) / np.maximum(sizes, 1)
    covered = (np.bincount(surface.pieces[within], minlength=count) == sizes) & (heights < centre[1])
    covered[surface.pieces[placement.vertices]] = False
    inside = covered[surface.pieces]
    followers = np.array([placement.row(point) for point in JAW_FOLLOWERS])
    parts = []
    for first in range(0, len(mesh.vertices), VERTICES_AT_ONCE):
        rows = slice(first, first + VERTICES_AT_ONCE)
        far = np.minimum(distances[:, surface.places[rows]] / placement.scale, reach)
        pulls = ((reach - far) / (reach * (far + SOFTNESS))) ** 2
        out = np.clip((np.min(far / reach, axis=0) - PLATEAU_SHARE) / (1 - PLATEAU_SHARE), 0.0, 1.0)
        held = (1 - out) ** 2 * (1 + 2 * out)  # from 1 to 0, with slope 0 at both ends
        weights = (pulls / np.maximum(pulls.sum(axis=0), 1e-12) * held).T
        weights[inside[rows]] = 0.0
        weights[np.ix_(np.flatnonzero(inside[rows]), followers)] = 1 / len(JAW_FOLLOWERS)
        parts.append(_choose_strongest(weights, first))
    return ControlBinding(placement, *map(np.concatenate, zip(*parts, strict=True)))


def paint_weights(binding: ControlBinding, mesh: Mesh, paint: Mapping[int, Mapping[int, float]]) -> ControlBinding:
    """Return a binding with the weights of some vertices replaced.

    paint : for each vertex the weight of each point, 0 to 1; weights that add up to more than 1 are scaled down to 1
    Raises InputError: no such vertex or point, a weight out of its range, or too many points on a vertex.
    """
    weights = np.zeros((len(mesh.vertices), len(binding.placement.points)))
    weights[binding.rows] = binding.matrix.toarray()
    for vertex, painted in paint.items():
        if not 0 <= vertex < len(mesh.vertices):
            raise InputError(f"the vertex {vertex} does not exist, required 0 to {len(mesh.vertices) - 1}")
        if sum(value > 0 for value in painted.values()) > MAX_WEIGHTS:
            raise InputError(f"the vertex {vertex} follows {len(painted)} points, required at most {MAX_WEIGHTS}")
        weights[vertex] = 0.0
        for point, value in painted.items():
            if point not in binding.placement.points:
                raise InputError(
                    f"{point} is no control point, required one of {', '.join(map(str, binding.placement.points))}"
                )
            if not 0 <= value <= 1:
                raise InputError(f"the weight of point {point} on vertex {vertex} is {value:g}, required 0 to 1")
            weights[vertex, binding.placement.row(point)] = value
        weights[vertex] /= max(float(weights[vertex].sum()), 1.0)
    return ControlBinding(binding.placement, *_choose_strongest(weights))


def _choose_strongest(weights: Array, first: int = 0) -> tuple[Rows, Rows, Array]:
    """Return rows from the first vertex on, controls and weights: the largest of each vertex [shape=(N, C)]."""
    total = weights.sum(axis=1)
    rows = np.flatnonzero(total > MIN_WEIGHT)
    controls = np.argsort(-weights[rows], axis=1, kind="stable")[:, :MAX_WEIGHTS]
    controls.sort(axis=1)
    strongest = np.take_along_axis(weights[rows], controls, axis=1)
    strongest *= (total[rows] / np.maximum(strongest.sum(axis=1), 1e-12))[:, None]  # they get what is left out
    return first + rows, controls.astype(np.int64), np.minimum(strongest, 1.0)
