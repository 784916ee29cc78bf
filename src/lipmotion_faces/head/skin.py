"""The skin of the face with lips and eyelids: one surface, its binding to lips and jaw, and its places in a pose.

The lips are a closed loop of ``COLUMNS`` columns: the upper lip from the right corner to the left one, then the lower
lip back. Every column runs through ``RINGS`` rings: from the skin over the lip into the mouth, and on along the wall of
the mouth to the throat.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial import Delaunay, cKDTree

from lipmotion.articulation.contact import MIN_GAP, smooth_step
from lipmotion_faces.characters.surface import compute_normals
from lipmotion_faces.head.eyes import LID_COLUMNS, LID_RINGS, Eyelids
from lipmotion_faces.head.part import MIDDLE, MOUTH_Y, find_around, find_front, find_outward
from lipmotion_faces.head.pose import CharacterPose
from lipmotion_faces.rendering.lighting import normalise

Real = NDArray[np.float64]

_UPPER_COLUMNS = 41
COLUMNS = 2 * _UPPER_COLUMNS - 2
REST_HALF_WIDTH = 0.268
TEETH_Z = -0.055  # front of the incisors
TEETH_EDGE = MOUTH_Y - 0.017  # height of the edge of the upper incisors; they belong to the skull
ARCH = 1.15  # curvature of lips and teeth seen from above: how far they lie back, over x squared
_UPPER_LIP, _LOWER_LIP = 0.076, 0.106
OVAL_SQUEEZE = 0.14  # how much nearer to the middle the inner edge of an oval mouth lies than the corners
HOLE_WIDTH = (0.014, 0.6)
"""Half the width of a round hole, round which the lips run as a ring: a length, and a share of the gap."""
RING_GAP, LINE_SHARE = 0.01, 0.25
"""Below this gap the hole of round lips widens to a line, by so much: more, and sums of blendshapes fit worse."""
ROUND_BOW = 0.0012
"""How far the middle of a round hole is raised: its middle lies before its sides, and the camera looks down on it."""
SEAM_GAP, SEAM_FORWARD = 0.03, 0.026
"""Below this gap the seam of the lips comes forward, at most so far: the crease between closed lips is shallow."""
ROUND_DROP = 0.025  # how far the line between round lips sinks: the upper lip hides the teeth
REST_SMILE, SMILE_GAP = 0.027, 0.05
"""How far the corners rise at rest; parted, pressed and round lips do not smile, from this gap on. Tucked ones do: with
lower corners, teeth on the lip look like contempt."""
BITTEN_EDGE_Y = TEETH_EDGE + 0.017  # height of the edge of the lower lip on the upper teeth
_KNOTS = np.array([0, 0.22, 0.5, 0.72, 0.88, 0.98, 1.12, 1.4])
_AT = np.array([0.0, 0.09, 0.2, 0.31, 0.41, 0.5, 0.58, 0.66, 0.74, 0.81, 0.88, 0.94, 1.0, 1.12, 1.4])
_SECTION: Real = np.asarray(CubicSpline(_KNOTS, np.eye(len(_KNOTS)))(_AT))
_WALL = ((0.10, -0.16), (0.26, -0.30), (0.7, -0.40), (1.0, -0.42))
"""Rings behind the lips: how far towards the middle of the throat, and how far back."""
RINGS = len(_AT) + len(_WALL)
VISIBLE_RINGS = 11  # rings up to this one can be seen as lips; those behind are the wall of the mouth


_UPPER_ACROSS = np.sin(np.linspace(-np.pi / 2, np.pi / 2, _UPPER_COLUMNS))
ACROSS: Real = np.concatenate([_UPPER_ACROSS, _UPPER_ACROSS[-2:0:-1]])
"""Place of every column between the right corner (-1) and the left one (1)."""
SIDE: Real = np.concatenate([np.ones(_UPPER_COLUMNS), -np.ones(_UPPER_COLUMNS - 2)])
"""1 on the upper lip, -1 on the lower one."""


def _smooth(knots: list[tuple[float, float]]) -> Real:
    x, y = np.array(knots).T
    x, y = np.concatenate([-x[:0:-1], x]), np.concatenate([y[:0:-1], y])
    return np.asarray(CubicSpline(x, y)(ACROSS))


_BOW = _smooth([(0, 0.80), (0.2, 0.97), (0.36, 0.92), (0.62, 0.66), (0.85, 0.39), (1, 0)])
_LOWER_BOW = _smooth([(0, 1.0), (0.25, 0.97), (0.5, 0.83), (0.72, 0.59), (0.89, 0.35), (1, 0)])
_LINE = _smooth([(0, -0.006), (0.15, -0.005), (0.4, -0.002), (0.7, 0.005), (0.88, 0.010), (1, 0.014)])
_ENVELOPE = np.sqrt(np.maximum(1 - ACROSS**2, 0))
_FULL = np.where(SIDE > 0, _BOW, _LOWER_BOW)


def place_sections(pose: CharacterPose, base_z: Real) -> Real:
    """Return the eight points of the cross-section of every column [shape=(8, COLUMNS, 3); stacked: (T, 8, ...)].

    pose   : one, or several of ``pose.stack_poses``
    base_z : depth of the skin under the outer contour at rest [shape=(COLUMNS,)]
    The fifth point is where the lips meet; the first is the contour, where the skin begins.
    """
    upper = SIDE > 0
    half = REST_HALF_WIDTH * pose.width
    x = half * ACROSS
    rise = pose.upper_rise
    drop = pose.gap - rise
    middle = _find_between(pose)
    # how much nearer to the middle than the corners the inner edge of the lips lies
    hole_share = (HOLE_WIDTH[0] + HOLE_WIDTH[1] * pose.gap) / (REST_HALF_WIDTH * pose.width)
    as_ring = np.maximum(1 - hole_share, 0.0) * (1 - 0.6 * pose.press) * (1 - LINE_SHARE * find_closure(pose, RING_GAP))
    squeeze = as_ring * pose.roundness + OVAL_SQUEEZE * pose.oval * (1 - pose.roundness)
    rounded = _ENVELOPE ** (1 + np.minimum(2 * pose.roundness, 1.0))
    belly = rounded + squeeze * (1 - rounded)
    hole, contour = _shape_opening(pose)
    inner_y = middle + np.where(upper, rise, -drop) * hole
    full = _FULL + 0.85 * pose.roundness * (_ENVELOPE - _FULL)
    full = full + 0.4 * pose.spread * (_ENVELOPE - full)
    thick = np.where(upper, _UPPER_LIP, _LOWER_LIP) * full
    thick = thick * pose.fullness * (1 - 0.35 * pose.press) * np.where(upper, 1.0, 1 - 0.45 * pose.tuck)
    fuller = 1 + pose.roundness * 0.35 * ACROSS**2 * _ENVELOPE  # near the corners of a round mouth
    outer_y = middle + np.where(upper, rise, -drop) * contour + SIDE * thick * fuller
    forward = pose.protrusion * (1 - 0.45 * ACROSS**2)
    arch = -ARCH * (x**2 - (REST_HALF_WIDTH * ACROSS) ** 2)
    back = np.where(upper, 0.0, 0.22 * drop + 0.05 * pose.tuck) * _ENVELOPE
    outer_z = base_z + 0.85 * forward + arch - back
    lower_back = np.where(upper, 0.0, 0.25 * drop) * contour
    meet = _find_meeting(pose, base_z, 1 - squeeze) - lower_back
    bulge = (0.056 - 0.006 * SIDE * _ENVELOPE) * belly * pose.fullness * (1 - 0.3 * pose.press)
    inner_x = x * (1 - squeeze)
    teeth = TEETH_Z - ARCH * inner_x**2
    tuck = pose.tuck * np.where(upper, 0.0, 1.0) * _ENVELOPE
    contact_z = meet - 0.002 + 0.02 * belly * pose.roundness
    contact_z = contact_z + SEAM_FORWARD * (1 - 0.45 * pose.press) * belly * find_closure(pose)
    contact_z = contact_z + tuck * (teeth + 0.02 - contact_z)
    below_upper = np.minimum(BITTEN_EDGE_Y - middle, rise - MIN_GAP)  # the teeth part the lips
    on_teeth = np.minimum(middle + below_upper * hole, inner_y + 0.08)
    inner_y = np.where(upper, inner_y, np.maximum(inner_y, inner_y + tuck * (on_teeth - inner_y)))
    crest = _find_meeting(pose, base_z, 1 - 0.5 * squeeze) - lower_back + bulge * (1 - 0.25 * tuck) - 0.03 * tuck
    behind = np.maximum(teeth + 0.022, contact_z - 0.10)
    y = outer_y
    broad = inner_y + pose.roundness * (middle + np.where(upper, rise, -drop) * contour - inner_y)
    crest_y = broad + 0.42 * (y - broad)
    deep = (0.13 - 0.05 * pose.roundness) * _ENVELOPE + 0.012
    rows = [
        (x, y, outer_z),
        (x * (1 - 0.2 * squeeze), inner_y + 0.76 * (y - inner_y), outer_z + 0.5 * (crest - outer_z)),
        (x * (1 - 0.5 * squeeze), crest_y, crest),
        (x * (1 - 0.85 * squeeze), inner_y + 0.31 * (crest_y - inner_y), contact_z + 0.66 * (crest - contact_z)),
        (inner_x, inner_y, contact_z),
        (x * (1 - 0.88 * squeeze), inner_y + SIDE * 0.014 * _ENVELOPE, 0.5 * (contact_z + behind)),
        (x * (1 - 0.45 * squeeze), inner_y + SIDE * (0.05 * _ENVELOPE + 0.002), behind),
        ((1.12 - 0.2 * pose.roundness) * x, inner_y + SIDE * deep, behind - 0.01),
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-3)


def _find_meeting(pose: CharacterPose, base_z: Real, inwards: Any) -> Real:
    """Return how far forward the lips meet, at places that much nearer to the middle [shape=(..., COLUMNS)]."""
    across = inwards * ACROSS
    lower_z = np.concatenate([base_z[:1], base_z[: _UPPER_COLUMNS - 1 : -1], base_z[_UPPER_COLUMNS - 1 :][:1]])
    between = np.interp(across, ACROSS[:_UPPER_COLUMNS], 0.5 * (base_z[:_UPPER_COLUMNS] + lower_z))
    curved = ARCH * REST_HALF_WIDTH**2 * (pose.width**2 - 1)
    return np.asarray(between + pose.protrusion - (0.45 * pose.protrusion + curved) * across**2)


def find_closure(pose: CharacterPose, apart: float = SEAM_GAP) -> Any:
    """Return how nearly the lips are closed: 1 where they touch, 0 from a gap of ``apart`` on [shape of the gap]."""
    return smooth_step(np.asarray(1 - pose.gap / apart))


def _find_between(pose: CharacterPose) -> Real:
    """Return the height of the line between the lips, closed, at every column [shape=(..., COLUMNS)]."""
    line = (1 - pose.roundness - 0.6 * pose.spread) * _LINE
    lowered = 0.22 * pose.gap * (1 - 0.6 * pose.spread) * (1 - 0.75 * pose.roundness)
    still = np.maximum(find_closure(pose, SMILE_GAP), pose.tuck)
    at_rest = REST_SMILE * still * (1 - pose.press) * (1 - pose.roundness)
    raised = (pose.smile + at_rest - lowered) * ACROSS**2
    bowed = ROUND_BOW * (1 - ACROSS**2) - ROUND_DROP - 0.2 * pose.gap
    return np.asarray(MOUTH_Y + line + raised + bowed * pose.roundness)


def _shape_opening(pose: CharacterPose) -> tuple[Real, Real]:
    """Return the shapes of hole and outer contour, 1 in the middle, 0 at the corners [shape=(..., COLUMNS), both]."""
    reach = 1 - 0.10 * pose.oval - 0.30 * pose.tuck
    power = 2 + 1.2 * pose.spread
    inside = np.maximum(1 - np.abs(ACROSS / reach) ** power, 0)
    oval = (0.25 * np.clip(pose.gap / 0.2, 0, 1) + 0.2 * pose.oval) * (1 - pose.spread) * (1 - pose.roundness)
    hole = inside ** (0.92 - 0.40 * pose.roundness - 0.36 * pose.spread - oval)
    contour = np.maximum(1 - ACROSS**2, 0) ** (0.85 - 0.25 * pose.roundness - 0.33 * pose.spread - 0.7 * oval)
    return hole, contour


def place_lips(points: Real) -> Real:
    """Return the places of lips and wall of the mouth [shape=(..., RINGS, COLUMNS, 3)] from ``place_sections``."""
    front = np.einsum("rp,...pcx->...rcx", _SECTION, points)
    last = front[..., -1, :, :]
    middle = last.mean(axis=-2, keepdims=True)
    wall = []
    for inward, back in _WALL:
        ring = last + inward * (middle * [0, 1, 1] - last)
        ring[..., 2] += back
        wall.append(ring)
    return np.concatenate([front, np.stack(wall, axis=-3)], axis=-3)


Index = NDArray[np.intp]

SPACING = 0.033  # distance of the vertices in the middle of the face, in radians about ``MIDDLE``
HINGE = np.array([0.0, -0.32, -0.82])  # the axis of the jaw goes through here, from ear to ear
REST = CharacterPose()
CHEEKS_SPREAD, CHEEKS_ROUND = 0.035, 0.025  # how far cheeks come forward beside spread lips, and sink beside round ones
CHEEKS_RAISED, NOSE_LIFT = 0.05, 0.07  # how far a mood raises the cheeks, and the wings of a wrinkled nose
_LEFT_CORNER = 40
_OPPOSITE = -np.arange(COLUMNS) % COLUMNS  # for every column of the lips the one of the other lip that it meets
_JOINED = {VISIBLE_RINGS - 1: 0.3}  # by rings of the lips: how far the light on both sides of the seam is the same
AT_CORNER = (np.clip((np.abs(ACROSS) - 0.72) / 0.28, 0, 1) ** 2)[:, None]
"""How near each column of the lips is to a corner, 0 to 1 [shape=(COLUMNS, 1)]."""
_NEAR_CORNER = np.clip((np.abs(ACROSS) - 0.5) / 0.5, 0, 1)[:, None]
CORNER_LIGHT_SHARE, CORNER_SKIN_SHARE = 0.6, 0.75
"""How far the light at the corners is the same on both lips, and that of the skin before them."""
CALM_RADIUS = 0.035  # round the corners of the lips, where the surface folds, the shading changes less than the surface


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
        places = self._move_by_jaw(pose)
        places[..., self.bound, :] += self.shares @ (contour - columns._move_by_jaw(pose))
        spread, roundness, cheek, sneer = (
            np.asarray(number)[..., None] for number in (pose.spread, pose.roundness, pose.mood.cheek, pose.mood.sneer)
        )
        raised = CHEEKS_SPREAD * spread - CHEEKS_ROUND * roundness + CHEEKS_RAISED * cheek
        places += raised * self.cheeks + NOSE_LIFT * sneer * self.nose
        places[..., : len(self.columns), :] = contour[..., self.columns, :]
        return places

    def _move_by_jaw(self, pose: CharacterPose) -> Real:
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
        contour = place_sections(REST, np.zeros(COLUMNS))[0]
        self.base_z = find_front(contour[:, 0], contour[:, 1])
        contour[:, 2] = self.base_z
        edge = self.lids_of_eye.find_edge()
        edges = np.concatenate([edge, edge * [-1, 1, 1]])
        fill = _fill(contour, edges)
        self.face = np.concatenate([contour, edges, fill])
        triangles = _list_triangles(self.face, len(contour), len(edges) // 2)
        self._first_lip = len(self.face)
        self._first_lid = self._first_lip + (RINGS - 1) * COLUMNS
        grids = [_close_grid(self.list_lip_rows())]
        grids += [_close_grid(self.list_lid_rows(0)[::-1]), _close_grid(self.list_lid_rows(1))]
        self.triangles = np.concatenate([triangles, *grids]).astype(np.int32)
        front = 2 * VISIBLE_RINGS * COLUMNS
        wall, lids = len(grids[0]) - front, len(grids[1]) + len(grids[2])
        self.pieces = {"skin": len(triangles), "lips": front, "wall": wall, "lids": lids}
        self._contour = contour
        self.binding = self._bind(fill)
        self._columns = self.binding.select(np.arange(COLUMNS))
        self.rest = self.place(REST)
        self._meshed_rest = compute_normals(self.rest, self.triangles)
        self.normals = self._meshed_rest.copy()
        self.normals[len(contour) + len(edges) : len(self.face)] = find_outward(fill)
        self._before_lips = find_outward(contour)
        corners = self.rest[[0, _LEFT_CORNER]]
        corner_distance = np.linalg.norm(self.rest[: len(self.face), None] - corners, axis=2).min(axis=1)
        self._calm = np.ones((len(self.rest), 1))
        self._calm[: len(self.face), 0] -= 0.85 * np.exp(-((corner_distance / CALM_RADIUS) ** 2))

    def list_lip_rows(self) -> Index:
        """Return the vertices of the lips, ring by ring from the skin inwards [shape=(RINGS, COLUMNS)]."""
        inner = self._first_lip + np.arange((RINGS - 1) * COLUMNS).reshape(RINGS - 1, COLUMNS)
        return np.concatenate([np.arange(COLUMNS)[None], inner])

    def list_lid_rows(self, eye: int) -> Index:
        """Return the vertices of the lids of the left (0) or right (1) eye [shape=(LID_RINGS + 1, LID_COLUMNS)]."""
        outer = COLUMNS + eye * LID_COLUMNS + np.arange(LID_COLUMNS)
        first = self._first_lid + eye * LID_RINGS * LID_COLUMNS
        inner = first + np.arange(LID_RINGS * LID_COLUMNS).reshape(LID_RINGS, LID_COLUMNS)
        return np.concatenate([inner, outer[None]])

    def pose(self, pose: CharacterPose) -> tuple[Real, Real]:
        """Return places and normals of all vertices [shape=(V, 3), both], the head not turned."""
        places = self.place(pose)
        change = compute_normals(places, self.triangles) - self._meshed_rest
        normals = self.normals + self._calm * change
        rows, closed = self.list_lip_rows(), find_closure(pose)
        normals[rows[VISIBLE_RINGS - 1]] += closed * (
            normals[rows[VISIBLE_RINGS - 2]] - normals[rows[VISIBLE_RINGS - 1]]
        )
        corner_share = AT_CORNER * (CORNER_LIGHT_SHARE + (1 - CORNER_LIGHT_SHARE) * pose.roundness)
        for ring in range(1, VISIBLE_RINGS):
            of_ring = normals[rows[ring]]
            share = np.maximum(closed * _JOINED.get(ring, 0.0), corner_share)
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
        cheeks[len(face) - len(fill) :] = share[:, None] * (find_outward(fill) + np.array([0.0, 0.4, 0.0]))
        out = (np.abs(face[:, 0]) / 0.2) ** 4 + ((face[:, 1] + 0.4) / 0.14) ** 4
        nose[:, 1] = np.exp(-out) * (face[:, 2] > -0.5)
        jaw = smooth_step((-0.47 - face[:, 1]) / 0.40) * smooth_step((face[:, 2] + 0.98) / 0.45)
        return Binding(face, np.arange(COLUMNS), jaw, bound, shares, cheeks, nose)

    def place(self, pose: CharacterPose) -> Real:
        """Return the places of all vertices [shape=(V, 3)], the head not turned."""
        lips, face = self.place_both(pose, self.binding)
        left = self.lids_of_eye.place_rings(pose).reshape(-1, 3)
        return np.concatenate([face, lips[1:].reshape(-1, 3), left, left * [-1, 1, 1]])

    def place_both(self, pose: CharacterPose, binding: Binding) -> tuple[Real, Real]:
        """Return the places of the rings of the lips [shape=(..., RINGS, COLUMNS, 3)] and of vertices of the face.

        pose    : one, or several of ``pose.stack_poses``
        binding : of the vertices beside the lips [shape of their places=(..., N, 3)]
        """
        lips = place_lips(place_sections(pose, self.base_z))
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
    near3 = np.column_stack([near, find_front(near[:, 0], near[:, 1])])
    count = int(1.75 / SPACING)
    i, j = np.meshgrid(np.arange(-count, count + 1), np.arange(-int(count * 1.2), int(count * 1.2) + 1))
    u, v = SPACING * (i + 0.5 * (j % 2)).ravel(), SPACING * 0.866 * j.ravel()
    radius = np.hypot(u, v)
    u, v = u[radius < 1.72], v[radius < 1.72]
    radius = np.hypot(u, v)
    angle = radius + 0.11 * radius**3  # on the map of the head, whose middle is the front; its rim is stretched
    flat = np.sin(angle) / np.maximum(radius, 1e-9)
    places = find_around(np.stack([u * flat, v * flat, np.cos(angle)], axis=1))
    close = cKDTree(near3).query(places)[0] < 0.024
    inside = (np.abs(places[:, 0]) < 0.36) & _mark_in(places[:, :2], near[-len(rings[-1]) :]) & (places[:, 2] > -0.5)
    at_eye = cKDTree(edges).query(places)[0] < 0.02
    for side in (1, -1):
        ring = edges[: len(edges) // 2, :2] * [side, 1]
        at_eye |= _mark_in(places[:, :2], ring) & (places[:, 2] > -0.6)
    return np.concatenate([near3, places[~(close | inside | at_eye)]])


def _list_triangles(face: Real, contour: int, edge: int) -> NDArray[np.int32]:
    """Return the triangles between the vertices of the face, none in mouth and eyes [shape=(F, 3)]."""
    away = normalise(face - MIDDLE)  # on the map of the head, without the stretching of its rim
    across = np.maximum(np.hypot(away[:, 0], away[:, 1]), 1e-9)
    flat = away[:, :2] / across[:, None] * np.arccos(np.clip(away[:, 2], -1, 1))[:, None]
    triangles = Delaunay(flat).simplices
    middle = flat[triangles].mean(axis=1)
    x, y, z = face[triangles].mean(axis=1).T
    under_hair = (y > 1.0 - 0.6 * np.maximum(np.abs(x) - 0.2, 0)) | ((y > 0.1) & (z < -0.75)) | (z < -1.2)
    hole = _mark_in(middle, flat[:contour]) | under_hair
    for eye in range(2):
        hole |= _mark_in(middle, flat[contour + eye * edge : contour + (eye + 1) * edge])
    triangles = triangles[~hole]
    a, b, c = (flat[triangles[:, n]] for n in range(3))
    turned = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0] < 0
    triangles[turned] = triangles[turned][:, ::-1]
    return triangles.astype(np.int32)


def _mark_in(points: Real, polygon: Real) -> NDArray[np.bool_]:
    following = np.roll(polygon, -1, axis=0)
    inside = np.zeros(len(points), bool)
    for (xa, ya), (xb, yb) in zip(polygon.tolist(), following.tolist(), strict=True):
        if ya != yb:
            crosses = (ya > points[:, 1]) != (yb > points[:, 1])
            inside ^= crosses & (points[:, 0] < (xb - xa) * (points[:, 1] - ya) / (yb - ya) + xa)
    return inside


def _close_grid(rows: Index) -> NDArray[np.int32]:
    """Return the triangles between successive closed rings of vertices [shape=(rings, columns)]; (F, 3)."""
    a, b = rows[:-1], rows[1:]
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    return np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3).astype(np.int32)
