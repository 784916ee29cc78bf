"""The surface of a mesh: vertices that are one place, pieces that hang together, distances along the surface."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from lipmotion.meshes.model.mesh import Mesh
from lipmotion_faces.kernels.shading import sum_normals

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Rows = NDArray[np.int64]

SAME_PLACE_SHARE = 1e-5
"""Vertices closer than this share of the size of the mesh are one place: files split vertices along seams of
textures."""
SAME_MOTION_SHARE = 1e-3
"""They must be moved alike by all blendshapes, to this share of the largest displacement: lips that touch are not."""
SAME_SIDE_COSINE = -0.2
"""Their normals must not point apart (cosine): so lips that touch remain apart in a mesh without blendshapes."""


@dataclass(frozen=True, eq=False)
class MeshSurface:
    """How the vertices of a mesh hang together."""

    places: Rows  # the place of every vertex; vertices that files split share one [shape=(V,)]
    edges: csr_array  # lengths of the edges between places, a symmetric sparse matrix [shape=(P, P)]
    pieces: Rows  # the piece of the surface that each vertex belongs to [shape=(V,)]
    normals: NDArray[np.float64]  # unit normals of the vertices [shape=(V, 3)]; 0 where no triangle is

    def distances(self, sources: Rows, limit: float) -> NDArray[np.float64]:
        """Return distances along edges from N sources to every vertex [shape=(N, V)]; infinite beyond ``limit``."""
        return self.place_distances(sources, limit)[:, self.places]

    def place_distances(self, sources: Rows, limit: float) -> NDArray[np.float64]:
        """Return the distance along edges from each source vertex to every place [shape=(len(sources), P)].

        Cost: O(N · P' log P') for N sources and the P' places within the limit.
        """
        from scipy.sparse.csgraph import dijkstra  # takes 0.2 s, which those without a mesh would wait

        return np.asarray(dijkstra(self.edges, directed=False, indices=self.places[sources], limit=limit))


def build_surface(mesh: Mesh, split: NDArray[np.bool_] | None = None) -> MeshSurface:
    """Return how the vertices of a mesh hang together.

    split : vertices that are places of their own, even where others are at the same place, as along closed lips that no
            blendshape opens [shape=(V,)]; None: none
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    normals = sum_normals(mesh.vertices, mesh.triangles)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals / np.where(lengths > 0, lengths, 1.0)
    places = _number_places(mesh, normals)
    if split is not None:
        places = np.unique(np.where(split, len(places) + np.arange(len(places)), places), return_inverse=True)[1]
        places = places.reshape(-1).astype(np.int64)
    triangles = places[mesh.triangles]
    count = int(places.max(initial=-1)) + 1
    low, high = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1).T
    pairs = np.stack(np.divmod(np.unique((low * count + high)[low != high]), max(count, 1)), axis=1)
    first = np.unique(places, return_index=True)[1]
    along = np.linalg.norm(mesh.vertices[first[pairs[:, 0]]] - mesh.vertices[first[pairs[:, 1]]], axis=1)
    along = np.maximum(along, 1e-12)  # an edge of length 0 would be none
    edges = csr_array((along, (pairs[:, 0], pairs[:, 1])), shape=(len(first), len(first)))
    edges = edges + edges.T
    _, pieces = connected_components(edges, directed=False)
    return MeshSurface(places, edges, pieces[places].astype(np.int64), normals)


def compute_normals(places: NDArray[np.float64], triangles: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return the area-weighted unit normal of every vertex [shape=(V, 3)]; (0, 0, 1) where no triangle is."""
    total = sum_normals(places, triangles)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.where(length > 0, total / np.where(length > 0, length, 1), [0.0, 0.0, 1.0])


def _number_places(mesh: Mesh, normals: NDArray[np.float64]) -> Rows:
    """Return the number of each vertex's place: the same for vertices at one place that move alike and face alike."""
    size = float(np.ptp(mesh.vertices, axis=0).max(initial=0.0)) or 1.0
    # where they are, and two numbers that differ where blendshapes move vertices differently
    keys, sums, largest = [np.rint(mesh.vertices / (SAME_PLACE_SHARE * size))], np.zeros((len(mesh.vertices), 2)), 0.0
    weights = np.random.default_rng(0).normal(size=(len(mesh.shapes), 3, 2))
    for shape, weight in zip(mesh.shapes, weights, strict=True):
        sums[shape.rows] += shape.displacements @ weight
        largest = max(largest, float(np.abs(shape.displacements).max(initial=0.0)))
    keys.append(np.rint(sums / (SAME_MOTION_SHARE * (largest or 1.0))))
    together = np.zeros(len(mesh.vertices), np.int64)
    for column in np.concatenate(keys, axis=1).T:  # one after another: many times faster than rows at once
        _, ranks = np.unique(column, return_inverse=True)
        _, together = np.unique(together * (int(ranks.max(initial=0)) + 1) + ranks.reshape(-1), return_inverse=True)
        together = together.reshape(-1)
    # of the vertices of one place, those that face apart from the first one are another place
    first = np.unique(together, return_index=True)[1]
    apart = np.einsum("ij,ij->i", normals, normals[first[together]]) < SAME_SIDE_COSINE
    _, places = np.unique(2 * together + apart, return_inverse=True)
    return places.reshape(-1).astype(np.int64)


def drop_back_sides(mesh: Mesh) -> Mesh:
    """Return a mesh whose parts that hold every triangle twice, turned round, hold it once, seen from both sides.

    Lashes and leaves are often made so. The normals of the two sides would cancel out. The vertices stay as they are;
    so do parts of which some triangles alone are there twice.
    """
    corners = mesh.triangles.astype(np.int64)
    low, middle, high = np.sort(corners, axis=1).T
    _, of_pair = np.unique(low * len(mesh.vertices) + middle, return_inverse=True)
    numbers = of_pair.reshape(-1) * len(mesh.vertices) + high
    _, first, same = np.unique(numbers, return_index=True, return_inverse=True)
    partner = first[same.reshape(-1)]
    turned = (corners[:, 0] > corners[:, 1]) ^ (corners[:, 1] > corners[:, 2]) ^ (corners[:, 0] > corners[:, 2])
    back = turned != turned[partner]
    dropped = np.zeros(len(corners), bool)
    for part in mesh.parts:
        mine = slice(part.first, part.stop)
        backs = back[mine] & (partner[mine] >= part.first)
        if part.stop > part.first and 2 * backs.sum() == part.stop - part.first:
            dropped[mine] = backs
    if not dropped.any():
        return mesh
    before, parts = np.concatenate([[0], np.cumsum(~dropped)]).tolist(), []
    for part in mesh.parts:
        two_sided = part.material.two_sided or bool(dropped[part.first : part.stop].any())
        material = replace(part.material, two_sided=two_sided)
        parts.append(replace(part, first=before[part.first], stop=before[part.stop], material=material))
    uv = None if mesh.uv is None else mesh.uv[~dropped]
    return replace(mesh, triangles=mesh.triangles[~dropped], parts=tuple(parts), uv=uv)
