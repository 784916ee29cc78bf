"""The skin of the face with lips and eyelids: one surface, its binding to lips and jaw, and its places in a pose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, cKDTree

from lipmotion.articulation.contact import smooth_step
from lipmotion.meshes.model.surface import compute_normals
from lipmotion_faces.head.eyes import LID_COLUMNS, LID_RINGS, Eyelids
from lipmotion_faces.head.lips import (
    ACROSS,
    COLUMNS,
    RINGS,
    SIDE,
    VISIBLE_RINGS,
    closed_share,
    lip_surface,
    section_points,
)
from lipmotion_faces.head.part import MIDDLE, MOUTH_Y, head, outward, seen_from_front, seen_from_middle
from lipmotion_faces.head.pose import CharacterPose
from lipmotion_faces.rendering.lighting import unit

Real = NDArray[np.float64]
Index = NDArray[np.intp]

SPACING = 0.033
"""Distance of the vertices in the middle of the face, in radians about ``MIDDLE``."""
HINGE = np.array([0.0, -0.32, -0.82])
"""The axis of the jaw goes through here, from ear to ear."""
REST = CharacterPose()
CHEEKS_SPREAD, CHEEKS_ROUND = 0.035, 0.025
"""How far cheeks come forward beside spread lips, and sink beside round ones."""
CHEEKS_RAISED, NOSE_LIFT = 0.05, 0.07
"""How far a mood raises the cheeks, and the wings of a wrinkled nose."""
_LEFT_CORNER = 40
_OPPOSITE = -np.arange(COLUMNS) % COLUMNS
"""For every column of the lips the one of the other lip that it meets."""
_JOINED = {VISIBLE_RINGS - 1: 0.3}
"""By rings of the lips: how far the light on both sides of the seam is the same."""
AT_CORNER = (np.clip((np.abs(ACROSS) - 0.72) / 0.28, 0, 1) ** 2)[:, None]
"""How near each column of the lips is to a corner, 0 to 1 [shape=(COLUMNS, 1)]."""
_NEAR_CORNER = np.clip((np.abs(ACROSS) - 0.5) / 0.5, 0, 1)[:, None]
CORNER_LIGHT_SHARE, CORNER_SKIN_SHARE = 0.6, 0.75
"""How far the light at the corners is the same on both lips, and that of the skin before them."""
CALM_RADIUS = 0.035
"""Round the corners of the lips, where the surface folds, the shading changes less than the surface."""


@dataclass(frozen=True)
class Binding:
    """How vertices of the face follow the lips and the jaw.

    places     : at rest [shape=(N, 3)]; the first ones are those of the outer contour of the lips
    columns    : which columns of the lips these first ones are [indices]
    jaw_weight : how far they belong to the jaw [shape=(N,)]
    bound      : which of them follow the lips [B indices];  shares : of each column of the lips [shape=(B, COLUMNS)]
    cheeks, nose : how they move with raised cheeks and a wrinkled nose [shape=(N, 3), both]
    """

    places: Real
    columns: Index
    jaw_weight: Real
    bound: Index
    shares: Real
    cheeks: Real
    nose: Real

    def select(self, rows: Index) -> Binding:
        """Return the binding of some vertices alone, in ascending order, of that of all."""
        of = np.full(len(self.places), -1)
        of[self.bound] = np.arange(len(self.bound))
        bound, columns = np.flatnonzero(of[rows] >= 0), rows[rows < COLUMNS]
        places, jaw, cheeks, nose = (each[rows] for each in (self.places, self.jaw_weight, self.cheeks, self.nose))
        return Binding(places, columns, jaw, bound, self.shares[of[rows][bound]], cheeks, nose)

    def move(self, pose: CharacterPose, contour: Real, columns: Binding) -> Real:
        """Return the places [shape=(..., N, 3)], bound to columns of the contour [shape=(..., COLUMNS, 3)]."""
        places = self._by_jaw(pose)
        places[..., self.bound, :] += self.shares @ (contour - columns._by_jaw(pose))
        spread, roundness, cheek, sneer = (
            np.asarray(number)[..., None] for number in (pose.spread, pose.roundness, pose.mood.cheek, pose.mood.sneer)
        )
        raised = CHEEKS_SPREAD * spread - CHEEKS_ROUND * roundness + CHEEKS_RAISED * cheek
        places += raised * self.cheeks + NOSE_LIFT * sneer * self.nose
        places[..., : len(self.columns), :] = contour[..., self.columns, :]
        return places

    def _by_jaw(self, pose: CharacterPose) -> Real:
        """Return the places with the jaw of a pose [shape=(..., N, 3)]."""
        turned = move_jaw(self.places, pose.jaw)
        return np.asarray(self.places + self.jaw_weight[:, None] * (turned - self.places))


class Skin:
    """The skin: vertices of face, lips, wall of the mouth and lids, in this order.

    triangles : [shape=(F, 3)];  rest : places at rest [shape=(V, 3)];  normals : at rest [shape=(V, 3)]
    pieces    : the number of triangles of the face, the lips, the wall of the mouth and the lids, in this order
    """

    def __init__(self) -> None:
        self.lids_of_eye = Eyelids()
        contour = section_points(REST, np.zeros(COLUMNS))[0]
        self.base_z = seen_from_front(head, contour[:, 0], contour[:, 1])
        contour[:, 2] = self.base_z
        edge = self.lids_of_eye.edge()
        edges = np.concatenate([edge, edge * [-1, 1, 1]])
        fill = _fill(contour, edges)
        self.face = np.concatenate([contour, edges, fill])
        triangles = _triangles(self.face, len(contour), len(edges) // 2)
        self._first_lip = len(self.face)
        self._first_lid = self._first_lip + (RINGS - 1) * COLUMNS
        grids = [_closed_grid(self.lip_rows())]
        grids += [_closed_grid(self.lid_rows(0)[::-1]), _closed_grid(self.lid_rows(1))]
        self.triangles = np.concatenate([triangles, *grids]).astype(np.int32)
        front = 2 * VISIBLE_RINGS * COLUMNS
        wall, lids = len(grids[0]) - front, len(grids[1]) + len(grids[2])
        self.pieces = {"skin": len(triangles), "lips": front, "wall": wall, "lids": lids}
        self._contour = contour
        self.binding = self._bind(fill)
        self._columns = self.binding.select(np.arange(COLUMNS))
        self.rest = self.places(REST)
        self._meshed_rest = compute_normals(self.rest, self.triangles)
        self.normals = self._meshed_rest.copy()
        self.normals[len(contour) + len(edges) : len(self.face)] = outward(head, fill)
        self._before_lips = outward(head, contour)
        corners = self.rest[[0, _LEFT_CORNER]]
        beside = np.linalg.norm(self.rest[: len(self.face), None] - corners, axis=2).min(axis=1)
        self._calm = np.ones((len(self.rest), 1))
        self._calm[: len(self.face), 0] -= 0.85 * np.exp(-((beside / CALM_RADIUS) ** 2))

    def lip_rows(self) -> Index:
        """Return the vertices of the lips, ring by ring from the skin inwards [shape=(RINGS, COLUMNS)]."""
        inner = self._first_lip + np.arange((RINGS - 1) * COLUMNS).reshape(RINGS - 1, COLUMNS)
        return np.concatenate([np.arange(COLUMNS)[None], inner])

    def lid_rows(self, eye: int) -> Index:
        """Return the vertices of the lids of the left (0) or right (1) eye [shape=(LID_RINGS + 1, LID_COLUMNS)]."""
        outer = COLUMNS + eye * LID_COLUMNS + np.arange(LID_COLUMNS)
        first = self._first_lid + eye * LID_RINGS * LID_COLUMNS
        inner = first + np.arange(LID_RINGS * LID_COLUMNS).reshape(LID_RINGS, LID_COLUMNS)
        return np.concatenate([inner, outer[None]])

    def pose(self, pose: CharacterPose) -> tuple[Real, Real]:
        """Return places and normals of all vertices [shape=(V, 3), both], the head not turned."""
        places = self.places(pose)
        change = compute_normals(places, self.triangles) - self._meshed_rest
        normals = self.normals + self._calm * change
        rows, closed = self.lip_rows(), closed_share(pose)
        normals[rows[VISIBLE_RINGS - 1]] += closed * (
            normals[rows[VISIBLE_RINGS - 2]] - normals[rows[VISIBLE_RINGS - 1]]
        )
        beside = AT_CORNER * (CORNER_LIGHT_SHARE + (1 - CORNER_LIGHT_SHARE) * pose.roundness)
        for ring in range(1, VISIBLE_RINGS):
            of_ring = normals[rows[ring]]
            share = np.maximum(closed * _JOINED.get(ring, 0.0), beside)
            normals[rows[ring]] += 0.5 * share * (of_ring[_OPPOSITE] - of_ring)
        outer = rows[1:VISIBLE_RINGS]
        normals[outer] += CORNER_SKIN_SHARE * (1 - pose.roundness) * _NEAR_CORNER * (self._before_lips - normals[outer])
        return places, normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)

    def _bind(self, fill: Real) -> Binding:
        """Return how vertices of the face, of which ``fill`` are the last, are bound to columns of the lips and jaw."""
        contour, face = self._contour, self.face
        away = face[:, None, :2] - contour[None, :, :2]
        nearest, across = cKDTree(contour[:, :2]).query(face[:, :2])[0], np.linalg.norm(away, axis=2)
        angle = np.arctan2(face[:, 1] - MOUTH_Y, np.abs(face[:, 0]))
        up = np.sin(angle) ** 2
        reach = np.where(angle > 0, 0.18, 0.36) * up + 0.44 * (1 - up)
        near = np.clip(1 - nearest / reach, 0, 1) * (face[:, 2] > -0.65)
        self.lip_weight = smooth_step(near)
        bound = np.flatnonzero(self.lip_weight)
        length = np.linalg.norm(np.roll(contour, -1, axis=0) - np.roll(contour, 1, axis=0), axis=1)
        width = (0.016 + 0.55 * nearest[bound])[:, None]
        shares = length * np.exp(-0.5 * ((across[bound] - nearest[bound, None]) / width) ** 2)
        shares *= np.exp(-across[bound] / 0.5)
        shares = shares / shares.sum(axis=1, keepdims=True) * self.lip_weight[bound, None]
        out = np.stack([(np.abs(fill[:, 0]) - 0.40) / 0.15, (fill[:, 1] + 0.47) / 0.15], axis=1)
        share = np.exp(-np.sum(out**2, axis=1)) * (fill[:, 2] > -0.75)
        cheeks, nose = np.zeros_like(face), np.zeros_like(face)
        cheeks[len(face) - len(fill) :] = share[:, None] * (outward(head, fill) + np.array([0.0, 0.4, 0.0]))
        out = (np.abs(face[:, 0]) / 0.2) ** 4 + ((face[:, 1] + 0.4) / 0.14) ** 4
        nose[:, 1] = np.exp(-out) * (face[:, 2] > -0.5)
        jaw = smooth_step((-0.47 - face[:, 1]) / 0.40) * smooth_step((face[:, 2] + 0.98) / 0.45)
        return Binding(face, np.arange(COLUMNS), jaw, bound, shares, cheeks, nose)

    def places(self, pose: CharacterPose) -> Real:
        """Return the places of all vertices [shape=(V, 3)], the head not turned."""
        lips, face = self.lips_and_face(pose, self.binding)
        left = self.lids_of_eye.rings(pose).reshape(-1, 3)
        return np.concatenate([face, lips[1:].reshape(-1, 3), left, left * [-1, 1, 1]])

    def lips_and_face(self, pose: CharacterPose, binding: Binding) -> tuple[Real, Real]:
        """Return the places of the rings of the lips [shape=(..., RINGS, COLUMNS, 3)] and of vertices of the face.

        pose    : one, or several of ``pose.stacked``
        binding : of the vertices beside the lips [shape of their places=(..., N, 3)]
        """
        lips = lip_surface(section_points(pose, self.base_z))
        return lips, binding.move(pose, lips[..., 0, :, :], self._columns)


def move_jaw(places: Real, drop: Any) -> Real:
    """Return places turned with the jaw about its hinge; the chin drops by a length, or several [shape=(T, 1)]."""
    angle, (y, z) = drop / 0.72, (places - HINGE)[:, 1:].T
    down, forward = y * np.cos(angle) - z * np.sin(angle), y * np.sin(angle) + z * np.cos(angle)
    return np.stack([np.broadcast_to(places[:, 0], down.shape), HINGE[1] + down, HINGE[2] + forward], axis=-1)


def _fill(contour: Real, edges: Real) -> Real:
    """Return the vertices between mouth, eyes and the back of the head [shape=(N, 3)]."""
    rings = []
    for away in (0.016, 0.036, 0.06, 0.09):
        x = contour[:, 0] * (1 + away / 0.27)
        y = MOUTH_Y + (contour[:, 1] - MOUTH_Y) + SIDE * away * np.sqrt(np.maximum(1 - 0.94 * ACROSS**2, 0))
        step = 1 if away < 0.05 else 2
        rings.append(np.stack([x, y], axis=1)[::step])
    near = np.concatenate(rings)
    near3 = np.column_stack([near, seen_from_front(head, near[:, 0], near[:, 1])])
    count = int(1.75 / SPACING)
    i, j = np.meshgrid(np.arange(-count, count + 1), np.arange(-int(count * 1.2), int(count * 1.2) + 1))
    u, v = SPACING * (i + 0.5 * (j % 2)).ravel(), SPACING * 0.866 * j.ravel()
    radius = np.hypot(u, v)
    u, v = u[radius < 1.72], v[radius < 1.72]
    radius = np.hypot(u, v)
    angle = radius + 0.11 * radius**3  # on the map of the head, whose middle is the front; its rim is stretched
    flat = np.sin(angle) / np.maximum(radius, 1e-9)
    places = seen_from_middle(head, np.stack([u * flat, v * flat, np.cos(angle)], axis=1))
    close = cKDTree(near3).query(places)[0] < 0.024
    inside = (np.abs(places[:, 0]) < 0.36) & _within(places[:, :2], near[-len(rings[-1]) :]) & (places[:, 2] > -0.5)
    at_eye = cKDTree(edges).query(places)[0] < 0.02
    for side in (1, -1):
        ring = edges[: len(edges) // 2, :2] * [side, 1]
        at_eye |= _within(places[:, :2], ring) & (places[:, 2] > -0.6)
    return np.concatenate([near3, places[~(close | inside | at_eye)]])


def _triangles(face: Real, contour: int, edge: int) -> NDArray[np.int32]:
    """Return the triangles between the vertices of the face, none in mouth and eyes [shape=(F, 3)]."""
    away = unit(face - MIDDLE)  # on the map of the head, without the stretching of its rim
    across = np.maximum(np.hypot(away[:, 0], away[:, 1]), 1e-9)
    flat = away[:, :2] / across[:, None] * np.arccos(np.clip(away[:, 2], -1, 1))[:, None]
    triangles = Delaunay(flat).simplices
    middle = flat[triangles].mean(axis=1)
    x, y, z = face[triangles].mean(axis=1).T
    under_hair = (y > 1.0 - 0.6 * np.maximum(np.abs(x) - 0.2, 0)) | ((y > 0.1) & (z < -0.75)) | (z < -1.2)
    hole = _within(middle, flat[:contour]) | under_hair
    for eye in range(2):
        hole |= _within(middle, flat[contour + eye * edge : contour + (eye + 1) * edge])
    triangles = triangles[~hole]
    a, b, c = (flat[triangles[:, n]] for n in range(3))
    turned = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0] < 0
    triangles[turned] = triangles[turned][:, ::-1]
    return triangles.astype(np.int32)


def _within(points: Real, polygon: Real) -> NDArray[np.bool_]:
    following = np.roll(polygon, -1, axis=0)
    inside = np.zeros(len(points), bool)
    for (xa, ya), (xb, yb) in zip(polygon.tolist(), following.tolist(), strict=True):
        if ya != yb:
            crosses = (ya > points[:, 1]) != (yb > points[:, 1])
            inside ^= crosses & (points[:, 0] < (xb - xa) * (points[:, 1] - ya) / (yb - ya) + xa)
    return inside


def _closed_grid(rows: Index) -> NDArray[np.int32]:
    """Return the triangles between successive closed rings of vertices [shape=(rings, columns)]; (F, 3)."""
    a, b = rows[:-1], rows[1:]
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    return np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3).astype(np.int32)
