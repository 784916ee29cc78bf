"""Embedded Baum–Welch training of unit models: statistics of utterances, and the models re-estimated from them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lipmotion.hmm.align import StateSequence, expand_states
from lipmotion.hmm.model import StateTable, UnitHmm
from lipmotion.kernels.forward_backward import LOG_ZERO, chain_posteriors
from lipmotion.stats.em import EmResult, Sums, no_report, run_em, sum_statistics
from lipmotion.stats.mixture import Mixtures, with_squares
from lipmotion.storage.archive import NO_CHECKPOINT, Checkpoint

CELLS = 1_000_000
"""Frames × utterances × states of a batch whose posteriors are computed together: 8 MB an array, some fifty arrays."""
MIN_POSTERIOR = 1e-3
"""Smaller state posteriors are left out of the statistics of densities."""
LONGEST_SILENCE_FRAMES, LONGEST_STATE_FRAMES = 200.0, 12.0
"""Largest mean duration, in frames, of a state of silence, and of a state of any other unit. Without the second limit
the closure of a stop that begins every other sentence absorbs the silence before it."""
AfterStep = Callable[[int, UnitHmm, "UnitStatistics"], None]
"""Called after every EM step with its number, the new models, and the statistics that they were estimated from."""
Maximise = Callable[[UnitHmm, "UnitStatistics"], UnitHmm]


def reestimate_states(model: UnitHmm, statistics: UnitStatistics) -> UnitHmm:
    """Return models with all densities, and the durations of all states, re-estimated from statistics (M-step).

    A state without data keeps its probability of staying; all are limited by the largest mean durations.
    """
    measured = statistics.stay / np.maximum(statistics.occupied, 1e-9)
    stay = np.where(statistics.occupied > 0, measured, np.exp(model.log_stay))
    longest = limit_durations(model.table)[: len(stay)]
    log_stay = np.log(np.clip(stay, 0.05, 1 - 1 / longest)).astype(np.float32)
    return replace(model, mixtures=reestimate_mixtures(model, statistics), log_stay=log_stay)


def adapt_contexts(model: UnitHmm, statistics: UnitStatistics) -> UnitHmm:
    """Return models whose states in context are adapted (M-step), with those without, which stay, as their prior."""
    plain, parents = len(model.log_stay), model.table.parents()
    mixtures = model.mixtures.copy()
    for density in plain + np.flatnonzero(statistics.frames_of_densities[plain:]):
        sums = statistics.components[density]
        mixtures.map_update(int(density), sums, int(parents[density]), model.config.relevance)
    return replace(model, mixtures=mixtures)


def baum_welch(
    hmm: UnitHmm,
    data: Sequence[NDArray[np.float32]],
    sequences: Sequence[tuple[str, ...]],
    steps: int = 1,
    maximise: Maximise = reestimate_states,
    after_step: AfterStep = no_report,
    work: Checkpoint = NO_CHECKPOINT,
) -> EmResult[UnitHmm, UnitStatistics]:
    """Take some steps of embedded Baum–Welch.

    data      : features of every utterance [shape=(T, D)]
    sequences : the units spoken in each
    maximise  : the M-step: ``reestimate_states`` or ``adapt_contexts``
    work      : as of ``sum_statistics``
    Returns the re-estimated models, and the mean log likelihood per frame before every step.
    An utterance too short for its units is left out.
    """
    return run_em(hmm, lambda model: accumulate_statistics(model, data, sequences, work), maximise, steps, after_step)


def reestimate_mixtures(hmm: UnitHmm, statistics: UnitStatistics) -> Mixtures:
    """Return the densities re-estimated from the statistics (M-step); with less than one frame of data they stay."""
    mixtures = hmm.mixtures.copy()
    enough = np.flatnonzero(statistics.frames_of_densities >= 1)
    floor = hmm.config.variance_floor * statistics.variance
    mixtures.set_from_statistics(enough, statistics.components[enough], floor)
    return mixtures


def accumulate_statistics(
    hmm: UnitHmm,
    data: Sequence[NDArray[np.float32]],
    sequences: Sequence[tuple[str, ...]],
    work: Checkpoint = NO_CHECKPOINT,
) -> UnitStatistics:
    """Return the sufficient statistics of utterances for every state (the E-step). Parameters as ``baum_welch``."""
    states = [sum(hmm.table.count(unit) for unit in sequence) for sequence in sequences]
    batches = group_by_length([len(x) for x in data], states)
    shards = [([data[i] for i in batch], [sequences[i] for i in batch]) for batch in batches]
    return sum_unit_statistics(sum_statistics(_shard_sums, hmm, shards, work))


def _shard_sums(job: tuple[UnitHmm, tuple[list[NDArray[np.float32]], list[tuple[str, ...]]]]) -> Sums:
    hmm, (data, sequences) = job
    chains = [expand_states(hmm, sequence) for sequence in sequences]
    frames = np.array([len(x) for x in data], np.intp)
    states = np.array([len(chain.densities) for chain in chains], np.intp)
    log_emission = np.zeros((frames.max(), len(chains), states.max()))
    log_stay = np.full((len(chains), states.max()), -1.0)
    for u, (x, chain) in enumerate(zip(data, chains, strict=True)):
        used, local = np.unique(chain.densities, return_inverse=True)
        log_emission[: len(x), u, : states[u]] = hmm.mixtures.log_likelihood(x, used)[:, local]
        log_stay[u, : states[u]] = hmm.log_stay[chain.plain]
    log_move = np.log(-np.expm1(log_stay))
    posterior, stay, log_likelihood = chain_posteriors(log_emission, log_stay, log_move, frames, states)
    cut = [(posterior[: frames[u], u, : states[u]], stay[u, : states[u]]) for u in range(len(chains))]
    possible = log_likelihood > LOG_ZERO / 2
    total = {"log likelihood": log_likelihood[possible].sum(), "frames": frames[possible].sum()}
    return {**add_up(hmm, data, chains, cut), **total}


def add_up(
    hmm: UnitHmm,
    data: Sequence[NDArray[np.float32]],
    chains: Sequence[StateSequence],
    posteriors: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]],
) -> Sums:
    """Return the sums of ``UnitStatistics`` over utterances, without their likelihood.

    posteriors : of each, those of its states [shape=(T, S)], and expected transitions to themselves [shape=(S,)]
    """
    stays, occupied = np.zeros((2, len(hmm.log_stay)))
    pairs = []
    for x, chain, (posterior, stay) in zip(data, chains, posteriors, strict=True):
        np.add.at(stays, chain.plain, stay)
        np.add.at(occupied, chain.plain, posterior.sum(axis=0))
        frame, state = np.nonzero(posterior > MIN_POSTERIOR)
        pairs.append((x[frame], chain.densities[state], posterior[frame, state].astype(np.float32)))
    rows, densities, weights = (np.concatenate(arrays) for arrays in zip(*pairs, strict=True))
    order = np.argsort(densities, kind="stable")
    visited, starts = np.unique(densities[order], return_index=True)
    G, M, D = hmm.mixtures.size
    components = np.zeros((G, M, 2 * D + 1))
    for density, entries in zip(visited, np.split(order, starts[1:]), strict=False):  # all may be too short
        components[density] = hmm.mixtures.component_sums(int(density), rows[entries], weights[entries])
    features = sum(with_squares(x).sum(axis=0, dtype=float) for x in data)
    return {"stay": stays, "occupied": occupied, "components": components, "features": np.asarray(features)}


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


@dataclass(frozen=True, eq=False)
class UnitStatistics:
    """The sufficient statistics of one pass over the data.

    stay, occupied : [shape=(R,)], expected transitions of every state without context to itself, and its frames
    components     : of every density [shape=(G, M, 2 D + 1)], as of ``Mixtures.component_sums``
    features       : of all frames [shape=(2 D + 1,)], alike
    """

    stay: NDArray[np.float64]
    occupied: NDArray[np.float64]
    components: NDArray[np.float64]
    features: NDArray[np.float64]
    log_likelihood: float = 0.0
    frames: int = 0

    @property
    def mean_log_likelihood(self) -> float:
        """Mean log likelihood per frame."""
        return self.log_likelihood / max(self.frames, 1)

    @property
    def frames_of_densities(self) -> NDArray[np.float64]:
        """Expected frames of every density [shape=(G,)]."""
        return self.components[:, :, -1].sum(axis=1)

    @property
    def variance(self) -> NDArray[np.float64]:
        """Variance of all frames [shape=(D,)]."""
        mean, square = np.split(self.features[:-1] / self.features[-1], 2)
        return np.maximum(square - mean * mean, 0.0)


def sum_unit_statistics(sums: Sums) -> UnitStatistics:
    """Return sums by name as statistics."""
    total = float(sums.get("log likelihood", 0.0)), int(sums.get("frames", 0))
    return UnitStatistics(sums["stay"], sums["occupied"], sums["components"], sums["features"], *total)


def limit_durations(table: StateTable) -> NDArray[np.float64]:
    """Return the largest mean duration allowed for each state, in frames [shape=(G,)]."""
    units = [name.split(".")[0] for name in table.names]
    return np.array([LONGEST_SILENCE_FRAMES if unit in table.free else LONGEST_STATE_FRAMES for unit in units])
