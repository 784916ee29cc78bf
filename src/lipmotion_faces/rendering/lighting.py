"""Light on surfaces: a warm key light, a cool fill light, two rim lights, and the sky; and how much of it arrives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion_faces.characters.textures import encode_srgb
from lipmotion_faces.kernels.shading import shade

Real = NDArray[np.float64]
Triple = tuple[float, float, float]

LEVELS = 4096  # steps of the table from light to grey levels
WHITE = 1.5  # the light that becomes white; the rasteriser takes light as parts of it


KEY, FILL = ((-0.5, 0.55, 0.8), (1.06, 0.97, 0.87)), ((0.85, 0.15, 0.6), (0.16, 0.19, 0.25))
RIMS = ((-0.8, 0.45, -0.55), (0.55, 0.5, 0.45)), ((0.85, 0.4, -0.5), (0.62, 0.7, 0.85))
"""Far lights: the direction towards each, and its light, red, green and blue."""
SKY: Triple = (0.40, 0.42, 0.46)
GROUND: Triple = (0.27, 0.21, 0.19)


@dataclass(frozen=True)
class Finish:
    """How a surface reflects light.

    wrap    : how far light reaches round into the shade, for red, green and blue; skin scatters red light furthest
    gloss   : strength of the highlights
    focus   : how small they are: 4 is dull, 6 wet; the exponent of Blinn and Phong is 2 to the power of this
    edge    : additional reflection at grazing angles
    strands : highlights run across strands, as on hair
    """

    wrap: Triple = (0.1, 0.1, 0.1)
    gloss: float = 0.0
    focus: int = 4
    edge: float = 0.0
    strands: bool = False


class Lighting:
    """The lamps, and some finishes under them, by whose numbers a vertex has its finish."""

    def __init__(self, finishes: Sequence[Finish]) -> None:
        rows = [[*f.wrap, f.gloss, f.focus, f.edge, f.strands] for f in finishes]
        self._finishes = np.array(rows, dtype=float)
        lamps = np.zeros((6, 6))
        for row, (towards, light) in zip(lamps, (KEY, FILL, *RIMS), strict=False):
            row[:3] = normalise(np.array(towards))
            row[3:] = np.array(light) / WHITE
        lamps[4:, :3] = np.array([SKY, GROUND]) / WHITE
        self._lamps = lamps

    def shade(
        self,
        places: Real,
        normals: Real,
        colours: Real,
        kinds: NDArray[np.intp],
        viewer: Real,
        *,
        reaches: Real | None = None,
        strands: Real | None = None,
    ) -> NDArray[np.float32]:
        """Return the light that vertices send to the viewer, as parts of ``WHITE`` [shape=(V, 3)].

        places, normals : of the vertices, normals of length 1 [shape=(V, 3)]
        colours : diffuse reflection, linear [shape=(V, 3)]
        kinds   : the number of the finish of every vertex [shape=(V,)]
        viewer  : the place of the camera [shape=(3,)]
        reaches : the parts of the sky and of the key light that are not hidden [shape=(V, 2)]; None: all
        strands : directions of hair [shape=(V, 3)]; None: no hair
        """
        open_sky = np.ones((len(places), 2)) if reaches is None else reaches
        along = np.zeros_like(places) if strands is None else strands
        return shade(normals, places, viewer, colours, open_sky, along, kinds, self._finishes, self._lamps)


def make_tone_table() -> NDArray[np.uint8]:
    """Return the grey level, 0 to 255, of light in even steps from 0 to ``WHITE`` [shape=(LEVELS,)]."""
    light = np.linspace(0, WHITE, LEVELS)
    knee = 0.7
    room = 1 - knee
    light = np.minimum(light, knee) + room * (1 - np.exp(-np.maximum(light - knee, 0) / room))
    return np.rint(255 * encode_srgb(light / light[-1])).astype(np.uint8)


def normalise(vectors: Real) -> Real:
    """Return vectors along the last axis at length 1; the shape stays."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


CELL = 0.045  # size of the cells in which the nearest surface is kept, in the unit of the vertices
BIAS_DISTANCE, FADE_DISTANCE = 0.05, 0.10
"""A vertex this far behind another one begins to be hidden, and is hidden this much further behind."""


DIRECTIONS, LAMPS, SMOOTHINGS = 72, 20, 4
"""Directions of the sky from which light comes, places on the key light, which is large and soft, and means taken."""


def measure_reach(places: Real, normals: Real, triangles: NDArray[np.int32], hiding: NDArray[np.bool_]) -> Real:
    """Return the parts of the sky and of the key light that reach the vertices, 0 to 1 [shape=(V, 2)].

    places, normals : of the vertices, which must be dense: no further apart than ``CELL`` [shape=(V, 3)]
    triangles  : along which the result is smoothed [shape=(F, 3)]
    hiding     : which of them hide others [shape=(V,)]
    Cost: O(V · ``DIRECTIONS``).
    """
    y = 1 - (2 * np.arange(DIRECTIONS) + 1) / DIRECTIONS  # directions that are spread evenly over the sphere
    angle, flat = 2.39996 * np.arange(DIRECTIONS), np.sqrt(1 - y * y)
    towards = np.stack([flat * np.cos(angle), y, flat * np.sin(angle)], axis=1)
    total, seen = np.zeros(len(places)), np.zeros(len(places))
    for way in towards:
        weight = np.maximum(normals @ way + 0.1, 0) * (1.2 + way[1])
        total += weight
        seen += weight * _find_visible(places, hiding, way)
    sky = seen / np.maximum(total, 1e-9)
    key = normalise(np.array(KEY[0]))
    around = np.cross(key, [0.0, 1.0, 0.0])
    above = np.cross(around, key)
    direct = np.zeros(len(places))
    for n in range(LAMPS):
        radius, turn = 0.22 * np.sqrt((n + 0.5) / LAMPS), 2.39996 * n
        direct += _find_visible(
            places, hiding, normalise(key + radius * (np.cos(turn) * around + np.sin(turn) * above))
        )
    values = np.stack([sky, direct / LAMPS], axis=1)
    count = np.maximum(np.bincount(triangles.ravel(), minlength=len(values)), 1)[:, None]
    for _ in range(SMOOTHINGS):
        mean = values[triangles].mean(axis=1)
        totals = [
            sum(np.bincount(triangles[:, corner], mean[:, k], minlength=len(values)) for corner in range(3))
            for k in range(values.shape[1])
        ]
        values = np.stack(totals, axis=1) / count
    return values


def _find_visible(places: Real, hiding: NDArray[np.bool_], way: Real) -> Real:
    """Return how far every vertex can be seen from a direction, 0 to 1 [shape=(V,)]."""
    side = normalise(np.cross(way, [0.31, 0.9, 0.27]))
    flat = np.stack([places @ side, places @ np.cross(side, way)], axis=1) / CELL
    flat -= flat.min(axis=0) - 1
    height = places @ way
    size = int(flat.max()) + 3
    nearest = np.full((size, size), -1e9)
    cells = np.rint(flat[hiding]).astype(int)
    np.maximum.at(nearest, (cells[:, 0], cells[:, 1]), height[hiding])
    low = np.floor(flat).astype(int)
    share = flat - low
    seen = np.zeros(len(places))
    for i in range(2):
        for j in range(2):
            weight = np.abs(1 - i - share[:, 0]) * np.abs(1 - j - share[:, 1])
            above = nearest[low[:, 0] + i, low[:, 1] + j] - height
            seen += weight * np.clip(1 - (above - BIAS_DISTANCE) / FADE_DISTANCE, 0, 1)
    return seen
