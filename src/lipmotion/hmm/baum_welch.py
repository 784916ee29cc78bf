"""Embedded Baum–Welch training of unit models: statistics of utterances, and the models re-estimated from them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.hmm.align import StateSequence, expand_states
from lipmotion.hmm.model import StateTable, UnitHmm
from lipmotion.kernels.forward_backward import LOG_ZERO, chain_posteriors
from lipmotion.stats.em import EmResult, no_report, run_em
from lipmotion.stats.mixture import Mixtures
from lipmotion.types import ParallelMap

CELLS = 1_000_000
"""Frames × utterances × states of a batch whose posteriors are computed together: 8 MB an array, some fifty arrays."""
MIN_POSTERIOR = 1e-3
"""Smaller state posteriors are left out of the statistics of densities."""
LONGEST_SILENCE_FRAMES, LONGEST_STATE_FRAMES = 200.0, 12.0
"""Largest mean duration, in frames, of a state of silence, and of a state of any other unit. Without the second limit
the closure of a stop that begins every other sentence absorbs the silence before it."""
AfterStep = Callable[[int, UnitHmm, "UnitStatistics"], None]
"""Called after every EM step with its number, the new models, and the statistics that they were estimated from."""
Maximise = Callable[[UnitHmm, "UnitStatistics", Sequence[NDArray[np.float32]]], UnitHmm]


def reestimate_states(model: UnitHmm, statistics: UnitStatistics, data: Sequence[NDArray[np.float32]]) -> UnitHmm:
    """Return models with all densities, and the durations of all states, re-estimated from statistics (M-step)."""
    return replace(model, mixtures=reestimate_mixtures(model, statistics, data), log_stay=statistics.log_stay())


def adapt_contexts(model: UnitHmm, statistics: UnitStatistics, _: Sequence[NDArray[np.float32]]) -> UnitHmm:
    """Return models whose states in context are adapted (M-step), with those without, which stay, as their prior."""
    plain, parents = len(model.log_stay), model.table.parents()
    mixtures = model.mixtures.copy()
    for density, x, weights in statistics.by_density():
        if density >= plain:
            mixtures.map_update(density, x, weights, int(parents[density]), model.config.relevance)
    return replace(model, mixtures=mixtures)


def baum_welch(
    hmm: UnitHmm,
    data: Sequence[NDArray[np.float32]],
    sequences: Sequence[tuple[str, ...]],
    steps: int = 1,
    maximise: Maximise = reestimate_states,
    after_step: AfterStep = no_report,
    parallel_map: ParallelMap = map,
) -> EmResult[UnitHmm, UnitStatistics]:
    """Take some steps of embedded Baum–Welch.

    data      : features of every utterance [shape=(T, D)]
    sequences : the units spoken in each
    maximise  : the M-step: ``reestimate_states`` or ``adapt_contexts``
    parallel_map : distributes the work; the result is the same to the bit
    Returns the re-estimated models, and the mean log likelihood per frame before every step.
    An utterance too short for its units is left out.
    """
    return run_em(
        hmm,
        lambda model: accumulate_statistics(model, data, sequences, parallel_map),
        lambda model, statistics: maximise(model, statistics, data),
        steps,
        after_step,
    )


def reestimate_mixtures(hmm: UnitHmm, statistics: UnitStatistics, data: Sequence[NDArray[np.float32]]) -> Mixtures:
    """Return the densities re-estimated from the statistics (M-step); with less than one frame of data they stay."""
    mixtures = hmm.mixtures.copy()
    floor = hmm.config.variance_floor * np.concatenate(data).var(axis=0)
    for density, x, weights in statistics.by_density():
        if weights.sum() >= 1:
            mixtures.em_update(density, x, weights, floor)
    return mixtures


def accumulate_statistics(
    hmm: UnitHmm,
    data: Sequence[NDArray[np.float32]],
    sequences: Sequence[tuple[str, ...]],
    parallel_map: ParallelMap = map,
) -> UnitStatistics:
    """Return the sufficient statistics of utterances for every state (the E-step). Parameters as ``baum_welch``."""
    statistics = UnitStatistics(hmm)
    states = [sum(hmm.table.count(unit) for unit in sequence) for sequence in sequences]
    groups = list(group_by_length([len(x) for x in data], states))
    jobs = (_Batch(hmm, [data[i] for i in batch], [sequences[i] for i in batch]) for batch in groups)
    results = parallel_map(_collect_batch, jobs)
    for batch, (of_utterances, log_likelihood, frames) in zip(groups, results, strict=True):
        for i, of_utterance in zip(batch, of_utterances, strict=True):
            statistics.add(data[i], of_utterance)
        statistics.log_likelihood += log_likelihood
        statistics.frames += frames
    return statistics


class _Batch(NamedTuple):
    """Some utterances, their unit sequences, and the models that give their posteriors."""

    hmm: UnitHmm
    data: list[NDArray[np.float32]]
    sequences: list[tuple[str, ...]]


class UtteranceStatistics(NamedTuple):
    """The statistics of one utterance for the S states of its unit sequence.

    plain    : [shape=(S,)], the densities of the states without context
    stay     : [shape=(S,)], expected number of transitions from each state to itself
    occupied : [shape=(S,)], expected number of frames in each state
    frames, densities, weights : [shape=(N,)], one entry for each state posterior above ``MIN_POSTERIOR``: its frame,
        its density, and the posterior
    """

    plain: NDArray[np.intp]
    stay: NDArray[np.float64]
    occupied: NDArray[np.float64]
    frames: NDArray[np.intp]
    densities: NDArray[np.intp]
    weights: NDArray[np.float32]


def collect_statistics(
    sequence: StateSequence, posterior: NDArray[np.float64], stay: NDArray[np.float64]
) -> UtteranceStatistics:
    """Return the statistics of an utterance from its state posteriors [shape=(T, S)]."""
    frame, state = np.nonzero(posterior > MIN_POSTERIOR)
    weights = posterior[frame, state].astype(np.float32)
    return UtteranceStatistics(sequence.plain, stay, posterior.sum(axis=0), frame, sequence.densities[state], weights)


def _collect_batch(batch: _Batch) -> tuple[list[UtteranceStatistics], float, int]:
    """Return the statistics of each utterance, and the log likelihood and frame count of all that have a path."""
    hmm, chains = batch.hmm, [expand_states(batch.hmm, sequence) for sequence in batch.sequences]
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
    statistics = [
        collect_statistics(chain, posterior[: frames[u], u, : states[u]], stay[u, : states[u]])
        for u, chain in enumerate(chains)
    ]
    possible = log_likelihood > LOG_ZERO / 2
    return statistics, float(log_likelihood[possible].sum()), int(frames[possible].sum())


def group_by_length(frames: Sequence[int], states: Sequence[int]) -> Iterator[list[int]]:
    """Give the numbers of utterances in batches of similar length, of at most ``CELLS`` cells, or of one utterance."""
    batch: list[int] = []
    max_states = 0
    for i in sorted(range(len(frames)), key=lambda i: frames[i]):
        max_states = max(max_states, states[i])
        if batch and frames[i] * max_states * (len(batch) + 1) > CELLS:
            yield batch
            batch, max_states = [], states[i]
        batch.append(i)
    if batch:
        yield batch


class UnitStatistics:
    """The sufficient statistics of one pass over the data, for the states of unit models."""

    def __init__(self, hmm: UnitHmm) -> None:
        self._hmm = hmm
        self.log_likelihood, self.frames = 0.0, 0
        self._stay, self._occupied = np.zeros((2, len(hmm.log_stay)))
        self._features: list[NDArray[np.float32]] = []
        self._utterances: list[UtteranceStatistics] = []

    @property
    def mean_log_likelihood(self) -> float:
        """Mean log likelihood per frame."""
        return self.log_likelihood / max(self.frames, 1)

    def add(self, x: NDArray[np.float32], utterance: UtteranceStatistics) -> None:
        """Accumulate the statistics of one utterance with features ``x`` [shape=(T, D)]."""
        np.add.at(self._stay, utterance.plain, utterance.stay)
        np.add.at(self._occupied, utterance.plain, utterance.occupied)
        self._features.append(x)
        self._utterances.append(utterance)

    def by_density(self) -> Iterator[tuple[int, NDArray[np.float32], NDArray[np.float32]]]:
        """Give each density that has data: its number, its frames [shape=(N, D)] and their posteriors [shape=(N,)]."""
        begins = np.cumsum([0, *map(len, self._features)])
        rows = np.concatenate([each.frames + begin for each, begin in zip(self._utterances, begins, strict=False)])
        densities = np.concatenate([each.densities for each in self._utterances])
        weights = np.concatenate([each.weights for each in self._utterances])
        features = np.concatenate(self._features)
        order = np.argsort(densities, kind="stable")
        visited, starts = np.unique(densities[order], return_index=True)
        for density, entries in zip(visited, np.split(order, starts[1:]), strict=True):
            yield int(density), features[rows[entries]], weights[entries]

    def log_stay(self) -> NDArray[np.float32]:
        """Return the re-estimated log P(stay in the state) of every state without context [shape=(R,)].

        A state without data keeps its probability; all are limited by the largest mean durations.
        """
        measured = self._stay / np.maximum(self._occupied, 1e-9)
        stay = np.where(self._occupied > 0, measured, np.exp(self._hmm.log_stay))
        longest = max_mean_durations(self._hmm.table)[: len(stay)]
        return np.log(np.clip(stay, 0.05, 1 - 1 / longest)).astype(np.float32)


def max_mean_durations(table: StateTable) -> NDArray[np.float64]:
    """Return the largest mean duration allowed for each state, in frames [shape=(G,)]."""
    units = [name.split(".")[0] for name in table.names]
    return np.array([LONGEST_SILENCE_FRAMES if unit in table.free else LONGEST_STATE_FRAMES for unit in units])
