"""Statistics of motion, unit by unit: a sum of what every generality of context adds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.trajectory.closure import OPENING, fit_closure
from lipmotion.engines.trajectory.contexts import LEVELS, SPREAD_LEVELS, level_names, places, rest_place
from lipmotion.engines.trajectory.model import Level, TrajectoryModel
from lipmotion.engines.trajectory.space import fit_space
from lipmotion.errors import CorpusError
from lipmotion.stats.checkpoint import NOTHING_KEPT, Checkpoint
from lipmotion.stats.windows import with_dynamics
from lipmotion.types import Channel, Example, Monitor, Progress

PASSES = 4
"""Rounds of backfitting; more change nothing on the validation list."""
LEAST_VARIANCE_SHARE, LEAST_VARIANCE = 1e-3, 1e-12
"""No variance falls under this share of the overall one, nor under this: some dimensions never move."""


def fit_trajectory(
    examples: Sequence[Example],
    *,
    parts: int,
    edge_s: float,
    components: int,
    shrinkage: float,
    variance_shrinkage: float,
    monitor: Monitor,
    checkpoint: Checkpoint = NOTHING_KEPT,
) -> TrajectoryModel:
    """Return what every context adds to the mean, and variances around the sum.

    The means are a ridge regression of static, Δ and Δ² on the indicators of all contexts of a frame, solved
    by backfitting: a context with few frames, or one that the more general ones explain, adds little.
    components : dimensions that all point channels (``x_17``, ...) are reduced to
    shrinkage  : frames of evidence that a context must outweigh (the ridge)
    variance_shrinkage : frames that the more general variance counts for
    Raises CorpusError: no example with motion that was seen in speech, or examples of different channels.
    """
    channels = _common_channels(examples)
    seen = np.concatenate([example.motion.values[example.valid] for example in examples])
    space = fit_space(channels, seen, components)
    names: list[tuple[str, ...]] = []
    values: list[NDArray[np.float64]] = []
    rows: list[NDArray[np.float32]] = []
    for example in examples:
        inner = _inner(example.valid)
        values.append(space.reduce(example.motion.values.astype(float)))
        dynamics = with_dynamics(values[-1])
        where = places(example.speech.units, len(inner), parts, edge_s)
        rows.append(dynamics[inner].astype(np.float32))
        names += [level_names(place) for place, kept in zip(where, inner, strict=True) if kept]
    covered = {name[0] for name in names}
    if len(covered) < parts:
        raise CorpusError(f"motion was seen in {len(covered)} of {parts} parts of a phone; learn from more speech")
    motion = np.concatenate(rows)
    _still(motion, [name == level_names(rest_place(parts)) for name in names])
    overall = motion.var(axis=0)
    levels, rest = _backfit(names, motion, shrinkage, monitor, checkpoint)
    spread, variances = _fit_variances(names, rest, overall, variance_shrinkage)
    closure = None
    if OPENING in space.direct_names:
        masks, timelines = [e.valid for e in examples], [e.speech.units for e in examples]
        closure = fit_closure(values, masks, timelines, space.direct_names.index(OPENING))
    return TrajectoryModel(space, tuple(levels), spread, variances, closure)


def _common_channels(examples: Sequence[Example]) -> tuple[Channel, ...]:
    if not any(_inner(example.valid).any() for example in examples):
        raise CorpusError(f"none of {len(examples)} examples has motion to learn from; prepare a corpus with faces")
    found = {example.motion.channels for example in examples}
    if len(found) > 1:
        raise CorpusError("the utterances have different motion channels; train on one kind of corpus at a time")
    return found.pop()


def _inner(valid: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the frames that were seen with both neighbours: those whose dynamics are known."""
    inner = np.zeros_like(valid)
    inner[1:-1] = valid[:-2] & valid[1:-1] & valid[2:]
    return inner


_Groups = tuple[list[str], NDArray[np.intp], NDArray[np.intp]]


def _groups(names: Sequence[str]) -> _Groups:
    """Return the distinct names, the frames sorted by name, and where each name's begin."""
    index: dict[str, int] = {}
    numbers = np.array([index.setdefault(name, len(index)) for name in names])
    starts = np.concatenate([[0], np.cumsum(np.bincount(numbers))[:-1]])
    return list(index), np.argsort(numbers, kind="stable"), starts.astype(np.intp)


def _still(dynamics: NDArray[np.float32], rests: Sequence[bool]) -> None:
    """Replace what the mouth did in silence away from speech (breath, a lick of the lips) by its median pose."""
    resting = np.array(rests)
    if resting.any():
        dynamics[resting, 0] = np.median(dynamics[resting, 0], axis=0)
        dynamics[resting, 1:] = 0


def _backfit(
    names: Sequence[tuple[str, ...]],
    motion: NDArray[np.float32],
    shrinkage: float,
    monitor: Monitor,
    checkpoint: Checkpoint,
) -> tuple[list[Level], NDArray[np.float32]]:
    """Return all levels, and what they leave unexplained of the motion [shape=(T, 3, Q)]; kept after every pass."""
    groups = [_groups([name[number] for name in names]) for number in range(LEVELS)]
    counts = [np.diff(np.append(starts, len(order))) for _, order, starts in groups]
    means = [np.zeros((len(distinct), *motion.shape[1:]), np.float32) for distinct, _, _ in groups]
    rest, done = motion, 0
    kept = checkpoint.load(_CHECKPOINT)
    if kept is not None:
        means, rest, done = [kept[f"means{number}"] for number in range(LEVELS)], kept["rest"], int(kept["done"])
    monitor(Progress(_STAGE, done, PASSES, done / PASSES))
    for number in range(done, PASSES):
        _backfit_once(groups, counts, means, rest, shrinkage)
        state = {f"means{level}": mean for level, mean in enumerate(means)}
        checkpoint.save(_CHECKPOINT, {**state, "rest": rest, "done": np.array(number + 1)})
        unexplained = float(rest[:, 0].var(axis=0).sum())
        monitor(Progress(_STAGE, number + 1, PASSES, (number + 1) / PASSES, unexplained))
    levels = [
        Level({name: row for row, name in enumerate(distinct)}, mean, count.astype(np.int32))
        for (distinct, _, _), mean, count in zip(groups, means, counts, strict=True)
    ]
    return levels, rest


_CHECKPOINT, _STAGE = "motion", "contexts"


def _backfit_once(
    groups: Sequence[_Groups],
    counts: Sequence[NDArray[np.intp]],
    means: list[NDArray[np.float32]],
    rest: NDArray[np.float32],
    shrinkage: float,
) -> None:
    """Estimate every level's means once from what all the others leave unexplained (both in place)."""
    for number, (_, order, starts) in enumerate(groups):
        rest[order] += np.repeat(means[number], counts[number], axis=0)
        sums = np.add.reduceat(rest[order].astype(float), starts, axis=0)
        means[number] = (sums / (counts[number] + shrinkage)[:, None, None]).astype(np.float32)
        rest[order] -= np.repeat(means[number], counts[number], axis=0)


def _fit_variances(
    names: Sequence[tuple[str, ...]], rest: NDArray[np.float32], overall: NDArray[np.float32], shrinkage: float
) -> tuple[dict[str, int], NDArray[np.float32]]:
    """Return the variances around the full mean, of some levels, each shrunk towards the more general one."""
    rows: dict[str, int] = {}
    variances: list[NDArray[np.float32]] = []
    squares, least = np.square(rest), np.maximum(LEAST_VARIANCE_SHARE * overall, LEAST_VARIANCE)
    for position, number in enumerate(SPREAD_LEVELS):
        distinct, order, starts = _groups([name[number] for name in names])
        first = {name[number]: name for name in names}
        general_level = SPREAD_LEVELS[position - 1]
        sums = np.add.reduceat(squares[order].astype(float), starts, axis=0)
        counts = np.diff(np.append(starts, len(order)))
        for name, total, count in zip(distinct, sums, counts, strict=True):
            general = variances[rows[first[name][general_level]]] if position else rest.var(axis=0)
            variance = (total + shrinkage * general) / (count + shrinkage)
            rows[name] = len(variances)
            variances.append(np.maximum(variance, least).astype(np.float32))
    return rows, np.array(variances)
