"""Parts of the character that are drawn: rigid surfaces with colours, and the grids they are made of."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lipmotion_faces.characters.surface import compute_normals
from lipmotion_faces.characters.textures import decode_srgb
from lipmotion_faces.rendering.lighting import Finish, Triple

Real = NDArray[np.float64]
Triangles = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Part:
    """A surface that keeps its form."""

    name: str
    places: Real  # of its vertices at rest [shape=(V, 3)];  normals : of length 1 [shape=(V, 3)]
    triangles: Triangles  # counterclockwise from outside [shape=(F, 3)]
    colours: Real  # diffuse reflection, linear [shape=(V, 3)]
    finish: Finish
    normals: Real
    strands: Real | None = None  # directions of hair [shape=(V, 3)], or None

    def mirror(self, name: str) -> Part:
        """Return the same part on the other side of the face."""
        flip = np.array([-1.0, 1.0, 1.0])
        strands = None if self.strands is None else self.strands * flip
        return replace(
            self, name=name, places=self.places * flip, normals=self.normals * flip,
            triangles=self.triangles[:, ::-1], strands=strands,
        )  # fmt: skip


def make_part(
    name: str, places: Real, triangles: Triangles, colour: Triple | Real, finish: Finish, strands: Real | None = None
) -> Part:
    """Return a part of one sRGB colour, or of one a vertex [shape=(V, 3)]; normals are those of its triangles."""
    colours = np.broadcast_to(decode_srgb(colour), places.shape).copy()
    return Part(name, places, triangles, colours, finish, compute_normals(places, triangles), strands)


def join(name: str, parts: list[Part]) -> Part:
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


def make_grid(rows: int, columns: int, *, closed: bool = False) -> Triangles:
    """Return the triangles of a grid of vertices, row by row; ``closed``: the last column is joined to the first."""
    index = np.arange(rows * columns).reshape(rows, columns)
    if closed:
        index = np.concatenate([index, index[:, :1]], axis=1)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    return np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3).astype(np.int32)


def make_tube(path: Real, across: Real, thick: Real, upward: Real, *, sides: int = 12) -> tuple[Real, Triangles, Real]:
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
    return rings.reshape(-1, 3), make_grid(len(path), sides, closed=True), strands


EYE = np.array([0.315, 0.0, -0.215])  # centre of the left eyeball; the right one is its mirror image
EYEBALL_RADIUS, LID_RADIUS = 0.225, 0.243  # radii of the eyeball and of the skin upon it
MOUTH_Y = -0.70  # height of the line between the lips
MIDDLE = np.array([0.0, -0.3, -0.75])  # a place inside the head from which every place of the skin can be seen


def to_ellipsoid(p: Real, centre: tuple[float, float, float], radii: tuple[float, float, float]) -> Real:
    """Return the approximate distance from an ellipsoid. Source: Quilez, "Distance functions"."""
    away = p - np.array(centre)
    first = np.linalg.norm(away / np.array(radii), axis=1)
    second = np.linalg.norm(away / np.array(radii) ** 2, axis=1)
    return np.asarray(first * (first - 1) / np.maximum(second, 1e-9))


def to_cone(p: Real, a: tuple[float, float, float], b: tuple[float, float, float], ra: float, rb: float) -> Real:
    """Return the approximate distance from a rounded cone between two balls."""
    start, axis = np.array(a), np.array(b) - np.array(a)
    along = np.clip((p - start) @ axis / (axis @ axis), 0, 1)
    return np.asarray(np.linalg.norm(p - start - along[:, None] * axis, axis=1) - (ra + along * (rb - ra)))


def unite(a: Real, b: Real, blend: float) -> Real:
    """Return the distance from two forms whose joint is rounded over a width of ``blend``."""
    share = np.maximum(blend - np.abs(a - b), 0) / blend
    return np.asarray(np.minimum(a, b) - share * share * blend / 4)


def cut(a: Real, b: Real, blend: float) -> Real:
    """Return the distance from the first form without the second one, with a rounded edge."""
    return -unite(-a, b, blend)


def to_head(p: Real) -> Real:
    """Return the distance from the skin of the head without neck, lips, eyes open or shut, and ears."""
    q = p.copy()
    q[:, 0] = np.abs(q[:, 0])
    d = to_ellipsoid(q, (0, 0.34, -0.80), (0.83, 0.92, 0.93))
    d = unite(d, to_ellipsoid(q, (0, -0.30, -0.60), (0.72, 0.78, 0.60)), 0.35)
    d = unite(d, to_ellipsoid(q, (0.34, -0.35, -0.33), (0.30, 0.27, 0.32)), 0.3)
    d = unite(d, to_cone(q, (0.0, -0.95, -0.27), (0.33, -0.60, -0.62), 0.16, 0.22), 0.35)
    d = unite(d, to_ellipsoid(q, (0, -0.98, -0.185), (0.19, 0.14, 0.16)), 0.22)
    d = unite(d, to_ellipsoid(q, (0, -0.71, -0.17), (0.36, 0.27, 0.22)), 0.25)
    d = cut(d, to_ellipsoid(q, (0.335, 0.0, 0.115), (0.27, 0.2, 0.14)), 0.2)
    d = unite(d, np.linalg.norm(q - EYE, axis=1) - LID_RADIUS, 0.05)
    d = unite(d, to_cone(q, (0, 0.10, -0.07), (0, -0.35, 0.10), 0.052, 0.078), 0.14)
    d = unite(d, to_ellipsoid(q, (0, -0.40, 0.135), (0.092, 0.082, 0.095)), 0.1)
    d = unite(d, to_ellipsoid(q, (0.094, -0.43, 0.045), (0.06, 0.055, 0.075)), 0.06)
    d = cut(d, to_ellipsoid(q, (0.052, -0.495, 0.105), (0.034, 0.026, 0.05)), 0.025)
    return cut(d, to_ellipsoid(q, (0, -0.57, 0.08), (0.036, 0.07, 0.036)), 0.09)


def trace_rays(start: Real, direction: Real, *, steps: int = 70) -> Real:
    """Return how far rays [starts and unit directions: shape=(N, 3)] go until they meet the head [shape=(N,)]."""
    far, going = np.zeros(len(start)), np.arange(len(start))
    for _ in range(steps):
        gap = to_head(start[going] + far[going, None] * direction[going])
        far[going] += 0.8 * gap
        going = going[np.abs(gap) > 1e-5]
        if not len(going):
            break
    return far


def find_front(x: Real, y: Real) -> Real:
    """Return the z of the head's frontmost place at columns and heights [shape=(N,), both]."""
    start = np.stack([x, y, np.full(len(x), 1.0)], axis=1)
    return np.asarray(1 - trace_rays(start, np.broadcast_to([0.0, 0.0, -1.0], start.shape)))


def find_around(directions: Real) -> Real:
    """Return the places of the head in directions from ``MIDDLE`` [shape=(N, 3)]."""
    far = trace_rays(MIDDLE + 3 * directions, -directions, steps=90)
    return np.asarray(MIDDLE + (3 - far)[:, None] * directions)


def find_outward(places: Real) -> Real:
    """Return the normals of the head at places on it [shape=(N, 3)], of length 1."""
    step = 2e-3
    slope = np.stack([to_head(places + step * axis) - to_head(places - step * axis) for axis in np.eye(3)], axis=1)
    return np.asarray(slope / np.linalg.norm(slope, axis=1, keepdims=True))
