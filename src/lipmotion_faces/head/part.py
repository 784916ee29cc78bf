"""Parts of the character that are drawn: rigid surfaces with colours, and the grids they are made of."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lipmotion.meshes.model.surface import compute_normals
from lipmotion.meshes.model.textures import decode_srgb
from lipmotion_faces.rendering.lighting import Finish

Real = NDArray[np.float64]
Triangles = NDArray[np.int32]
Triple = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Part:
    """A surface that keeps its form.

    places    : of its vertices at rest [shape=(V, 3)];  normals : of length 1 [shape=(V, 3)]
    triangles : counterclockwise from outside [shape=(F, 3)]
    colours   : diffuse reflection, linear [shape=(V, 3)]
    strands   : directions of hair [shape=(V, 3)], or None
    """

    name: str
    places: Real
    triangles: Triangles
    colours: Real
    finish: Finish
    normals: Real
    strands: Real | None = None

    def mirror(self, name: str) -> Part:
        """Return the same part on the other side of the face."""
        flip = np.array([-1.0, 1.0, 1.0])
        strands = None if self.strands is None else self.strands * flip
        return replace(
            self, name=name, places=self.places * flip, normals=self.normals * flip,
            triangles=self.triangles[:, ::-1], strands=strands,
        )  # fmt: skip


def part(
    name: str, places: Real, triangles: Triangles, colour: Triple | Real, finish: Finish, strands: Real | None = None
) -> Part:
    """Return a part of one sRGB colour, or of one a vertex [shape=(V, 3)]; normals are those of its triangles."""
    colours = np.broadcast_to(decode_srgb(colour), places.shape).copy()
    return Part(name, places, triangles, colours, finish, compute_normals(places, triangles), strands)


def join_parts(name: str, parts: list[Part]) -> Part:
    """Return several parts of one finish as one."""
    offsets = np.cumsum([0, *(len(each.places) for each in parts)])
    triangles = [each.triangles + offset for each, offset in zip(parts, offsets, strict=False)]
    strands = [each.strands for each in parts if each.strands is not None]
    return Part(
        name,
        np.concatenate([each.places for each in parts]),
        np.concatenate(triangles).astype(np.int32),
        np.concatenate([each.colours for each in parts]),
        parts[0].finish,
        np.concatenate([each.normals for each in parts]),
        np.concatenate(strands) if len(strands) == len(parts) else None,
    )


def grid_triangles(rows: int, columns: int, *, closed: bool = False) -> Triangles:
    """Return the triangles of a grid of vertices, row by row; ``closed``: the last column is joined to the first."""
    index = np.arange(rows * columns).reshape(rows, columns)
    if closed:
        index = np.concatenate([index, index[:, :1]], axis=1)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    return np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3).astype(np.int32)


def tube(path: Real, across: Real, thick: Real, upward: Real, *, sides: int = 12) -> tuple[Real, Triangles, Real]:
    """Return places, triangles and directions of a tube of elliptic cross-section along a path.

    path   : [shape=(N, 3)];  across, thick : half axes at every place of it [shape=(N,)]
    upward : about the direction of the thickness at every place [shape=(N, 3)]
    """
    along = np.gradient(path, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    side = np.cross(along, upward)
    side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-9)
    up = np.cross(side, along)
    angle = 2 * np.pi * np.arange(sides) / sides
    rings = (
        path[:, None]
        + across[:, None, None] * np.cos(angle)[None, :, None] * side[:, None]
        + thick[:, None, None] * np.sin(angle)[None, :, None] * up[:, None]
    )
    strands = np.repeat(along, sides, axis=0)
    return rings.reshape(-1, 3), grid_triangles(len(path), sides, closed=True), strands
