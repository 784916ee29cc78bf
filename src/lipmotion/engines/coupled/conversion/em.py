"""Speech to what should be seen: the inverse of training (Xie & Liu 2007, §4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.densities import Group, Observed, Single, component_posteriors
from lipmotion.engines.coupled.chains.lattice import Lattice, Posteriors
from lipmotion.engines.coupled.chains.model import Chains, Evidence

Array = NDArray[np.float64]
SOFT, VITERBI = "soft", "viterbi"
STARTS = (SOFT, VITERBI)
EXACT, PRINTED = "exact", "printed"
UPDATES = (EXACT, PRINTED)
CONVERGED = 1e-4
"""Of the log likelihood a frame: less is no progress."""


@dataclass(frozen=True)
class Conversion:
    """How streams that were not observed are found.

    start  : ``soft``: from all paths that fit the speech; ``viterbi``: the means along the best of them, as printed
    update : ``exact``: the maximiser of each step; ``printed``: Eq. 9 as it stands
    most   : steps of EM after the start, at most
    """

    start: str = SOFT
    update: str = EXACT
    most: int = 10


@dataclass(frozen=True, eq=False)
class Converted:
    """Streams that were not observed, and how they were found.

    streams : values of every stream, speech first [each shape=(T, D_s)]
    log_likelihood : of speech and streams together, a frame, before every step and after the last
    """

    streams: tuple[Array, ...]
    log_likelihood: tuple[float, ...]


def converted(chains: Chains, observed: Observed, lattice: Lattice, how: Conversion) -> Converted:
    """Return the streams that make speech and themselves most likely together, near the start.

    observed : speech in the first stream; what the others hold says nothing
    lattice  : where the chains can be
    By ``exact`` updates the joint likelihood never falls; the printed one has no such promise.
    Source: Xie & Liu 2007, Eqs. 3–11, Fig. 6.
    """
    heard = speech_alone(observed)
    evidence = chains.evidence(heard, lattice)
    if how.start == VITERBI:
        path, _ = chains.best_path(evidence, lattice)
        current = tuple(path_means(chains, path, stream) for stream in unseen(chains))
    else:
        posteriors = chains.posteriors(evidence, lattice)
        current = tuple(_updated(chains, posteriors, evidence, lattice, stream, EXACT) for stream in unseen(chains))
    figures: list[float] = []
    for _ in range(how.most):
        evidence = chains.evidence(_with(heard, current), lattice)
        posteriors = chains.posteriors(evidence, lattice)
        figures.append(posteriors.log_likelihood / observed.frames)
        if len(figures) > 1 and figures[-1] - figures[-2] < CONVERGED:
            break
        current = tuple(
            _updated(chains, posteriors, evidence, lattice, stream, how.update) for stream in unseen(chains)
        )
    return Converted((observed.streams[0].astype(float), *current), tuple(figures))


def unseen(chains: Chains) -> range:
    """Return the numbers of all streams but speech."""
    return range(1, len(chains.streams))


def speech_alone(observed: Observed) -> Observed:
    """Return the same with all streams but speech unknown."""
    for stream in range(1, len(observed.streams)):
        observed = observed.missing(stream)
    return observed


def group_of(chains: Chains, stream: int) -> int:
    """Return which group a stream is in."""
    return next(number for number, group in enumerate(chains.groups) if stream in group.streams)


def statistics(
    chains: Chains, posteriors: Posteriors, evidence: Evidence, lattice: Lattice, stream: int
) -> tuple[Array, Array]:
    """Return expected precisions and precision-weighted means of a stream [each shape=(T, D)].

    Σ γ(q, k) Σ⁻¹ and Σ γ(q, k) Σ⁻¹ μ over its states q and components k.
    """
    number = group_of(chains, stream)
    weight = component_posteriors(posteriors.densities[number], evidence.shares[number])
    return _weighted(chains.groups[number], stream, lattice.densities[number], weight)


def path_means(chains: Chains, path: NDArray[np.intp], stream: int) -> Array:
    """Return the mean of the mixture of every state along a path [shape=(T, D)]."""
    group = chains.groups[group_of(chains, stream)]
    alone = group.of_stream(stream)
    means = (np.exp(alone.log_weights)[:, :, None] * alone.means).sum(axis=1)
    return means[group.tie[path]].astype(float)


def _weighted(group: Group, stream: int, chosen: NDArray[np.intp], weight: Single) -> tuple[Array, Array]:
    alone = group.of_stream(stream).picked(chosen)
    precision = (1 / alone.variances).transpose(1, 0, 2)
    weighted = precision * alone.means.transpose(1, 0, 2)
    size, flat = precision.shape[2], weight.reshape(len(weight), -1)
    total, sums = ((flat @ part.reshape(-1, size)).astype(float) for part in (precision, weighted))
    return total, sums


def _updated(
    chains: Chains, posteriors: Posteriors, evidence: Evidence, lattice: Lattice, stream: int, update: str
) -> Array:
    if update == EXACT:
        precision, weighted = statistics(chains, posteriors, evidence, lattice, stream)
        return weighted / np.maximum(precision, 1e-300)
    number = group_of(chains, stream)
    group, chosen = chains.groups[number], lattice.densities[number]
    partners = np.bincount(lattice.ties[number], minlength=len(chosen))
    printed = (np.exp(group.mixtures.log_weights[chosen]).T * partners).astype(np.float32)
    weight = component_posteriors(posteriors.densities[number], evidence.shares[number]) * printed
    precision, weighted = _weighted(group, stream, chosen, weight)
    return weighted / np.maximum(precision, 1e-300)


def _with(observed: Observed, streams: tuple[Array, ...]) -> Observed:
    for number, values in enumerate(streams, start=1):
        observed = observed.given(number, values.astype(np.float32))
    return observed
