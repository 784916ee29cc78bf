"""Motion to weights of blendshapes: bounded least squares on the lip points, lips that close where they should."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.contact import LEAST_GAP, read_gap
from lipmotion.articulation.lip_points import FACING, LEFT_CORNER, RIGHT_CORNER, mouth_template
from lipmotion.articulation.mouth import SpokenMouth
from lipmotion.meshes.fitting.blendshape_motion import find_own_weights, with_mouth
from lipmotion.meshes.fitting.bounded_curves import CurveCosts, fit_bounded_curves
from lipmotion.meshes.fitting.facial_animation import mood_weights
from lipmotion.meshes.fitting.oculus_visemes import NEAREST_VOWEL, viseme_curves
from lipmotion.meshes.fitting.point_motion import PointMotion, move_points
from lipmotion.meshes.model.face_shapes import NOT_FROM_POINTS, FaceShapes
from lipmotion.types import WEIGHT, Channel, Motion, Timeline, Unit

Array = NDArray[np.float64]

PUCKER, FUNNEL = 0.5, 0.3
"""Least weights of ``mouthPucker`` and ``mouthFunnel`` in a phone of roundness 1."""
NARROWING = 0.11
"""Both together make the mouth narrower by this, in eye distances; there is less, or more, of them for it."""
SHARES = (0.6, 1.4)
"""The least and the largest share of them that there is then."""
SPREADING = tuple(
    f"{name}{side}" for name in ("mouthSmile", "mouthStretch", "mouthDimple") for side in ("Left", "Right")
)
"""Shapes that draw the corners apart: they vanish in round phones."""


def round_lips(weights: Array, shapes: FaceShapes, protrusion: Array) -> Array:
    """Return weights of blendshapes with lips at least as round as they are protruded [shape=(T, S)].

    weights : as solved from the points [shape=(T, S)];  protrusion : 0 to 1 [shape=(T,)]
    """
    result = weights.copy()
    template = mouth_template()
    right, left = template.row(RIGHT_CORNER), template.row(LEFT_CORNER)
    wanted = [(shapes.row(name), most) for name, most in (("mouthPucker", PUCKER), ("mouthFunnel", FUNNEL))]
    present = [(row, most) for row, most in wanted if row is not None]
    narrower = sum(most * float(shapes.moved[row, right, 0] - shapes.moved[row, left, 0]) for row, most in present)
    share = float(np.clip(NARROWING / narrower, *SHARES)) if narrower > 0 else 1.0
    for row, most in present:
        result[:, row] = np.maximum(result[:, row], share * most * protrusion)
    rows = [row for row in map(shapes.row, SPREADING) if row is not None]
    result[:, rows] *= (1 - protrusion)[:, None]
    return result


DEPTH_WEIGHT, JAW_WEIGHT, CORNER_WEIGHT, GAP_WEIGHT = 0.4, 0.5, 4.0, 2.0
"""Weights of distances in depth, of the jaw, of the corners across, and of the gap between the lips, beside 1 for
lips."""
PAIR_WEIGHT = 0.15
"""Weight of the difference between the left and the right of a pair."""
VISEME_WEIGHT = 0.2
"""Weight of the visemes that the phones say, beside what the points say."""
PRESS_DEPTH = 0.01
"""In p, b and m the lips are closed this much further than to touch, in eye distances: no light between them."""
LEAST_PARTING = 0.004
"""Shapes that part the lips by less than this, in eye distances, are not used to part or to close them."""
PRESS_WEIGHT, UPPER_ROLL_WEIGHT, LOWER_ROLL_WEIGHT, TONGUE_WEIGHT = 0.2, 0.1, 0.55, 0.3
"""Weights of ARKit's blendshapes for what lip points do not show: lips that are pressed together (``mouthPressLeft``,
``mouthPressRight``, ``mouthRollUpper``), a lower lip on the teeth, a tongue between the teeth."""


@dataclass(frozen=True)
class SolverOptions:
    """How weights are solved.

    costs    : of large and of sudden weights
    gestures : whether phones add what points do not show (pressed lips, a tucked lip, the tongue, round lips)
    """

    costs: CurveCosts = field(default_factory=CurveCosts)
    gestures: bool = True


def solve_shape_weights(
    motion: Motion, units: Timeline[Unit], shapes: FaceShapes, options: SolverOptions | None = None
) -> Motion:
    """Return the weights of blendshapes over time: one channel a blendshape, by the mesh's names, 0 to 1.

    motion : of lip and jaw points, or of ``opening`` and ``width``, whose rest pose is the mesh as it is; or of
             blendshapes: weights that it has for those of the mesh are kept as they are
    units  : phones in time
    The lips are together where the spoken mouth has them together, and nowhere else: with ``mouthClose``, where the
    mesh has it, the jaw may stay open behind closed lips. ``mouthClose`` is never more than ``jawOpen`` in solved
    weights.
    Raises InputError: as ``move_points``.
    """
    options = options or SolverOptions()
    points = move_points(motion, units)
    given, mood = find_own_weights(motion, shapes), mood_weights(points.mouth, shapes)
    if given is not None:
        weights = _closed_as_spoken(given.values.astype(np.float64), with_mouth(motion), points.mouth, shapes, mood)
    else:
        if shapes.style == "visemes":
            time_s = np.arange(len(points.mouth.gap)) / points.mouth.rate_hz
            said = np.zeros((len(time_s), len(shapes.names)))
            for viseme, curve in viseme_curves(units, time_s).items():
                vowel = NEAREST_VOWEL.get(viseme)
                row = shapes.row(f"viseme_{viseme}")
                if row is None and vowel is not None:
                    row = shapes.row(f"vowel_{vowel}")
                if row is not None:
                    said[:, row] += curve
            matrix = np.concatenate([_rows(shapes), VISEME_WEIGHT * np.eye(len(shapes.names))], axis=1)
            targets = np.concatenate([_targets(points), VISEME_WEIGHT * said], axis=1)
            weights = fit_bounded_curves(matrix, targets, options.costs)
        else:
            free = points
            if mood is not None:  # what the shapes of a mood do to the width of the mouth is theirs
                displacements = points.displacements.copy()
                displacements[..., 0] -= mood @ shapes.moved[..., 0]
                free = replace(points, displacements=displacements)
            weights = _with_mood(_free_weights(free, shapes, options), mood)
        weights = with_gap(weights, shapes, points.mouth.gap - PRESS_DEPTH * points.mouth.closing)
    return Motion(weights, motion.rate_hz, tuple(Channel(name, WEIGHT) for name in shapes.names))


def _with_mood(weights: Array, mood: Array | None) -> Array:
    """Return weights with those of a mood: what a shape has already is not added again [shape=(T, S)]."""
    return weights if mood is None else np.clip(weights + mood * (1 - weights), 0.0, 1.0)


def _closed_as_spoken(
    weights: Array, motion: Motion, mouth: SpokenMouth, shapes: FaceShapes, mood: Array | None
) -> Array:
    """Return given weights with the lips of the mesh in contact where the spoken mouth has it [shape=(T, S)].

    motion : with the channels of ``with_mouth``
    mood   : weights that a mood adds [shape=(T, S)], by which the lips are no further apart than it parts them
    Frames in which the lips of the mesh touch as they should, and that no closure is near, stay as they are.
    """
    own, said = weights @ shapes.gap, read_gap(motion)
    share = np.clip(mouth.gap / np.maximum(said, 1e-9), 0, 1)
    wanted = np.where(said > LEAST_GAP, share * own, own)
    touching, contact = own < LEAST_GAP / 2, mouth.contact
    wanted = np.where(contact, np.where(touching, own, 0.0), np.where(touching, LEAST_GAP, wanted))
    if mood is not None:
        wanted = np.where(contact, wanted, wanted + np.maximum(mouth.gap - np.maximum(said, LEAST_GAP), 0))
        weights = _with_mood(weights, mood)
        own = weights @ shapes.gap
    changed = np.abs(wanted - own) > 1e-9
    result = weights.copy()
    result[changed] = with_gap(weights[changed], shapes, wanted[changed])
    return result


def with_gap(weights: Array, shapes: FaceShapes, gap: Array, kept: Collection[str] = NOT_FROM_POINTS) -> Array:
    """Return the nearest weights under which the middle of the lips is apart by the gap [shape=(T, S)].

    weights : 0 to 1, ``mouthClose`` at most ``jawOpen`` [shape=(T, S)]
    gap     : eye distances; where it is 0 the lips meet [shape=(T,)]
    kept    : known names of shapes that stay as they are
    The projection onto the weights with that gap: as smooth as the weights and the gap are. Shapes that hardly part the
    lips remain. ``mouthClose`` takes its part by closing the lips in front of an open jaw. Where no weights between
    0 and 1 have the gap, those that come nearest.
    """
    jaw, close = shapes.row("jawOpen"), shapes.row("mouthClose")
    apart, weights = shapes.gap.copy(), weights.copy()
    if jaw is not None and close is not None:  # until the end: the jaw with the lips, and behind closed lips
        weights[:, jaw] -= weights[:, close]
        apart[close] += apart[jaw]
    still = (np.abs(apart) < LEAST_PARTING) | np.isin(shapes.known, list(kept))
    way = np.where(still, 0.0, apart)
    low, high = np.full(len(weights), -1 / LEAST_PARTING), np.full(len(weights), 1 / LEAST_PARTING)
    for _ in range(60):
        middle = (low + high) / 2
        wide = np.clip(weights - middle[:, None] * way, 0.0, 1.0) @ apart > gap
        low, high = np.where(wide, middle, low), np.where(wide, high, middle)
    weights = np.clip(weights - ((low + high) / 2)[:, None] * way, 0.0, 1.0)
    if jaw is not None and close is not None:
        weights[:, jaw] += weights[:, close]
    return np.clip(weights, 0.0, 1.0)


def _free_weights(points: PointMotion, shapes: FaceShapes, options: SolverOptions) -> Array:
    """Return the weights of shapes that the points decide on [shape=(T, S)]."""
    mouth = points.mouth
    fixed = np.zeros((len(mouth.gap), len(shapes.names)))
    if options.gestures:
        for name, curve in {
            **dict.fromkeys(("mouthPressLeft", "mouthPressRight"), PRESS_WEIGHT * mouth.closing),
            "mouthRollUpper": UPPER_ROLL_WEIGHT * mouth.closing,
            "mouthRollLower": LOWER_ROLL_WEIGHT * mouth.tuck,
            "tongueOut": TONGUE_WEIGHT * mouth.between_teeth,
        }.items():
            if name in shapes.known:
                fixed[:, shapes.known.index(name)] = curve
    free = np.array([name not in NOT_FROM_POINTS for name in shapes.known])
    matrix, targets = _rows(shapes), _targets(points)
    jaw, close = shapes.row("jawOpen"), shapes.row("mouthClose")
    if jaw is not None and close is not None:
        matrix[close] += matrix[jaw]  # as one: the jaw opens behind closed lips
    ties = PAIR_WEIGHT * shapes.pairs()[:, free]
    solved = fit_bounded_curves(matrix[free], targets - fixed @ _rows(shapes), options.costs, ties)
    weights = fixed.copy()
    weights[:, free] += solved
    if jaw is not None and close is not None:
        weights[:, jaw] += weights[:, close]
    if options.gestures:
        weights = round_lips(weights, shapes, mouth.protrusion)
    return np.clip(weights, 0.0, 1.0)


def _rows(shapes: FaceShapes) -> Array:
    """Return the displacements of the shapes as weighted rows of a least squares problem [shape=(S, D)]."""
    return _weighted(shapes.moved, shapes.gap)


def _targets(points: PointMotion) -> Array:
    """Return the displacements of the points, and the gap, as such rows [shape=(T, D)]."""
    return _weighted(points.displacements, points.mouth.gap)


def _weighted(displacements: Array, gap: Array) -> Array:
    template = mouth_template()
    weights = np.where(template.jaw[:, None], JAW_WEIGHT, 1.0) * np.array([1.0, 1.0, DEPTH_WEIGHT])
    weights[template.corner, 0] *= CORNER_WEIGHT
    inner = np.zeros(len(template.points), bool)
    inner[[template.row(point) for pair in FACING[:3] for point in pair]] = True
    weights[inner, 1] *= 0.5  # the gap says it
    flat = (displacements * weights).reshape(len(displacements), -1)
    return np.concatenate([flat, GAP_WEIGHT * gap[:, None]], axis=1)
