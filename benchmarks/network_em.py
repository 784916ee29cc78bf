"""One step of expectation–maximisation of mixtures and arcs over any network, as the benchmark of forward–backward."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.hmm.network import Network
from lipmotion.kernels.network import ForwardBackwardNetwork
from lipmotion.stats.mixture import Mixtures, QuadraticForm, normalised_components, with_squares
from lipmotion.types import ParallelMap

CELLS = 1_000_000
"""Frames × components whose posteriors are computed together: 4 MB an array, a few of them."""
LEAST_FRAMES = 1.0
"""A density, or the arcs out of a state, with less data, in frames, are not re-estimated."""


def em_step(
    mixtures: Mixtures,
    network: Network,
    data: Sequence[NDArray[np.float32]],
    floor: NDArray[np.float32],
    parallel_map: ParallelMap = map,
) -> tuple[Mixtures, Network, float]:
    """Take one step of expectation and maximisation.

    mixtures : the densities that ``network.emission`` counts; several states may share one
    data     : features of every recording [shape=(T, D)]
    floor    : [shape=(D,)], least variance
    parallel_map : distributes the work; the result is the same to the bit
    Returns better densities, the network with better arcs and beginnings, and the mean log likelihood per frame under
    the old ones. Where recordings may end is not learned. A recording without a path is left out.
    Raises InputError: a recording without frames, or of another dimension than the densities, or none that has a path.
    Source: Baum et al. 1970.  Cost: O(T·(G·M·D + E)), the first as matrix products.
    """
    _check(mixtures, data, floor)
    prepared = _prepared(network)
    used, columns = _in_order(network.emission[prepared.layout.order])
    model = _Model(mixtures.quadratic(used), columns, prepared)
    jobs = ((model, [data[i] for i in batch]) for batch in _batches([len(x) for x in data], model.form.constant.size))
    total: _Statistics | None = None
    for statistics in parallel_map(_accumulated, jobs):
        total = statistics if total is None else total.plus(statistics)
    if total is None or not total.frames:
        raise InputError(f"none of {len(data)} recordings has a path through the network; check its arcs and ends")
    better = mixtures.copy()
    products = total.products.transpose(1, 0, 2)
    known = products[:, :, -1].sum(axis=1) >= LEAST_FRAMES
    first, second = np.split(products[known, :, :-1], 2, axis=2)
    better.set_from_statistics(used[known], products[known, :, -1], first, second, floor)
    return better, _reestimated(network, total), total.log_likelihood / total.frames


@dataclass(frozen=True, eq=False)
class _Model:
    """Densities and a network, prepared for the kernels.

    form    : of the densities that are used
    columns : [shape=(S,)], the number among them of the density of the state at each place
    """

    form: QuadraticForm
    columns: NDArray[np.intp]
    network: ForwardBackwardNetwork


@dataclass(frozen=True, eq=False)
class _Statistics:
    """Sufficient statistics of recordings.

    products : [shape=(M, G, 2 D + 1)], sums of posteriors times features, their squares, and 1
    arcs     : [shape=(E,)], expected number of times that each was followed
    begun    : [shape=(S,)], expected number of recordings that begin in the state at each place
    """

    products: NDArray[np.float64]
    arcs: NDArray[np.float64]
    begun: NDArray[np.float64]
    log_likelihood: float
    frames: int

    def plus(self, other: _Statistics) -> _Statistics:
        return _Statistics(
            self.products + other.products,
            self.arcs + other.arcs,
            self.begun + other.begun,
            self.log_likelihood + other.log_likelihood,
            self.frames + other.frames,
        )


def _prepared(network: Network) -> ForwardBackwardNetwork:
    return ForwardBackwardNetwork.of(
        network.arc_from, network.arc_log, network.arc_start, network.log_initial, network.log_final
    )


def _check(mixtures: Mixtures, data: Sequence[NDArray[np.float32]], floor: NDArray[np.float32]) -> None:
    dimension = mixtures.size[2]
    for number, x in enumerate(data):
        if x.ndim != 2 or x.shape[1] != dimension or not len(x):
            raise InputError(
                f"recording {number} has shape {x.shape}, required (frames, {dimension}), one frame or more"
            )
    if floor.shape != (dimension,) or not (floor > 0).all():
        raise InputError(f"floor has shape {floor.shape}, required ({dimension},), all more than 0")


def _batches(frames: Sequence[int], components: int) -> Iterator[list[int]]:
    """Give recordings in groups of no more than ``CELLS`` unless one alone is larger."""
    batch: list[int] = []
    for i, count in enumerate(frames):
        if batch and (sum(frames[j] for j in batch) + count) * components > CELLS:
            yield batch
            batch = []
        batch.append(i)
    if batch:
        yield batch


def _accumulated(job: tuple[_Model, list[NDArray[np.float32]]]) -> _Statistics:
    model, data = job
    frames = np.array([len(x) for x in data])
    features = with_squares(np.concatenate(data))
    whole = np.concatenate([model.form.form, model.form.constant.reshape(1, -1)])
    components = (features @ whole).reshape(len(features), *model.form.constant.shape)
    log_density, shares = normalised_components(components)
    expected = model.network.posteriors(log_density, model.columns, frames)
    possible = np.isfinite(expected.log_likelihood)
    begins = np.append(0, np.cumsum(frames[:-1]))
    begun = expected.posterior[begins].sum(axis=0, dtype=np.float64)
    weights = _by_density(expected.posterior, model.columns)
    if shares is not None:
        shares *= weights[:, None]
        weights = shares.reshape(len(features), -1)
    return _Statistics(
        (weights.T @ features).reshape(*model.form.constant.shape, -1).astype(np.float64),
        expected.counts,
        begun,
        float(expected.log_likelihood[possible].sum()),
        int(frames[possible].sum()),
    )


def _in_order(densities: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return each density once, in the order of appearance, and the position there of each."""
    used, first, inverse = np.unique(densities, return_index=True, return_inverse=True)
    order = np.argsort(first)
    return used[order], np.argsort(order)[inverse]


def _by_density(posterior: NDArray[np.float32], columns: NDArray[np.intp]) -> NDArray[np.float32]:
    """Return the sum over the states that share a density [shape=(T, G)]."""
    if np.array_equal(columns, np.arange(len(columns))):
        return posterior
    by_density = np.argsort(columns, kind="stable")
    return np.add.reduceat(posterior[:, by_density], np.unique(columns[by_density], return_index=True)[1], axis=1)


def _reestimated(network: Network, sums: _Statistics) -> Network:
    """Return the network with re-estimated probabilities of arcs and beginnings; impossible ones stay impossible."""
    left = np.bincount(network.arc_from, sums.arcs, len(network.emission))[network.arc_from]
    old_left = np.bincount(network.arc_from, np.exp(network.arc_log.astype(float)), len(network.emission))
    begun = np.empty(len(sums.begun))
    begun[_prepared(network).layout.order] = sums.begun
    with np.errstate(divide="ignore", invalid="ignore"):
        arc_log = np.log(sums.arcs / left * old_left[network.arc_from])
        log_initial = np.log(begun / begun.sum())
    return replace(
        network,
        arc_log=np.where(left >= LEAST_FRAMES, arc_log, network.arc_log).astype(np.float32),
        log_initial=log_initial.astype(np.float32),
    )
