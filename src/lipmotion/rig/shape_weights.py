"""Motion to weights of blendshapes: bounded least squares on the lip points, lips that close where they should."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lipmotion.rig.bounded_curves import CurveCosts, bounded_curves
from lipmotion.rig.face_shapes import NOT_FROM_POINTS, FaceShapes
from lipmotion.rig.gestures import gesture_curves, phone_weights
from lipmotion.rig.mouth_template import FACING, mouth_template
from lipmotion.rig.point_motion import PointMotion, point_motion
from lipmotion.rig.rounding import rounded_weights, roundness
from lipmotion.rig.visemes import NEAREST_VOWEL, viseme_curves
from lipmotion.types import WEIGHT, Channel, Motion, Timeline, Unit
from lipmotion.units import LIP_CLOSING

Array = NDArray[np.float64]

DEPTH, JAW, CORNERS, LIPS_APART = 0.4, 0.5, 4.0, 2.0
"""Weights of distances in depth, of the jaw, of the corners across, and of the gap between the lips, beside 1 for
lips."""
TIE = 0.15
"""Weight of the difference between the left and the right of a pair."""
PHONES_SAY = 0.2
"""Weight of the visemes that the phones say, beside what the points say."""
PRESSED = 0.01
"""In p, b and m the lips are closed this much further than to touch, in eye distances: no light between them."""
LEAST_PARTING = 0.004
"""Shapes that part the lips by less than this, in eye distances, are not used to part or to close them."""
BISECTIONS = 60


@dataclass(frozen=True)
class SolverOptions:
    """How weights are solved.

    costs    : of large and of sudden weights
    gestures : whether phones add what points do not show (pressed lips, a tucked lip, the tongue, round lips)
    intensity : 1: movements as they are; more: larger
    """

    costs: CurveCosts = field(default_factory=CurveCosts)
    gestures: bool = True
    intensity: float = 1.0


def shape_weights(
    motion: Motion, units: Timeline[Unit], shapes: FaceShapes, options: SolverOptions | None = None
) -> Motion:
    """Return the weights of blendshapes over time: one channel a blendshape, by the mesh's names, 0 to 1.

    motion : of lip and jaw points, or of ``opening`` and ``width``; its rest pose is the mesh as it is
    units  : phones in time
    The lips are together where the motion has them together, as in p, b and m, and in silence: with ``mouthClose``,
    where
    the mesh has it, the jaw may stay open behind closed lips. ``mouthClose`` is never more than ``jawOpen``.
    Raises InputError: as ``point_motion``.
    """
    options = options or SolverOptions()
    points = point_motion(motion, units).scaled(options.intensity)
    if shapes.style == "visemes":
        weights = _spoken_weights(points, motion, units, shapes, options)
    else:
        weights = _free_weights(points, motion, units, shapes, options)
    weights = with_gap(weights, shapes, points.gap - PRESSED * _closing(units, motion.time_s))
    return Motion(weights, motion.rate_hz, tuple(Channel(name, WEIGHT) for name in shapes.names))


def with_gap(weights: Array, shapes: FaceShapes, gap: Array) -> Array:
    """Return the nearest weights under which the middle of the lips is apart by the gap [shape=(T, S)].

    weights : 0 to 1, ``mouthClose`` at most ``jawOpen`` [shape=(T, S)]
    gap     : eye distances; where it is 0 the lips meet [shape=(T,)]
    The projection onto the weights with that gap: as smooth as the weights and the gap are. Shapes that hardly part the
    lips remain. ``mouthClose`` takes its part by closing the lips in front of an open jaw. Where no weights between
    0 and 1
    have the gap, those that come nearest.
    """
    jaw, close = shapes.row("jawOpen"), shapes.row("mouthClose")
    apart, weights = shapes.gap.copy(), weights.copy()
    if jaw is not None and close is not None:  # until the end: the jaw with the lips, and behind closed lips
        weights[:, jaw] -= weights[:, close]
        apart[close] += apart[jaw]
    still = (np.abs(apart) < LEAST_PARTING) | np.isin(shapes.known, list(NOT_FROM_POINTS))
    way = np.where(still, 0.0, apart)
    low, high = np.full(len(weights), -1 / LEAST_PARTING), np.full(len(weights), 1 / LEAST_PARTING)
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        wide = np.clip(weights - middle[:, None] * way, 0.0, 1.0) @ apart > gap
        low, high = np.where(wide, middle, low), np.where(wide, high, middle)
    weights = np.clip(weights - ((low + high) / 2)[:, None] * way, 0.0, 1.0)
    if jaw is not None and close is not None:
        weights[:, jaw] += weights[:, close]
    return np.clip(weights, 0.0, 1.0)


def _closing(units: Timeline[Unit], time_s: Array) -> Array:
    """Return how far phones that close the lips are being said, 0 to 1 [shape=(T,)]."""
    said = phone_weights(units, time_s, lambda phone: "closing" if phone in LIP_CLOSING else "")
    return said.get("closing", np.zeros(len(time_s)))


def _free_weights(
    points: PointMotion, motion: Motion, units: Timeline[Unit], shapes: FaceShapes, options: SolverOptions
) -> Array:
    """Return the weights of shapes that the points decide on [shape=(T, S)]."""
    fixed = np.zeros((len(points.gap), len(shapes.names)))
    if options.gestures:
        for name, curve in gesture_curves(units, motion.time_s, shapes.known).items():
            fixed[:, shapes.known.index(name)] = curve
    free = np.array([name not in NOT_FROM_POINTS for name in shapes.known])
    matrix, targets = _rows(shapes), _targets(points)
    jaw, close = shapes.row("jawOpen"), shapes.row("mouthClose")
    if jaw is not None and close is not None:
        matrix[close] += matrix[jaw]  # as one: the jaw opens behind closed lips
    ties = TIE * shapes.pairs()[:, free]
    solved = bounded_curves(matrix[free], targets - fixed @ _rows(shapes), options.costs, ties)
    weights = fixed.copy()
    weights[:, free] += solved
    if jaw is not None and close is not None:
        weights[:, jaw] += weights[:, close]
    if options.gestures:
        weights = rounded_weights(weights, shapes, roundness(units, motion.time_s))
    return np.clip(weights, 0.0, 1.0)


def _spoken_weights(
    points: PointMotion, motion: Motion, units: Timeline[Unit], shapes: FaceShapes, options: SolverOptions
) -> Array:
    """Return the weights of visemes: the phones say which, the points how much [shape=(T, S)]."""
    said = _said(units, motion.time_s, shapes)
    matrix = np.concatenate([_rows(shapes), PHONES_SAY * np.eye(len(shapes.names))], axis=1)
    targets = np.concatenate([_targets(points), PHONES_SAY * said], axis=1)
    return bounded_curves(matrix, targets, options.costs)


def _said(units: Timeline[Unit], time_s: Array, shapes: FaceShapes) -> Array:
    """Return the visemes or vowels that the phones say [shape=(T, S)]."""
    said = np.zeros((len(time_s), len(shapes.names)))
    for viseme, curve in viseme_curves(units, time_s).items():
        vowel = NEAREST_VOWEL.get(viseme)
        row = shapes.row(f"viseme_{viseme}")
        if row is None and vowel is not None:
            row = shapes.row(f"vowel_{vowel}")
        if row is not None:
            said[:, row] += curve
    return said


def _rows(shapes: FaceShapes) -> Array:
    """Return the displacements of the shapes as weighted rows of a least squares problem [shape=(S, D)]."""
    return _weighted(shapes.moved, shapes.gap)


def _targets(points: PointMotion) -> Array:
    """Return the displacements of the points, and the gap, as such rows [shape=(T, D)]."""
    return _weighted(points.displacements, points.gap)


def _weighted(displacements: Array, gap: Array) -> Array:
    template = mouth_template()
    weights = np.where(template.jaw[:, None], JAW, 1.0) * np.array([1.0, 1.0, DEPTH])
    weights[template.corner, 0] *= CORNERS
    inner = np.zeros(len(template.points), bool)
    inner[[template.row(point) for pair in FACING[:3] for point in pair]] = True
    weights[inner, 1] *= 0.5  # the gap says it
    flat = (displacements * weights).reshape(len(displacements), -1)
    return np.concatenate([flat, LIPS_APART * gap[:, None]], axis=1)
