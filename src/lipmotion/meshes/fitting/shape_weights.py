"""Motion to weights of blendshapes: bounded least squares on the lip points, lips that close where they should."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.contact import MIN_GAP, read_gap
from lipmotion.articulation.lip_points import FACING, LEFT_CORNER, RIGHT_CORNER, build_mouth
from lipmotion.articulation.mouth import SpokenMouth
from lipmotion.articulation.phone_targets import crossfade_phones
from lipmotion.articulation.rest import share_short_pauses
from lipmotion.errors import InputError
from lipmotion.meshes.fitting.blendshape_motion import find_own_weights, move_points, with_mouth
from lipmotion.meshes.model.face_shapes import NOT_FROM_POINTS, FaceShapes
from lipmotion.meshes.model.shape_names import SIDES, VISEMES_15
from lipmotion.storage.sources import read_shipped_table
from lipmotion.types import WEIGHT, Channel, Motion, Timeline, Unit

Array = NDArray[np.float64]
_VISEMES = read_shipped_table("lipmotion.meshes.fitting", "visemes.csv")
VISEME_OF_PHONE = {phone: row["viseme"] for row in _VISEMES for phone in row["phones"].split()}
"""The groups of the Oculus LipSync reference, in the project's phones."""
VISEME_CHANNELS = tuple(f"viseme_{name}" for name in VISEMES_15)
NEAREST_VOWEL = {row["viseme"]: row["vowel"] for row in _VISEMES if row["vowel"]}
"""The vowel of VRM for each viseme that opens the mouth."""
VISEME_POSES = np.array([[float(row[name] or 0) for row in _VISEMES] for name in ("gap", "protrusion")])
"""The gap, in eye distances, and the protrusion of each viseme at weight 1, as in distinct speech; 0: closed."""
LARGEST_ADDED = 0.4  # a viseme gives up at most this share to ``aa`` where the lips are further apart
LAX = "E"  # the viseme of parted lips in a pause
MAX_CLOSED_WEIGHT = 0.85  # largest sum of the visemes of closed lips where the lips are parted
CLOSED_GAPS, PARTED_GAPS = (0.0, 0.04), (0.06, 0.16)
"""Gaps between which the least, and the largest, sum of the visemes of closed lips falls to 0, in eye distances."""
MIN_WEIGHT = 1e-6


def weigh_visemes(units: Timeline[Unit], mouth: SpokenMouth, *, held: bool = False) -> Motion:
    """Return the weights of the 15 visemes over time, channels ``viseme_sil``, ``viseme_PP``, ...; 0 to 1.

    units : phones in time;  mouth : that they move
    held  : every viseme is wholly there, whatever the mouth does, and is cross-faded with the next one
    At every time the weights add up to 1, or to less, where lips are parted less than in the viseme. The visemes of
    closed lips, ``viseme_sil`` and ``viseme_PP``, add up to 1 where the lips of the mouth touch, and to at most
    ``MAX_CLOSED_WEIGHT`` where they do not.
    """
    phones = viseme_curves(units, np.arange(len(mouth.gap)) / mouth.rate_hz)
    wanted = phones["sil"] + phones["PP"]
    low, high = (
        MAX_CLOSED_WEIGHT * np.clip((far - mouth.gap) / (far - near), 0, 1) for near, far in (CLOSED_GAPS, PARTED_GAPS)
    )
    closed = np.where(mouth.contact, 1.0, np.maximum(low, np.minimum(wanted, high)))
    silent = np.divide(phones["sil"], wanted, out=np.zeros_like(wanted), where=wanted > MIN_WEIGHT)
    spoken = np.divide(1 - closed, 1 - wanted, out=np.zeros_like(wanted), where=wanted < 1 - MIN_WEIGHT)
    curves = {name: spoken * curve for name, curve in phones.items()}
    curves |= {"sil": closed * silent, "PP": closed * (1 - silent)}
    curves[LAX] += np.where(wanted < 1 - MIN_WEIGHT, 0.0, 1 - closed)
    values = np.stack([np.clip(curves[name], 0, 1) for name in VISEMES_15], axis=1)
    if not held:
        values = blend_visemes(values, mouth.gap, mouth.protrusion)
    return Motion(values, mouth.rate_hz, tuple(Channel(name, WEIGHT) for name in VISEME_CHANNELS))


def blend_visemes(held: Array, gap: Array, protrusion: Array) -> Array:
    """Return weights of visemes that follow the lips, where held ones are 1 however far these part [shape=(T, 15)].

    held : weights that add up to 1 [shape=(T, 15)];  gap, protrusion : of the mouth [each shape=(T,)]
    Of open visemes, part becomes ``ou`` where the lips are rounder, and ``aa`` where they are further apart; what is
    left is as strong as their gap.
    """
    gaps, roundness = VISEME_POSES
    ou, aa, named = VISEMES_15.index("ou"), VISEMES_15.index("aa"), gaps > 0
    total = held[:, named].sum(axis=1)
    mix = held * named / np.maximum(total, MIN_WEIGHT)[:, None]
    rounder = np.clip((protrusion - mix @ roundness) / np.maximum(1 - mix @ roundness, MIN_WEIGHT), 0, 1)
    mix = (1 - rounder)[:, None] * mix + np.outer(rounder, np.eye(len(gaps))[ou])
    wider = np.clip((gap - mix @ gaps) / np.maximum(gaps[aa] - mix @ gaps, 0.04), 0, LARGEST_ADDED)
    wider = wider * (1 - protrusion)
    mix = (1 - wider)[:, None] * mix + np.outer(wider, np.eye(len(gaps))[aa])
    size = np.clip(gap / np.maximum(mix @ gaps, MIN_WEIGHT), 0, 1)
    return np.where(named, (total * size)[:, None] * mix, held)


def viseme_curves(units: Timeline[Unit], time_s: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Return how far each of 15 visemes is said, 0 to 1 [each shape=(T,)]; short pauses belong to the phones beside."""
    weights = crossfade_phones(share_short_pauses(units), time_s, lambda phone: VISEME_OF_PHONE.get(phone, "sil"))
    return {name: np.clip(weights.get(name, np.zeros(len(time_s))), 0.0, 1.0) for name in VISEMES_15}


Limits = tuple[Array | float, Array | float]
LARGEST_EIGENVALUE = 16.0  # the largest eigenvalue of the squared second difference
MAX_STEPS, TOLERANCE = 2000, 1e-5
"""Iteration stops after so many steps, or when no weight changes by more than the second number in one."""
_MOODS = read_shipped_table("lipmotion.meshes.fitting", "mood_shapes.csv")
MOOD_SHAPES = {row["shape"]: (row["curve"], float(row["weight"])) for row in _MOODS}
"""By blendshapes: the curve of the spoken mouth that they show, and their weight where it is 1."""
EXPRESSIONS = read_shipped_table("lipmotion.meshes.fitting", "expressions.csv")
"""The expressions of VRM that stand for a mood, with their weights, on characters without finer shapes."""
ROUNDING = {"mouthPucker": 0.5, "mouthFunnel": 0.3}  # least weights in a phone of roundness 1
NARROWING = 0.11
"""Both together make the mouth narrower by this, in eye distances: they are scaled for it, within ``SHARES``."""
SHARES = (0.6, 1.4)
SPREADING = tuple(f"{name}{side}" for name in ("mouthSmile", "mouthStretch", "mouthDimple") for side in SIDES)
"""Shapes that draw the corners apart: they vanish in round phones."""
DEPTH_WEIGHT, JAW_WEIGHT, CORNER_WEIGHT, GAP_WEIGHT = 0.4, 0.5, 4.0, 2.0
"""Weights of depth, of the jaw, of the corners across, and of the gap between the lips, where lips have 1."""
OPPOSED = (
    (tuple(ROUNDING), SPREADING),
    (("mouthRollUpper",), ("mouthUpperUpLeft", "mouthUpperUpRight")),
    (("mouthRollLower", "mouthShrugLower"), ("mouthLowerDownLeft", "mouthLowerDownRight")),
)
"""Pairs of groups that undo each other: a face has one group of a pair at a time."""
OPPOSITION = 1.5
"""Cost of the product of two such weights, where that of the square of either is 1: both at once are never best."""
NEARNESS = 0.1  # weight of the distance from the weights that are separated
PAIR_WEIGHT = 0.15  # weight of the difference between the left and the right of a pair
VISEME_WEIGHT = 0.2  # weight of the visemes that the phones say, beside what the points say
PRESS_DEPTH = 0.01
"""In p, b and m the lips are closed this much further than to touch, in eye distances: no light between them."""
MIN_PARTING = 0.004
"""Shapes that part the lips by less than this, in eye distances, are not used to part or to close them."""
PRESS_WEIGHT, UPPER_ROLL_WEIGHT, LOWER_ROLL_WEIGHT, TONGUE_WEIGHT = 0.4, 0.1, 0.55, 0.3
"""Weights of ARKit's blendshapes for what lip points do not show: lips that are pressed together (``mouthPressLeft``,
``mouthPressRight``, ``mouthRollUpper``), a lower lip on the teeth, a tongue between the teeth."""


@dataclass(frozen=True)
class CurveCosts:
    """Costs of curves: of squared weights (``ridge``), and of squared second differences (``smooth``)."""

    ridge: float = 1e-3
    smooth: float = 1e-1


USUAL_COSTS = CurveCosts()


def solve_shape_weights(motion: Motion, units: Timeline[Unit], shapes: FaceShapes) -> Motion:
    """Return the weights of blendshapes over time: one channel a blendshape, by the mesh's names, 0 to 1.

    motion : of lip and jaw points, or of ``opening`` and ``width``, whose rest pose is the mesh as it is; or of
             blendshapes: weights that it has for those of the mesh are kept as they are
    units  : phones in time
    The lips are together where the spoken mouth has them together, and nowhere else: with ``mouthClose``, where the
    mesh has it, the jaw may stay open behind closed lips. ``mouthClose`` is never more than ``jawOpen`` in solved
    weights.
    Raises InputError: as ``move_points``.
    """
    points = move_points(motion, units)
    mouth, channels = points.mouth, tuple(Channel(name, WEIGHT) for name in shapes.names)
    own_weights, mood = find_own_weights(motion, shapes), weigh_moods(mouth, shapes)
    if own_weights is not None:
        weights = _close_own_weights(own_weights.values.astype(np.float64), with_mouth(motion), mouth, shapes, mood)
        return Motion(weights, motion.rate_hz, channels)
    matrix = _weigh_rows(shapes.moved, shapes.gap)
    if shapes.style == "visemes":
        spoken = np.zeros((len(mouth.gap), len(shapes.names)))
        for viseme, curve in viseme_curves(units, np.arange(len(spoken)) / mouth.rate_hz).items():
            row = shapes.row(f"viseme_{viseme}")
            row = shapes.row(f"vowel_{NEAREST_VOWEL.get(viseme)}") if row is None else row
            if row is not None:
                spoken[:, row] += curve
        targets = np.concatenate([_weigh_rows(points.displacements, mouth.gap), VISEME_WEIGHT * spoken], axis=1)
        matrix = np.concatenate([matrix, VISEME_WEIGHT * np.eye(len(shapes.names))], axis=1)
        weights = fit_bounded_curves(matrix, targets)
    else:
        displacements = points.displacements.copy()
        if mood is not None:  # what the shapes of a mood do to the width of the mouth is theirs
            displacements[..., 0] -= mood @ shapes.moved[..., 0]
        weights = _solve_free_weights(_weigh_rows(displacements, mouth.gap), matrix, mouth, shapes)
        weights = _add_mood(weights, mood)
    weights = with_gap(weights, shapes, mouth.gap - PRESS_DEPTH * mouth.closing)
    return Motion(weights, motion.rate_hz, channels)


def fit_bounded_curves(
    matrix: Array,
    targets: Array,
    costs: CurveCosts = USUAL_COSTS,
    ties: Array | None = None,
    limits: Limits = (0.0, 1.0),
    initial: Array | None = None,
    opposed: NDArray[np.bool_] | None = None,
) -> Array:
    """Return weights w within limits that minimise the distance of ``w @ matrix`` from targets [shape=(T, S)].

    matrix  : what each of S shapes adds at weight 1 [shape=(S, D)]
    targets : one row a frame [shape=(T, D)]
    ties    : further rows that should be 0, as left weight − right weight [shape=(R, S)]
    limits  : the least and the largest weights [numbers, or shape=(T, S)]
    initial : weights to begin from [shape=(T, S)]; None: any
    opposed : which shapes exclude each other, symmetric [shape=(S, S)]; None: none
    Minimises Σ_t ‖w_t M − d_t‖² + ridge ‖w_t‖² + ‖ties w_t‖² + smooth ‖w_{t−1} − 2 w_t + w_{t+1}‖².
    Products of weights that exclude each other cost so much that one of both is 0 where smoothness lets it; then the
    minimum is one near ``initial``.
    Raises InputError: shapes of arrays that do not fit, or values that are not finite.
    Source: Beck & Teboulle 2009 (FISTA), with the restart of O'Donoghue & Candès 2015 and a diagonal preconditioner.
    Cost: O(T·S²) a step; some hundred steps.
    """
    if matrix.ndim != 2 or targets.ndim != 2 or matrix.shape[1] != targets.shape[1]:
        raise InputError(f"shapes {matrix.shape} and targets {targets.shape} do not fit, required (S, D) and (T, D)")
    if not (np.isfinite(matrix).all() and np.isfinite(targets).all()):
        raise InputError("shapes or targets have values that are not finite")
    square = matrix @ matrix.T + costs.ridge * np.eye(len(matrix))
    if ties is not None:
        square = square + ties.T @ ties
    norms = np.sqrt(np.diag(square))
    if opposed is not None:
        square = np.where(opposed, OPPOSITION * np.outer(norms, norms), square)
    scale = np.sqrt(norms**2 + 6 * costs.smooth)  # with the second differences: shapes that move little converge
    wanted = targets @ matrix.T / scale
    square = square / np.outer(scale, scale)
    smooth, low, high = costs.smooth / scale**2, limits[0] * scale, limits[1] * scale
    step = 1 / (np.linalg.norm(square, 2) + LARGEST_EIGENVALUE * smooth.max(initial=0.0))
    decay, pull, stiffness = np.eye(len(square)) - step * square, step * wanted, step * smooth
    current = ahead = np.clip(wanted if initial is None else scale * initial, low, high)
    momentum, seconds = 1.0, np.zeros((len(targets) + 2, len(matrix)))  # its first and last two rows stay 0
    for _ in range(MAX_STEPS):
        following = ahead @ decay  # a step along the gradient, in place: most time goes into the calls of NumPy
        following += pull
        if len(ahead) > 2:
            inner = seconds[2:-2]
            np.subtract(ahead[:-2], ahead[1:-1], out=inner)
            inner -= ahead[1:-1]
            inner += ahead[2:]
        fourths = seconds[2:] - seconds[1:-1]
        fourths -= seconds[1:-1]
        fourths += seconds[:-2]
        fourths *= stiffness
        following -= fourths
        np.clip(following, low, high, out=following)
        change = following - current
        if np.vdot(ahead - following, change) > 0:
            momentum, ahead = 1.0, following
        else:
            faster = (1 + np.sqrt(1 + 4 * momentum * momentum)) / 2
            ahead = following + (momentum - 1) / faster * change
            momentum = faster
        current = following
        if np.abs(change / scale).max(initial=0.0) < TOLERANCE * step:
            break
    return np.clip(current / scale, *limits)


def _weigh_rows(displacements: Array, gap: Array) -> Array:
    """Return displacements of the points [shape=(N, 52, 3)] and gaps as rows of the least squares problem."""
    template = build_mouth()
    weights = np.where(template.jaw[:, None], JAW_WEIGHT, 1.0) * np.array([1.0, 1.0, DEPTH_WEIGHT])
    weights[template.corner, 0] *= CORNER_WEIGHT
    inner = [template.row(point) for pair in FACING[:3] for point in pair]
    weights[inner, 1] *= 0.5  # the gap says it
    return np.concatenate([(displacements * weights).reshape(len(gap), -1), GAP_WEIGHT * gap[:, None]], axis=1)


def _solve_free_weights(targets: Array, matrix: Array, mouth: SpokenMouth, shapes: FaceShapes) -> Array:
    """Return the weights of ARKit's or a mesh's own shapes [shape=(T, S)]; some follow the phones, not the points."""
    fixed = np.zeros((len(mouth.gap), len(shapes.names)))
    for name, curve in {
        **dict.fromkeys(("mouthPressLeft", "mouthPressRight"), PRESS_WEIGHT * mouth.closing),
        "mouthRollUpper": UPPER_ROLL_WEIGHT * mouth.closing,
        "mouthRollLower": LOWER_ROLL_WEIGHT * mouth.tuck,
        "tongueOut": TONGUE_WEIGHT * mouth.between_teeth,
    }.items():
        if name in shapes.known:
            fixed[:, shapes.known.index(name)] = curve
    free = np.array([name not in NOT_FROM_POINTS for name in shapes.known])
    jaw, close = shapes.row("jawOpen"), shapes.row("mouthClose")
    if jaw is not None and close is not None:
        matrix[close] += matrix[jaw]  # as one: the jaw opens behind closed lips
    ties, weights = PAIR_WEIGHT * shapes.pairs(), fixed.copy()
    weights[:, free] += fit_bounded_curves(matrix[free], targets - fixed @ matrix, USUAL_COSTS, ties[:, free])
    weights = round_lips(np.clip(weights, 0.0, 1.0), shapes, mouth.protrusion)
    weights = separate_opposed(weights, matrix, shapes.known, USUAL_COSTS, (fixed, np.where(free, 1.0, fixed)), ties)
    if jaw is not None and close is not None:
        weights[:, jaw] += weights[:, close]
    return np.clip(weights, 0.0, 1.0)


def separate_opposed(
    weights: Array, matrix: Array, known: Sequence[str], costs: CurveCosts, limits: Limits, ties: Array | None = None
) -> Array:
    """Return weights that look as others do, without shapes at once that undo each other [shape=(T, S)].

    weights : 0 to 1 [shape=(T, S)]; known : names of the shapes as ARKit's; others : as of ``fit_bounded_curves``
    """
    pairs = (np.outer(one, other) for one, other in _find_opposed(tuple(known)))
    opposed = np.any([pair | pair.T for pair in pairs], axis=0)
    costs = replace(costs, ridge=costs.ridge / 10)  # they are as small as they should be
    matrix = np.concatenate([matrix, NEARNESS * np.eye(len(matrix))], axis=1)
    return fit_bounded_curves(matrix, weights @ matrix, costs, ties, limits, weights, opposed)


@lru_cache
def _find_opposed(known: tuple[str, ...]) -> list[list[NDArray[np.bool_]]]:
    return [[np.isin(known, names) for names in pair] for pair in OPPOSED]


def cancel_opposed(weights: Array, known: Sequence[str]) -> Array:
    """Return the weights of one frame [shape=(S,)]; of shapes that undo each other, the larger less the smaller."""
    left = weights.copy()
    for one, other in _find_opposed(tuple(known)):
        strong, weak = (weights[each].max(initial=0.0) for each in (one, other))
        left[one] *= max(strong - weak, 0.0) / max(strong, 1e-9)
        left[other] *= max(weak - strong, 0.0) / max(weak, 1e-9)
    return left


def round_lips(weights: Array, shapes: FaceShapes, protrusion: Array) -> Array:
    """Return weights with lips at least as round as they are protruded, 0 to 1 [shapes=(T, S), (T,)]."""
    result, template = weights.copy(), build_mouth()
    right, left = template.row(RIGHT_CORNER), template.row(LEFT_CORNER)
    present = {row: full for name, full in ROUNDING.items() if (row := shapes.row(name)) is not None}
    across = shapes.moved[:, right, 0] - shapes.moved[:, left, 0]
    narrower = sum(full * float(across[row]) for row, full in present.items())
    share = float(np.clip(NARROWING / narrower, *SHARES)) if narrower > 0 else 1.0
    for row, full in present.items():
        result[:, row] = np.maximum(result[:, row], share * full * protrusion)
    result[:, np.isin(shapes.known, SPREADING)] *= (1 - protrusion)[:, None]
    return result


def weigh_moods(mouth: SpokenMouth, shapes: FaceShapes) -> Array | None:
    """Return the weights of ARKit's blendshapes of the mouth in a mood, 0 to 1 [shape=(T, S)]; None: in none."""
    weights = np.zeros((len(mouth.gap), len(shapes.names)))
    for name, (curve, full) in MOOD_SHAPES.items():
        if (row := shapes.row(name)) is not None:
            weights[:, row] = full * getattr(mouth, curve)
    return weights if weights.any() else None


def _add_mood(weights: Array, mood: Array | None) -> Array:
    """Return weights with those of a mood: what a shape has already is not added again [shape=(T, S)]."""
    return weights if mood is None else np.clip(weights + mood * (1 - weights), 0.0, 1.0)


def weigh_expressions(moods: Mapping[str, Array]) -> dict[str, Array]:
    """Return the weights of VRM's expressions for moods, 0 to 1, both by name [each shape=(T,)]."""
    weights: dict[str, Array] = {}
    for row in (row for row in EXPRESSIONS if row["mood"] in moods):
        strength, name = float(row["weight"]) * moods[row["mood"]], row["expression"]
        weights[name] = np.clip(weights.get(name, 0.0) + strength, 0, 1)
    return weights


def _close_own_weights(
    weights: Array, motion: Motion, mouth: SpokenMouth, shapes: FaceShapes, mood: Array | None
) -> Array:
    """Return weights that a motion has with the lips of the mesh in contact where the mouth's are [shape=(T, S)]."""
    gap, motion_gap = weights @ shapes.gap, read_gap(motion)
    share = np.clip(mouth.gap / np.maximum(motion_gap, 1e-9), 0, 1)
    wanted = np.where(motion_gap > MIN_GAP, share * gap, gap)
    touching, contact = gap < MIN_GAP / 2, mouth.contact
    wanted = np.where(contact, np.where(touching, gap, 0.0), np.where(touching, MIN_GAP, wanted))
    if mood is not None:
        wanted = np.where(contact, wanted, wanted + np.maximum(mouth.gap - np.maximum(motion_gap, MIN_GAP), 0))
        weights = _add_mood(weights, mood)
        gap = weights @ shapes.gap
    changed = np.abs(wanted - gap) > 1e-9
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
    way = np.where((np.abs(apart) < MIN_PARTING) | np.isin(shapes.known, list(kept)), 0.0, apart)
    low, high = np.full(len(weights), -1 / MIN_PARTING), np.full(len(weights), 1 / MIN_PARTING)
    for _ in range(60):
        middle = (low + high) / 2
        wide = np.clip(weights - middle[:, None] * way, 0.0, 1.0) @ apart > gap
        low, high = np.where(wide, middle, low), np.where(wide, high, middle)
    weights = np.clip(weights - ((low + high) / 2)[:, None] * way, 0.0, 1.0)
    if jaw is not None and close is not None:
        weights[:, jaw] += weights[:, close]
    return np.clip(weights, 0.0, 1.0)
