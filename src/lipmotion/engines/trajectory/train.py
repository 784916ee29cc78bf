"""Statistics of motion, unit by unit, each context shrunk towards the more general one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.trajectory.contexts import LEVELS, level_names, places
from lipmotion.engines.trajectory.model import Level, TrajectoryModel
from lipmotion.errors import CorpusError
from lipmotion.stats.em import Monitor
from lipmotion.stats.pca import Pca, fit_pca
from lipmotion.stats.windows import with_dynamics
from lipmotion.types import Channel, Example

LEAST_VARIANCE_SHARE = 1e-3
"""No variance falls under this share of the overall one."""


def fit_trajectory(
    examples: Sequence[Example],
    *,
    parts: int,
    edge_s: float,
    components: int,
    shrinkage: float,
    variance_shrinkage: float,
    monitor: Monitor,
) -> TrajectoryModel:
    """Return means of every context as deviations from the next more general one, and variances.

    components : dimensions that all point channels (``x_17``, ...) are reduced to
    shrinkage, variance_shrinkage : frames that the more general context counts for
    Raises CorpusError: no example with motion that was seen, or examples of different channels.
    """
    channels = _common_channels(examples)
    direct, points = _spaces(examples, channels, components)
    model = TrajectoryModel(channels, direct, points, (), {}, np.zeros((0, 3, 0), np.float32))
    names: list[tuple[str, ...]] = []
    rows: list[NDArray[np.float32]] = []
    for example in examples:
        inner = example.valid.copy()
        inner[[0, -1]] = False  # no dynamics there
        dynamics = with_dynamics(model.to_model_space(example.motion.values))
        where = places(example.speech.units, len(inner), parts, edge_s)
        rows.append(dynamics[inner].astype(np.float32))
        names += [level_names(place) for place, kept in zip(where, inner, strict=True) if kept]
    rest = np.concatenate(rows)
    overall = rest.var(axis=0)
    levels = []
    for number in range(LEVELS):
        level, explained = _fit_level([name[number] for name in names], rest, shrinkage)
        rest -= explained
        levels.append(level)
        monitor(f"contexts of level {number}", len(level.rows))
    spread, variances = _fit_variances(names, rest, overall, variance_shrinkage)
    return TrajectoryModel(channels, direct, points, tuple(levels), spread, variances)


def _common_channels(examples: Sequence[Example]) -> tuple[Channel, ...]:
    if not any(example.valid[1:-1].any() for example in examples):
        raise CorpusError(f"none of {len(examples)} examples has motion to learn from; prepare a corpus with faces")
    found = {example.motion.channels for example in examples}
    if len(found) > 1:
        raise CorpusError("the utterances have different motion channels; train on one kind of corpus at a time")
    return found.pop()


def _spaces(
    examples: Sequence[Example], channels: tuple[Channel, ...], components: int
) -> tuple[NDArray[np.intp], Pca | None]:
    is_point = np.array([channel.name[:2] in ("x_", "y_", "z_") for channel in channels])
    direct = np.nonzero(~is_point)[0].astype(np.intp)
    if not is_point.any():
        return direct, None
    seen = np.concatenate([example.motion.values[example.valid][:, is_point] for example in examples])
    return direct, fit_pca(seen, components)


def _groups(names: Sequence[str]) -> tuple[list[str], NDArray[np.intp], NDArray[np.intp]]:
    """Return the distinct names, the frames sorted by name, and where each name's begin."""
    index: dict[str, int] = {}
    numbers = np.array([index.setdefault(name, len(index)) for name in names])
    starts = np.concatenate([[0], np.cumsum(np.bincount(numbers))[:-1]])
    return list(index), np.argsort(numbers, kind="stable"), starts.astype(np.intp)


def _fit_level(names: Sequence[str], rest: NDArray[np.float32], shrinkage: float) -> tuple[Level, NDArray[np.float32]]:
    """Return one level, and what it explains of every frame."""
    distinct, order, starts = _groups(names)
    counts = np.diff(np.append(starts, len(order)))
    sums = np.add.reduceat(rest[order].astype(float), starts, axis=0)
    means = (sums / (counts + shrinkage)[:, None, None]).astype(np.float32)
    explained = np.empty_like(rest)
    explained[order] = np.repeat(means, counts, axis=0)
    level = Level({name: row for row, name in enumerate(distinct)}, means, counts.astype(np.int32))
    return level, explained


def _fit_variances(
    names: Sequence[tuple[str, ...]], rest: NDArray[np.float32], overall: NDArray[np.float32], shrinkage: float
) -> tuple[dict[str, int], NDArray[np.float32]]:
    """Return the variances around the full mean, of the first three levels, each shrunk towards the one before."""
    rows: dict[str, int] = {}
    variances: list[NDArray[np.float32]] = []
    squares = np.square(rest)
    for number in range(3):
        distinct, order, starts = _groups([name[number] for name in names])
        first = {name[number]: name for name in names}
        sums = np.add.reduceat(squares[order].astype(float), starts, axis=0)
        counts = np.diff(np.append(starts, len(order)))
        for name, total, count in zip(distinct, sums, counts, strict=True):
            general = variances[rows[first[name][number - 1]]] if number else rest.var(axis=0)
            variance = (total + shrinkage * general) / (count + shrinkage)
            rows[name] = len(variances)
            variances.append(np.maximum(variance, LEAST_VARIANCE_SHARE * overall).astype(np.float32))
    return rows, np.array(variances)
