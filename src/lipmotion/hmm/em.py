"""Embedded Baum–Welch: what utterances say about every state, and the models that follow from it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lipmotion.hmm.align import Chain, chain_of
from lipmotion.hmm.model import UnitHmm
from lipmotion.hmm.states import StateTable
from lipmotion.kernels.forward_backward import IMPOSSIBLE, chain_posteriors
from lipmotion.stats.mixture import Mixtures
from lipmotion.types import ParallelMap

CELLS = 1_000_000
"""Frames × utterances × states whose posteriors are computed together: 8 MB an array, some fifty in all."""
LEAST_POSTERIOR = 1e-3
"""State posteriors under this are left out of the statistics."""
LONGEST_SILENCE, LONGEST_STATE = 200.0, 12.0
"""Most frames that a state of silence, or of any other unit, may last on average. Without the second limit the
closure of a stop that begins every other sentence takes the silence before it for its own."""


def baum_welch(
    hmm: UnitHmm, data: Sequence[NDArray[np.float32]], sequences: Sequence[tuple[str, ...]], each: ParallelMap = map
) -> tuple[UnitHmm, float]:
    """Take one embedded Baum–Welch step.

    data      : features of every utterance [shape=(T, D)]
    sequences : the units said in each
    each      : shares the work; the result is the same to the bit
    Returns the new models, and the mean log likelihood per frame under the old ones.
    An utterance too short for its units is left out.
    """
    statistics = expect(hmm, data, sequences, each)
    better = replace(hmm, mixtures=maximised(hmm, statistics, data), log_stay=statistics.log_stay())
    return better, statistics.mean_log_likelihood


def adapt_contexts(
    hmm: UnitHmm, data: Sequence[NDArray[np.float32]], sequences: Sequence[tuple[str, ...]], each: ParallelMap = map
) -> tuple[UnitHmm, float | None]:
    """Take one step of adapting the states in context to their data, those without context as their prior.

    Returns the new models, and the mean log likelihood per frame under the old ones (None: no contexts, nothing to do).
    """
    plain, parents = len(hmm.log_stay), hmm.table.parents()
    if len(parents) == plain:
        return hmm, None
    statistics = expect(hmm, data, sequences, each)
    mixtures = hmm.mixtures.copy()
    for density, x, share in statistics.by_density():
        if density >= plain:
            mixtures.adapt(density, x, share, int(parents[density]), hmm.config.relevance)
    return replace(hmm, mixtures=mixtures), statistics.mean_log_likelihood


def maximised(hmm: UnitHmm, statistics: Statistics, data: Sequence[NDArray[np.float32]]) -> Mixtures:
    """Return the densities that explain the statistics best (the M-step)."""
    mixtures = hmm.mixtures.copy()
    floor = hmm.config.variance_floor * np.concatenate(data).var(axis=0)
    for density, x, share in statistics.by_density():
        if share.sum() >= 1:
            mixtures.improve(density, x, share, floor)
    return mixtures


def expect(
    hmm: UnitHmm, data: Sequence[NDArray[np.float32]], sequences: Sequence[tuple[str, ...]], each: ParallelMap = map
) -> Statistics:
    """Return what the utterances say about every state (the E-step)."""
    statistics = Statistics(hmm)
    states = [sum(hmm.table.count(unit) for unit in sequence) for sequence in sequences]
    groups = list(batches([len(x) for x in data], states))
    jobs = (_Batch(hmm, [data[i] for i in batch], [sequences[i] for i in batch]) for batch in groups)
    for batch, (found, log_likelihood, frames) in zip(groups, each(_heard, jobs), strict=True):
        for i, utterance_statistics in zip(batch, found, strict=True):
            statistics.add(data[i], utterance_statistics)
        statistics.count(log_likelihood, frames)
    return statistics


@dataclass(frozen=True, eq=False)
class _Batch:
    """Some utterances, and the models that they are heard with."""

    hmm: UnitHmm
    data: list[NDArray[np.float32]]
    sequences: list[tuple[str, ...]]


@dataclass(frozen=True, eq=False)
class UtteranceStatistics:
    """What one utterance says about the states of its chain.

    plain    : [shape=(S,)], the states' numbers without context
    stay, occupied : [shape=(S,)], how often each was kept, and how many frames it had
    frames, densities, shares : [shape=(N,)], every posterior that counts: its frame, its density, and itself
    """

    plain: NDArray[np.intp]
    stay: NDArray[np.float64]
    occupied: NDArray[np.float64]
    frames: NDArray[np.intp]
    densities: NDArray[np.intp]
    shares: NDArray[np.float32]


def utterance_statistics(
    chain: Chain, posterior: NDArray[np.float64], stay: NDArray[np.float64]
) -> UtteranceStatistics:
    """Return what an utterance says whose state posteriors are known."""
    frame, state = np.nonzero(posterior > LEAST_POSTERIOR)
    shares = posterior[frame, state].astype(np.float32)
    return UtteranceStatistics(chain.plain, stay, posterior.sum(axis=0), frame, chain.densities[state], shares)


def _heard(batch: _Batch) -> tuple[list[UtteranceStatistics], float, int]:
    """Return what each utterance says, their log likelihood, and the frames of those that are possible."""
    hmm, chains = batch.hmm, [chain_of(batch.hmm, sequence) for sequence in batch.sequences]
    frames = np.array([len(x) for x in batch.data], np.intp)
    states = np.array([len(chain.densities) for chain in chains], np.intp)
    log_emission = np.zeros((frames.max(), len(chains), states.max()))
    log_stay = np.full((len(chains), states.max()), -1.0)
    for u, (x, chain) in enumerate(zip(batch.data, chains, strict=True)):
        used, local = np.unique(chain.densities, return_inverse=True)
        log_emission[: len(x), u, : states[u]] = hmm.mixtures.log_likelihood(x, used)[:, local]
        log_stay[u, : states[u]] = hmm.log_stay[chain.plain]
    log_move = np.log(-np.expm1(log_stay))
    posterior, stay, log_likelihood = chain_posteriors(log_emission, log_stay, log_move, frames, states)
    found = [
        utterance_statistics(chain, posterior[: frames[u], u, : states[u]], stay[u, : states[u]])
        for u, chain in enumerate(chains)
    ]
    possible = log_likelihood > IMPOSSIBLE / 2
    return found, float(log_likelihood[possible].sum()), int(frames[possible].sum())


def batches(frames: Sequence[int], states: Sequence[int]) -> Iterator[list[int]]:
    """Give utterances in groups of like length, padded to no more than ``CELLS`` unless one alone is larger."""
    batch: list[int] = []
    most = 0
    for i in sorted(range(len(frames)), key=lambda i: frames[i]):
        most = max(most, states[i])
        if batch and frames[i] * most * (len(batch) + 1) > CELLS:
            yield batch
            batch, most = [], states[i]
        batch.append(i)
    if batch:
        yield batch


class Statistics:
    """What one pass over the data says about every state."""

    def __init__(self, hmm: UnitHmm) -> None:
        self._hmm = hmm
        self._log_likelihood, self._frames = 0.0, 0
        self._stay = np.zeros(len(hmm.log_stay))
        self._occupied = np.zeros(len(hmm.log_stay))
        self._densities: list[NDArray[np.intp]] = []
        self._shares: list[NDArray[np.float32]] = []
        self._rows: list[NDArray[np.intp]] = []
        self._features: list[NDArray[np.float32]] = []
        self._seen = 0

    @property
    def mean_log_likelihood(self) -> float:
        """Per frame."""
        return self._log_likelihood / max(self._frames, 1)

    def add(self, x: NDArray[np.float32], utterance_statistics: UtteranceStatistics) -> None:
        """Add one utterance with features ``x``."""
        np.add.at(self._stay, utterance_statistics.plain, utterance_statistics.stay)
        np.add.at(self._occupied, utterance_statistics.plain, utterance_statistics.occupied)
        self._densities.append(utterance_statistics.densities)
        self._shares.append(utterance_statistics.shares)
        self._rows.append(utterance_statistics.frames + self._seen)
        self._features.append(x)
        self._seen += len(x)

    def count(self, log_likelihood: float, frames: int) -> None:
        """Add to the log likelihood, and to the frames that it is of."""
        self._log_likelihood += log_likelihood
        self._frames += frames

    def by_density(self) -> Iterator[tuple[int, NDArray[np.float32], NDArray[np.float32]]]:
        """Give every density that was visited: its number, the frames, and its posterior in each."""
        densities, shares = np.concatenate(self._densities), np.concatenate(self._shares)
        rows, features = np.concatenate(self._rows), np.concatenate(self._features)
        order = np.argsort(densities, kind="stable")
        visited, starts = np.unique(densities[order], return_index=True)
        for density, mine in zip(visited, np.split(order, starts[1:]), strict=True):
            yield int(density), features[rows[mine]], shares[mine]

    def log_stay(self) -> NDArray[np.float32]:
        """Return log P(keep the state) of every state without context."""
        kept = self._stay / np.maximum(self._occupied, 1e-9)
        keep = np.where(self._occupied > 0, kept, np.exp(self._hmm.log_stay))
        return np.log(np.clip(keep, 0.05, 1 - 1 / longest(self._hmm.table)[: len(keep)])).astype(np.float32)


def longest(table: StateTable) -> NDArray[np.float64]:
    """Return the most frames each state may last on average [shape=(G,)]."""
    units = [name.split(".")[0] for name in table.names]
    return np.array([LONGEST_SILENCE if unit in table.free else LONGEST_STATE for unit in units])
