"""Embedded Baum–Welch training over all streams: statistics of utterances, and the models re-estimated from them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.hmm.baum_welch import LONGEST_SILENCE_FRAMES, LONGEST_STATE_FRAMES, group_by_length
from lipmotion.hmm.multistream.densities import MIN_POSTERIOR, GaussianStatistics, TiedDensities
from lipmotion.hmm.multistream.model import JointHmm
from lipmotion.hmm.multistream.streams import StreamObservations
from lipmotion.hmm.multistream.unit_states import Inventory, TriphoneState, expand_triphones
from lipmotion.kernels.forward_backward import LOG_ZERO, chain_posteriors

MIN_STAY_PROBABILITY = 0.05
"""Smallest probability of staying in a state."""
MIN_MIXTURE_POSTERIOR = 1e-5
"""Smaller state posteriors are left out of the statistics of mixtures; nearly all posteriors are smaller."""
FRAMES_AT_ONCE = 50_000
"""Frames whose statistics for mixtures are accumulated together."""
Rows = NDArray[np.float32]
Leaves = Mapping[str, NDArray[np.intp]]


@dataclass(frozen=True, eq=False)
class PreparedUtterance:
    """The standardised streams of an utterance, and the S states of its units.

    monophones : [shape=(S,)], the number of each state without context
    triphones  : [shape=(S,)], the number of each state in its context, in ``PreparedUtterances.triphones``
    distinct   : [shape=(N,)], the numbers in ``triphones``, each once
    member     : [shape=(S, N)], 1 where a state is the distinct one of the column, else 0
    """

    streams: Mapping[str, Rows]
    monophones: NDArray[np.intp]
    triphones: NDArray[np.intp]
    distinct: NDArray[np.intp]
    member: NDArray[np.float32]
    frames: int

    @property
    def fits(self) -> bool:
        """Whether there are at least as many frames as states."""
        return len(self.monophones) <= self.frames


@dataclass(frozen=True, eq=False)
class PreparedUtterances:
    """Utterances, and all distinct states in context that occur in them."""

    items: tuple[PreparedUtterance, ...]
    triphones: tuple[TriphoneState, ...]

    def leaves(self, hmm: JointHmm) -> Leaves:
        """Return the leaves of all states in context, by stream [shape=(len(triphones),)]."""
        return hmm.leaves(self.triphones)


class StatePosteriors(NamedTuple):
    """The posteriors of the states of one utterance.

    states    : [shape=(T, S)], the posterior of each state in every frame
    stay      : [shape=(S,)], expected number of transitions from each state to itself
    """

    utterance: int
    states: NDArray[np.float64]
    stay: NDArray[np.float64]
    log_likelihood: float


@dataclass(frozen=True, eq=False)
class StreamStatistics:
    """The sufficient statistics of utterances for the models of all streams (the result of the E-step).

    triphones : by stream, of every state in context (``PreparedUtterances.triphones``), for one Gaussian each
    leaves    : by stream, of its leaves, for all their Gaussians
    stay, occupied : [shape=(R,)], expected transitions of each state without context to itself, and its frames
    """

    triphones: Mapping[str, GaussianStatistics]
    leaves: Mapping[str, GaussianStatistics]
    stay: NDArray[np.float64]
    occupied: NDArray[np.float64]
    log_likelihood: float
    frames: int

    @property
    def mean_log_likelihood(self) -> float:
        """Mean log likelihood per frame."""
        return self.log_likelihood / max(self.frames, 1)


def prepare_utterances(
    hmm: JointHmm, utterances: Iterable[tuple[StreamObservations, Sequence[str]]]
) -> PreparedUtterances:
    """Return utterances in the model's scale and states. Raises InputError: an unknown unit."""
    index: dict[TriphoneState, int] = {}
    items = []
    for observed, units in utterances:
        states = expand_triphones(hmm.inventory, units)
        triphones = np.array([index.setdefault(state, len(index)) for state in states.triphones], np.intp)
        distinct, local = np.unique(triphones, return_inverse=True)
        member = np.eye(len(distinct), dtype=np.float32)[local]
        streams = {
            name: hmm.models[name].scale.standardise(stream)
            for name, stream in observed.streams.items()
            if name in hmm.models
        }
        items.append(PreparedUtterance(streams, states.monophones, triphones, distinct, member, observed.frames))
    return PreparedUtterances(tuple(items), tuple(index))


def iterate_posteriors(hmm: JointHmm, utterances: PreparedUtterances) -> Iterator[StatePosteriors]:
    """Give the state posteriors of utterances by length; too short ones, or without an active stream, are left out."""
    leaves, log_move, weights = utterances.leaves(hmm), hmm.log_move, hmm.config.training
    usable = [i for i, item in enumerate(utterances.items) if item.fits and set(weights.active) & set(item.streams)]
    items = [utterances.items[i] for i in usable]
    counts = [len(item.monophones) for item in items]
    for batch in group_by_length([item.frames for item in items], counts):
        frames = np.array([items[i].frames for i in batch], np.intp)
        states = np.array([counts[i] for i in batch], np.intp)
        log_emission = np.zeros((frames.max(), len(batch), states.max()))
        log_keep, log_leave = np.full((2, len(batch), states.max()), -1.0)
        for u, i in enumerate(batch):
            item, inside = items[i], (slice(frames[u]), u, slice(states[u]))
            streams = {name: stream for name, stream in item.streams.items() if name in weights.active}
            item_leaves = {name: leaves[name][item.triphones] for name in streams}
            log_emission[inside] = hmm.log_density(streams, item_leaves, weights)
            log_keep[inside[1:]], log_leave[inside[1:]] = hmm.log_stay[item.monophones], log_move[item.monophones]
        posterior, stay, log_likelihood = chain_posteriors(log_emission, log_keep, log_leave, frames, states)
        for u, i in enumerate(batch):
            if log_likelihood[u] > LOG_ZERO / 2:
                of_item = posterior[: frames[u], u, : states[u]]
                yield StatePosteriors(usable[i], of_item, stay[u, : states[u]], float(log_likelihood[u]))


class _MixtureAccumulator:
    """The statistics of frames for mixtures, accumulated over many utterances at once: that is faster."""

    def __init__(self, tied: TiedDensities) -> None:
        self._tied, self._statistics = tied, GaussianStatistics.zeros(*tied.mixtures.size)
        self._waiting: list[tuple[Rows, NDArray[np.intp], Rows]] = []

    def add(self, rows: Rows, leaves: NDArray[np.intp], posterior: Rows) -> None:
        """Add an utterance with the leaves [shape=(S,)] and posteriors [shape=(T, S)] of its states."""
        frame, state = np.nonzero(posterior > MIN_MIXTURE_POSTERIOR)
        self._waiting.append((rows[frame], leaves[state], posterior[frame, state]))
        if sum(len(leaves_of_frames) for _, leaves_of_frames, _ in self._waiting) > FRAMES_AT_ONCE:
            self.statistics()

    def statistics(self) -> GaussianStatistics:
        """Return the statistics of all frames so far."""
        if self._waiting:
            rows, leaves, weights = (np.concatenate(arrays) for arrays in zip(*self._waiting, strict=True))
            self._tied.accumulate_components(self._statistics, rows, leaves, weights)
            self._waiting.clear()
        return self._statistics


def accumulate_statistics(
    hmm: JointHmm, utterances: PreparedUtterances, posteriors: Iterator[StatePosteriors] | None = None
) -> StreamStatistics:
    """Return the sufficient statistics of utterances (E-step), with their state posteriors (None: the model's)."""
    triphones = {
        name: GaussianStatistics.zeros(len(utterances.triphones), 1, len(model.scale.mean))
        for name, model in hmm.models.items()
    }
    mixed = {
        name: _MixtureAccumulator(model.tied) for name, model in hmm.models.items() if model.tied.mixtures.size[1] > 1
    }
    stay, occupied, leaf_of = np.zeros(len(hmm.log_stay)), np.zeros(len(hmm.log_stay)), utterances.leaves(hmm)
    log_likelihood, frames = 0.0, 0
    for posterior in iterate_posteriors(hmm, utterances) if posteriors is None else posteriors:
        item = utterances.items[posterior.utterance]
        states = posterior.states.astype(np.float32)
        states[states < MIN_POSTERIOR] = 0
        by_triphone = (states @ item.member).T
        for name, rows in item.streams.items():
            triphones[name].add(item.distinct, by_triphone @ rows)
            if name in mixed:
                mixed[name].add(rows, leaf_of[name][item.triphones], states)
        np.add.at(stay, item.monophones, posterior.stay)
        np.add.at(occupied, item.monophones, posterior.states.sum(axis=0))
        log_likelihood += posterior.log_likelihood
        frames += item.frames
    leaves = {
        name: mixed[name].statistics() if name in mixed else triphones[name].pool(leaf_of[name], model.forest.size)
        for name, model in hmm.models.items()
    }
    return StreamStatistics(triphones, leaves, stay, occupied, log_likelihood, frames)


def reestimate_hmm(hmm: JointHmm, statistics: StreamStatistics) -> JointHmm:
    """Return the models re-estimated from sufficient statistics (the M-step)."""
    floor = hmm.config.variance_floor
    models = {
        name: replace(model, tied=model.tied.reestimate(statistics.leaves[name], floor))
        for name, model in hmm.models.items()
    }
    measured = statistics.stay / np.maximum(statistics.occupied, 1e-9)
    stay = np.where(statistics.occupied > 1, measured, np.exp(hmm.log_stay))
    log_stay = np.log(np.clip(stay, MIN_STAY_PROBABILITY, max_stay_probability(hmm.inventory)))
    return replace(hmm, models=models, log_stay=log_stay)


def max_stay_probability(inventory: Inventory) -> NDArray[np.float64]:
    """Return the largest probability of staying allowed for each state without context [shape=(R,)]."""
    longest = [
        LONGEST_SILENCE_FRAMES if unit in inventory.free else LONGEST_STATE_FRAMES for unit, _ in inventory.monophones
    ]
    return 1 - 1 / np.array(longest)
