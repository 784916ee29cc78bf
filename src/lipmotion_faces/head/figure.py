"""The 3D head (``--face head``): hair and other parts put together, places and light of all vertices in a pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator

from lipmotion.articulation.contact import smooth_step
from lipmotion_faces.base import rotate_head
from lipmotion_faces.characters.surface import compute_normals
from lipmotion_faces.characters.textures import decode_srgb
from lipmotion_faces.head import eyes, inside, palette
from lipmotion_faces.head.part import EYE, MIDDLE, Part, find_around, join, make_grid, make_part, make_tube
from lipmotion_faces.head.pose import CharacterPose
from lipmotion_faces.head.skin import ACROSS, AT_CORNER, REST, RINGS, VISIBLE_RINGS, Skin, find_closure, move_jaw
from lipmotion_faces.rendering.lighting import Finish, Lighting, Triple, measure_reach, normalise

BUN = np.array([0.0, 1.40, -0.98])  # middle of the bun
_LINE = (
    (0.0, 0.78, 0.0), (0.30, 0.76, -0.04), (0.54, 0.64, -0.14), (0.69, 0.44, -0.26), (0.74, 0.20, -0.40),
    (0.76, -0.02, -0.52), (0.80, -0.10, -0.68), (0.82, 0.02, -0.80), (0.82, -0.12, -0.98), (0.72, -0.50, -1.16),
    (0.42, -0.70, -1.26), (0.0, -0.74, -1.28),
)  # fmt: skip
"""About where the hair begins, from the middle of the forehead round the left ear to the nape."""
_FRINGE = (
    (-0.74, 0.06, -0.42, 0.10), (-0.70, 0.24, -0.36, 0.115), (-0.60, 0.40, -0.24, 0.115), (-0.45, 0.52, -0.12, 0.10),
    (0.72, 0.16, -0.38, 0.09), (0.64, 0.36, -0.28, 0.095), (0.50, 0.52, -0.14, 0.085),
)  # fmt: skip
"""Where the locks of the fringe end, and how wide they are; all begin at the parting."""
_STRAND = (
    (0.77, 0.16, -0.46, 0.02), (0.80, -0.08, -0.42, 0.05), (0.74, -0.36, -0.36, 0.07), (0.66, -0.62, -0.40, 0.11),
    (0.66, -0.84, -0.40, 0.20),
)  # fmt: skip
"""A loose strand before the left ear."""
_COLUMNS, _ROWS = 270, 30


def make_hair() -> Part:
    """Return all the hair."""
    locks = [_make_lock(_STRAND, 0.034, 0.02, 0.1), _make_lock([(-x, *rest) for x, *rest in _STRAND], 0.034, 0.02, 0.1)]
    fringe = []
    for n, (x, y, z, wide) in enumerate(_FRINGE):
        start = 0.24 + 0.015 * n
        points = [
            (start, 0.97, -0.2, -0.03),
            (start + 0.12 * x, 0.90, -0.02, 0.10),
            (0.5 * (start + x), 0.74 - 0.06 * abs(x), -0.03, 0.115),
            (0.97 * x, y + 0.20, z + 0.08, 0.08),
            (1.02 * x, y - 0.06, z - 0.06, 0.035),
        ]
        fringe.append(_make_lock(points, wide, 0.05, 0.22 * (-1) ** n))
    return join("hair", [_make_cap(), _make_bun(), *fringe, *locks])


def _make_cap() -> Part:
    half_loop = np.array(_LINE)
    loop = np.concatenate([half_loop, half_loop[-2:0:-1] * [-1, 1, 1], half_loop[:1]])
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(loop, axis=0), axis=1))])
    curve = CubicSpline(length, loop, bc_type="periodic")(np.arange(_COLUMNS) / _COLUMNS * length[-1])
    line = find_around(normalise(curve - MIDDLE))  # where the hair begins, clockwise from above
    start, pole = normalise(line - MIDDLE), normalise(BUN - MIDDLE)
    share = np.linspace(0, 1, _ROWS)[:, None, None] ** 1.15
    angle = np.arccos(np.clip(start @ pole, -1, 1))[None, :, None]
    ways = (np.sin((1 - share) * angle) * start + np.sin(share * angle) * pole) / np.sin(angle)
    skin = find_around(ways.reshape(-1, 3)).reshape(ways.shape)
    phase = 2 * np.pi * np.arange(_COLUMNS) / _COLUMNS
    share = share[..., 0]
    wave = 0.5 * np.sin(23 * phase + 2 * np.sin(3 * phase)) + 0.3 * np.sin(41 * phase + 1.3) + 0.2 * np.sin(67 * phase)
    ridge = np.asarray(1 - 2 * np.abs(wave) ** 0.8)  # grooves between strands
    rise = 0.085 * np.clip(share / 0.16, 0, 1) ** 0.5 + 0.02 * np.sin(np.pi * share)
    rise = rise + 0.026 * ridge * np.clip(share / 0.1, 0, 1) * np.clip((1 - share) / 0.1, 0.3, 1)
    places = skin + rise[..., None] * ways - 0.015 * (1 - np.clip(share / 0.05, 0, 1))[..., None] * ways
    along = normalise(np.gradient(places, axis=0).reshape(-1, 3))
    colours = _streak(np.broadcast_to(ridge, rise.shape).ravel())
    triangles = make_grid(_ROWS, _COLUMNS, closed=True)[:, ::-1]
    return make_part("cap", places.reshape(-1, 3), triangles, colours, palette.HAIR_FINISH, along)


def _streak(height: Real) -> Real:
    light = np.clip(0.5 + 0.5 * height, 0, 1)[:, None]
    deep, middle, bright = (np.array(c) for c in (palette.HAIR_DEEP, palette.HAIR, palette.HAIR_LIGHT))
    shaded, lit = deep + 2 * light * (middle - deep), middle + (2 * light - 1) * 0.55 * (bright - middle)
    return np.where(light < 0.5, shaded, lit)


def _make_bun() -> Part:
    down, around = np.meshgrid(np.linspace(0.02, np.pi - 0.02, 36), 2 * np.pi * np.arange(128) / 128, indexing="ij")
    twist = around + 1.5 * down
    height = np.cos(8 * twist + 1.4 * np.sin(2 * down))
    radius = 1 + 0.04 * height * np.sin(down)
    x, z = 0.40 * radius * np.sin(down) * np.cos(around), 0.38 * radius * np.sin(down) * np.sin(around)
    places = np.stack([x, 0.33 * radius * np.cos(down), z], axis=-1)
    strands = normalise(np.stack([-np.sin(around), 0.6 * np.ones_like(around), np.cos(around)], axis=-1).reshape(-1, 3))
    triangles = make_grid(36, 128, closed=True)[:, ::-1]
    colours = _streak(height.ravel())
    return make_part("bun", places.reshape(-1, 3) + BUN, triangles, colours, palette.HAIR_FINISH, strands)


def _make_lock(points: Sequence[Sequence[float]], wide: float, thick: float, shade: float) -> Part:
    """Return a lock along places (x, y, z, and the distance from the skin below)."""
    knots = np.array(points)
    share = np.linspace(0, 1, 36)
    curve = CubicSpline(np.linspace(0, 1, len(knots)), knots)(share)
    ways = normalise(curve[:, :3] - MIDDLE)
    path = find_around(ways) + curve[:, 3:] * ways
    taper = np.clip(1.15 * np.sin(np.pi * np.clip(0.12 + 0.87 * share, 0, 1)), 0.015, 1) ** 0.7
    places, triangles, strands = make_tube(path, wide * taper, thick * taper, ways, sides=16)
    across = np.tile(np.cos(2 * np.pi * np.arange(16) / 16), 36)
    colours = _streak(shade + 0.35 * np.cos(9 * across))
    return make_part("lock", places, triangles, colours, palette.HAIR_FINISH, strands)


Real = NDArray[np.float64]

_SIDES = 64


def make_ear() -> Part:
    """Return the left ear."""
    around = 2 * np.pi * np.arange(48) / 48
    ring = np.array([0.0, 0.22, 0.42, 0.58, 0.70, 0.79, 0.87, 0.94, 1.0, 1.0, 0.93, 0.75])
    relief = np.array([-0.028, -0.03, -0.03, -0.022, 0.008, -0.006, 0.012, 0.03, 0.012, -0.02, -0.05, -0.09])
    outline = np.where(np.sin(around) > 0, 0.215, 0.235)
    wide = 0.145 * (1 + 0.18 * np.sin(around)) * np.where(np.cos(around) > 0, 1.0, 0.62)
    u = ring[:, None] * wide * np.cos(around)
    v = ring[:, None] * outline * np.sin(around)
    soft = np.where(np.sin(around) < -0.75, 0.4, 1.0)
    w = relief[:, None] * np.where(ring[:, None] > 0.6, soft, 1.0) * np.ones(48) + 0.02
    turn = 0.95
    back, out = np.array([np.sin(turn) * 0.9, 0.10, -np.cos(turn)]), np.array([np.cos(turn), 0, np.sin(turn)])
    up = np.array([0.14, 1.0, -0.10])
    places = np.array([0.80, -0.20, -0.80]) + u[..., None] * back + v[..., None] * up + w[..., None] * out
    colours = np.broadcast_to(np.array(palette.SKIN), places.shape).copy()
    warm = np.exp(-(((ring - 0.4) / 0.3) ** 2))[:, None, None] * 0.35 + 0.15
    colours = (1 - warm) * colours + warm * np.array(palette.BLUSH)
    triangles = make_grid(len(ring), 48, closed=True)
    return make_part("ear", places.reshape(-1, 3), triangles, colours.reshape(-1, 3), palette.SKIN_FINISH)


def make_earring() -> Part:
    """Return the left ear's ring, a small ball."""
    down, around = np.meshgrid(np.linspace(0, np.pi, 12), 2 * np.pi * np.arange(20) / 20, indexing="ij")
    ball = np.stack([np.sin(down) * np.cos(around), np.cos(down), np.sin(down) * np.sin(around)], axis=-1)
    places = 0.035 * ball.reshape(-1, 3) + np.array([0.835, -0.455, -0.74])
    return make_part("earring", places, make_grid(12, 20, closed=True)[:, ::-1], palette.EARRING, palette.METAL_FINISH)


def _lathe(name: str, table: Sequence[Sequence[float]], count: int, colour: Triple, finish: Finish) -> Part:
    """Return a part of rings about the body from rows (height, half width, half depth, middle z, squareness)."""
    at = np.linspace(0, len(table) - 1, count)
    around = 2 * np.pi * np.arange(_SIDES) / _SIDES
    c, s = np.cos(around), np.sin(around)
    rows = []
    for y, wide, deep, z, square in PchipInterpolator(np.arange(len(table)), np.array(table))(at).tolist():
        x, forward = np.sign(c) * np.abs(c) ** (2 / square), np.sign(s) * np.abs(s) ** (2 / square)
        rows.append(np.stack([wide * x, np.full(_SIDES, y), z + deep * forward], axis=1))
    triangles = make_grid(count, _SIDES, closed=True)[:, ::-1]
    return make_part(name, np.concatenate(rows), triangles, colour, finish)


def make_neck() -> Part:
    """Return the neck, from under the hair to under the collar."""
    table = [
        (-0.55, 0.33, 0.30, -0.98, 2), (-1.0, 0.355, 0.34, -0.96, 2), (-1.45, 0.375, 0.36, -0.98, 2),
        (-1.75, 0.47, 0.40, -1.0, 2), (-1.95, 0.75, 0.45, -1.0, 2),
    ]  # fmt: skip
    return _lathe("neck", table, 26, palette.SKIN, palette.SKIN_FINISH)


def make_clothing() -> Part:
    """Return the pullover: shoulders and chest."""
    table = [
        (-1.60, 0.47, 0.44, -0.98, 2.0), (-1.66, 0.56, 0.50, -0.99, 2.0), (-1.78, 0.86, 0.56, -1.0, 2.05),
        (-1.92, 1.28, 0.60, -1.02, 2.1), (-2.08, 1.58, 0.62, -1.03, 2.15), (-2.35, 1.74, 0.66, -1.03, 2.2),
        (-2.8, 1.80, 0.72, -1.03, 2.2), (-3.4, 1.80, 0.75, -1.03, 2.2),
    ]  # fmt: skip
    return _lathe("clothing", table, 28, palette.CLOTH, palette.CLOTH_FINISH)


def make_collar() -> Part:
    """Return the ribbed collar."""
    around = 2 * np.pi * np.arange(121) / 120
    path = np.stack([0.475 * np.cos(around), -1.60 - 0.09 * np.sin(around), -0.98 + 0.44 * np.sin(around)], axis=1)
    upward = np.stack([np.cos(around), np.full(121, 0.35), np.sin(around)], axis=1)
    rib = 1 + 0.04 * np.cos(30 * around)
    places, triangles, _ = make_tube(path, 0.075 * np.ones(121), 0.05 * rib, upward, sides=10)
    return make_part("collar", places, triangles, palette.CLOTH_RIB, palette.CLOTH_FINISH)


CORNER_FADE_SHARE = 0.4  # how far the colour of the lips fades to that of the skin towards the corners


def paint_skin(skin: Skin) -> Real:
    """Return the diffuse reflection of all vertices of the skin, linear [shape=(V, 3)]."""
    x, y, z = np.abs(skin.rest[:, 0]), skin.rest[:, 1], skin.rest[:, 2]
    colour = np.broadcast_to(np.array(palette.SKIN), skin.rest.shape).copy()

    def tint(strength: float, middle: tuple[float, float], radii: tuple[float, float], wanted: Triple) -> None:
        spot = np.exp(-(((x - middle[0]) / radii[0]) ** 2) - ((y - middle[1]) / radii[1]) ** 2)
        share = strength * spot[:, None] * (z > -0.85)[:, None]
        colour[:] = (1 - share) * colour + share * np.array(wanted)

    tint(0.5, (0, 0.45), (0.5, 0.3), palette.SKIN_LIGHT)
    tint(0.4, (0.44, -0.36), (0.21, 0.15), palette.BLUSH)
    tint(0.25, (0, -0.40), (0.12, 0.09), palette.BLUSH)
    tint(0.12, (0, -1.05), (0.15, 0.1), palette.BLUSH)
    tint(0.25, (0.33, 0.17), (0.2, 0.06), palette.BLUSH)
    tint(0.8, (0.055, -0.495), (0.028, 0.018), palette.SKIN_DEEP)
    lips = skin.list_lip_rows()
    bare = colour[lips[0]]
    colour[lips[1]] = 0.45 * colour[lips[1]] + 0.55 * np.array(palette.LIP)
    colour[lips[2 : VISIBLE_RINGS - 1].ravel()] = palette.LIP
    for ring in range(VISIBLE_RINGS - 2, VISIBLE_RINGS + 1):
        share = 0.3 * (ring - VISIBLE_RINGS + 3)
        colour[lips[ring]] = (1 - share) * np.array(palette.LIP) + share * np.array(palette.LIP_DEEP)
    faded = (CORNER_FADE_SHARE * np.clip((np.abs(ACROSS) - 0.8) / 0.2, 0, 1) ** 2)[:, None]
    colour[lips[1:VISIBLE_RINGS]] += faded * (bare - colour[lips[1:VISIBLE_RINGS]])
    colour[lips[VISIBLE_RINGS + 1 :].ravel()] = palette.MOUTH
    for eye in range(2):
        lids = skin.list_lid_rows(eye)
        colour[lids[0]] = palette.EYE_CORNER
        colour[lids[1]] = 0.5 * np.array(palette.EYE_CORNER) + 0.5 * np.array(palette.SKIN)
        for ring, share in ((2, 0.12), (3, 0.30), (4, 0.12)):
            upper = lids[ring, eyes.LID_SIDE > 0]
            colour[upper] = (1 - share) * np.array(palette.SKIN) + share * np.array(palette.SKIN_DEEP)
    return decode_srgb(colour)


PIVOT = np.array([0.0, -0.75, -0.9])  # the head turns about this place, the top of the neck
TONGUE_LIGHT, UPPER_TEETH_LIGHT, LOWER_TEETH_LIGHT = 1.35, 0.92, 0.52
"""The tongue is wet, and drawn brighter than the rest of the mouth; the lower teeth lie in the shade of the upper."""
SEAM_LIGHT = (0.88, 0.72, 0.54, 0.42, 0.34)
"""The part of the light that arrives beside the seam of closed lips, at the rings that end there: a soft line."""
RIM_LIGHT = (0.93, 0.78, 0.45, 0.04, 0.02)
"""The same for the rings before the rim of a round hole, the rim, and those behind, which would widen it in grey."""
LIP_SHADOW, SHADOW_DEPTH = 0.24, 0.09
"""The part of the light that arrives right under the upper lip in the mouth, and how far down its shadow reaches."""
CORNER_SHADE = 0.6  # how far the corners of any mouth are shaded as a seam
_EYES = ((1.0, ""), (-1.0, "right "))
_UPPER_COLUMN, _LOWER_COLUMN = 20, 60  # columns of the lips in the middle of the upper and of the lower lip


class Figure:
    """The character.

    triangles : of all parts [shape=(F, 3)]
    head      : the rows of the vertices that move; those of the body, behind them, never do
    colours   : diffuse reflection of the vertices, linear [shape=(V, 3)]
    """

    def __init__(self) -> None:
        self.skin = skin = Skin()
        self._eye, self._light = eyes.make_eyeball(), eyes.make_catchlights()
        left_brow, left_ear = eyes.make_brow(), make_ear()
        ring, tongue_at_rest = make_earring(), inside.place_tongue(REST)
        lash, lash_front = np.zeros((3 * eyes.LASHES, 3)), make_grid(3, eyes.LASHES)
        lash_faces = np.concatenate([lash_front, lash_front[:, ::-1]])  # seen from both sides
        parts = [
            Part("skin", skin.rest, skin.triangles, paint_skin(skin), palette.SKIN_FINISH, skin.normals),
            make_part("tongue", tongue_at_rest, inside.TONGUE_TRIANGLES, palette.TONGUE, palette.TONGUE_FINISH),
            inside.make_lower_teeth(), inside.make_upper_teeth(),
            self._eye, self._eye.mirror("right eye"), self._light, replace(self._light, name="right catchlights"),
            make_part("lashes", lash, lash_faces, palette.LASH, palette.BROW_FINISH),
            make_part("right lashes", lash, lash_faces, palette.LASH, palette.BROW_FINISH),
            left_brow, left_brow.mirror("right brow"),
            make_hair(), left_ear, left_ear.mirror("right ear"), ring, ring.mirror("right earring"),
            make_neck(), make_clothing(), make_collar(),
        ]  # fmt: skip
        self.parts = tuple(parts)
        names = [each.name for each in parts]
        stops = np.cumsum([0, *(len(each.places) for each in parts)]).tolist()
        self.rows = {each.name: slice(a, b) for each, a, b in zip(parts, stops, stops[1:], strict=False)}
        self.head = slice(0, self.rows["clothing"].start)
        self.first_still_triangle = sum(len(each.triangles) for each in parts[: names.index("clothing")])
        self.triangles = np.concatenate(
            [each.triangles + first for each, first in zip(parts, stops, strict=False)]
        ).astype(np.int32)
        self._places = np.concatenate([each.places for each in parts])
        self._normals = np.concatenate([each.normals for each in parts])
        self.colours = np.concatenate([each.colours for each in parts])
        self._strands = np.concatenate(
            [np.zeros_like(each.places) if each.strands is None else each.strands for each in parts]
        )
        self._kinds = np.repeat([palette.FINISHES.index(each.finish) for each in parts], np.diff(stops)).astype(np.intp)
        lips = self.skin.list_lip_rows()
        self._kinds[lips[1 : VISIBLE_RINGS + 2].ravel()] = palette.FINISHES.index(palette.LIP_FINISH)
        self._wall = lips[VISIBLE_RINGS + 1 : RINGS].ravel()
        self._kinds[lips[VISIBLE_RINGS + 2 :].ravel()] = palette.FINISHES.index(palette.MOUTH_FINISH)
        self._lighting = Lighting(palette.FINISHES)
        places, normals = self.place(REST)
        inner = ("tongue", "teeth", "upper teeth", "catchlights", "right catchlights", "lashes", "right lashes")
        fully_lit: list[slice | NDArray[np.intp]] = [self._wall, *(self.rows[name] for name in inner)]
        hiding = np.ones(len(places), bool)
        for rows in (*fully_lit, self.rows["eye"], self.rows["right eye"]):
            hiding[rows] = False
        lit = measure_reach(places, normals, self.triangles, hiding)
        for rows in fully_lit:
            lit[rows] = 1
        lit[:, 0] = np.clip(1.08 * lit[:, 0], 0.12, 1) ** 1.15
        self._reaches = lit
        self._held = np.zeros((stops[-1], 1))
        self._held[self.rows["neck"], 0] = smooth_step((-1.0 - self._places[self.rows["neck"], 1]) / 0.6)

    def place(self, pose: CharacterPose) -> tuple[Real, Real]:
        """Return places and normals of all vertices in a pose, the head not turned [shape=(V, 3), both]."""
        places, normals = self._places.copy(), self._normals.copy()
        places[self.rows["skin"]], normals[self.rows["skin"]] = self.skin.pose(pose)
        places[self.rows["tongue"]] = inside.place_tongue(pose)
        normals[self.rows["tongue"]] = compute_normals(places[self.rows["tongue"]], inside.TONGUE_TRIANGLES)
        places[self.rows["teeth"]] = move_jaw(places[self.rows["teeth"]], inside.measure_drop(pose))
        for name in ("brow", "right brow"):
            places[self.rows[name]] += eyes.shift_brow(places[self.rows[name]], pose)
            places[self.rows[name], 1] += pose.brows
        look, half = rotate_head(*pose.gaze), rotate_head(0.35 * pose.gaze[0], 0.35 * pose.gaze[1])
        lid = places[self.skin.list_lid_rows(0)[1][: eyes.LASHES]]
        for side, name in _EYES:
            flip = np.array([side, 1.0, 1.0])
            eye = self.rows[name + "eye"]
            places[eye] = places[eye] @ look.T + EYE * flip
            normals[eye] = normals[eye] @ look.T
            places[self.rows[name + "catchlights"]] = self._light.places @ half.T + EYE * flip
            places[self.rows[name + "lashes"]] = eyes.place_lashes(lid, pose.shut) * flip
            normals[self.rows[name + "lashes"]] = [0.0, 0.0, 1.0]
        return places, normals

    def shade(self, pose: CharacterPose, viewer: Real) -> tuple[Real, NDArray[np.float32]]:
        """Return places of all vertices in a pose and their light, as parts of white [shape=(V, 3), both].

        viewer : the place from which they are seen [shape=(3,)]
        """
        places, normals = self.place(pose)
        colours, arrives = self._shade(pose, places)
        turn, moving, neck = rotate_head(*pose.turn).T, self.head, self.rows["neck"]
        held, still = self._held[neck], (places[neck].copy(), normals[neck].copy())
        strands = self._strands.copy()
        places[moving] = (places[moving] - PIVOT) @ turn + PIVOT
        normals[moving] = normals[moving] @ turn
        strands[moving] = strands[moving] @ turn
        for turning, unturned in zip((places, normals), still, strict=True):
            turning[neck] = held * unturned + (1 - held) * turning[neck]
        light = self._lighting.shade(places, normals, colours, self._kinds, viewer, reaches=arrives, strands=strands)
        return places, light

    def weigh_turn(self) -> Real:
        """Return how far each vertex turns with the head about ``PIVOT``: 0 the body, 1 the head [shape=(V,)]."""
        share = np.zeros(len(self._places))
        share[self.head] = 1 - self._held[self.head, 0]
        return share

    def _shade(self, pose: CharacterPose, places: Real) -> tuple[Real, Real]:
        """Return colours and arriving light: eyes are darker under their lids, the mouth is darker inside."""
        colours, arrives = self.colours.copy(), self._reaches.copy()
        x, y = self.skin.lids_of_eye.place_opening(pose)
        for side, name in _EYES:
            eye = self.rows[name + "eye"]
            upper = np.interp(side * places[eye, 0], x[: eyes.LASHES], y[: eyes.LASHES])
            under = np.clip((upper - places[eye, 1] + 0.01) / 0.085, 0, 1)
            colours[eye] *= (0.6 + 0.4 * under)[:, None]
        ring = places[self.rows["skin"]][self.skin.list_lip_rows()[VISIBLE_RINGS - 1]]
        top, low = ring[_UPPER_COLUMN, 1], ring[_LOWER_COLUMN, 1]
        front = 0.5 * (ring[_UPPER_COLUMN, 2] + ring[_LOWER_COLUMN, 2])
        span, half = max(top - low, 0.0), max(0.26 * pose.width, 0.1)
        shadow = LIP_SHADOW + 0.4 * pose.tuck  # teeth on the lip are seen
        shade, deepest = 1 - 0.92 * pose.roundness**1.1, 0.93 - 0.27 * min(span / 0.25, 1.0)
        for rows in (self.rows["tongue"], self.rows["teeth"], self.rows["upper teeth"], self._wall):
            x, y, z = places[rows].T
            depth = deepest * np.clip((front - z - 0.10) / (0.22 + 0.8 * span), 0, 1)
            under = np.clip((top - y) / SHADOW_DEPTH, 0, 1)
            aside = np.clip(1.05 - 1.25 * (x / half) ** 2, 0, 1)
            lit = shade * (1 - depth) ** 1.5 * (shadow + (1 - shadow) * under) * (0.12 + 0.88 * aside)
            arrives[rows] = lit[:, None]
        licked = TONGUE_LIGHT * (1 - 0.35 * pose.tongue_up) * arrives[self.rows["tongue"]]
        arrives[self.rows["tongue"]] = np.minimum(1.0, licked)
        lips, closed = self.skin.list_lip_rows(), find_closure(pose)
        for ring, part_of in enumerate(SEAM_LIGHT, VISIBLE_RINGS - len(SEAM_LIGHT)):
            shaded = np.maximum(closed, CORNER_SHADE * (1 - pose.roundness**2) * AT_CORNER)
            arrives[lips[ring]] *= 1 - (1 - part_of) * shaded
        for ring, part_of in enumerate(RIM_LIGHT, VISIBLE_RINGS - 3):
            arrives[lips[ring]] *= 1 - (1 - part_of) * pose.roundness
        arrives[self.rows["upper teeth"]] *= UPPER_TEETH_LIGHT
        arrives[self.rows["teeth"]] *= LOWER_TEETH_LIGHT
        return colours, arrives
