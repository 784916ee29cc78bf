"""Embedded Baum–Welch over all streams: what utterances say about every state, and the models that follow from it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.trajectory.joint.densities import Known, Sums
from lipmotion.engines.trajectory.joint.inventory import Inventory, States, states_of
from lipmotion.engines.trajectory.joint.model import JointHmm, Part
from lipmotion.kernels.forward_backward import IMPOSSIBLE, chain_posteriors
from lipmotion.stats.hmm.baum_welch import LONGEST_SILENCE, LONGEST_STATE, batches

LEAST_STAY = 0.05
Streams = Mapping[str, Known]
Leaves = Mapping[str, NDArray[np.intp]]


@dataclass(frozen=True, eq=False)
class Sentence:
    """An utterance in the model's scale, and the states of its units."""

    streams: Streams
    states: States
    frames: int


class Posterior(NamedTuple):
    """What one utterance says of the states of its units.

    sentence : its number
    states   : [shape=(T, S)], the probability of each in every frame
    stay     : [shape=(S,)], how often each was kept
    """

    sentence: int
    states: NDArray[np.float64]
    stay: NDArray[np.float64]
    log_likelihood: float


@dataclass(frozen=True, eq=False)
class Expected:
    """What utterances say about a model (the E-step).

    sums           : by stream, about its leaves
    stay, occupied : [shape=(R,)], how often each state without context was kept, and how many frames it had
    """

    sums: Mapping[str, Sums]
    stay: NDArray[np.float64]
    occupied: NDArray[np.float64]
    log_likelihood: float
    frames: int

    @property
    def mean_log_likelihood(self) -> float:
        """Per frame."""
        return self.log_likelihood / max(self.frames, 1)


def sentence_of(inventory: Inventory, streams: Streams, units: Sequence[str]) -> Sentence:
    """Return an utterance and the states of its units. Raises InputError: an unknown unit."""
    frames = len(next(iter(streams.values())).known)
    return Sentence(streams, states_of(inventory, units), frames)


def posteriors(hmm: JointHmm, sentences: Sequence[Sentence]) -> Iterator[Posterior]:
    """Give the state posteriors of all utterances that have room for their states, not in their order."""
    log_move, weights = hmm.log_move, hmm.config.training
    counts = [len(sentence.states.rows) for sentence in sentences]
    for batch in batches([sentence.frames for sentence in sentences], counts):
        frames = np.array([sentences[i].frames for i in batch], np.intp)
        states = np.array([counts[i] for i in batch], np.intp)
        log_emission = np.zeros((frames.max(), len(batch), states.max()))
        log_keep, log_leave = np.full((2, len(batch), states.max()), -1.0)
        for u, i in enumerate(batch):
            streams = {name: stream for name, stream in sentences[i].streams.items() if name in weights.on}
            chain = sentences[i].states
            leaves = hmm.leaves(chain.contexts, chain.numbers)
            log_emission[: frames[u], u, : states[u]] = hmm.log_density(streams, leaves, weights)
            log_keep[u, : states[u]], log_leave[u, : states[u]] = hmm.log_stay[chain.rows], log_move[chain.rows]
        posterior, stay, log_likelihood = chain_posteriors(log_emission, log_keep, log_leave, frames, states)
        for u, i in enumerate(batch):
            if log_likelihood[u] > IMPOSSIBLE / 2:
                found = posterior[: frames[u], u, : states[u]]
                yield Posterior(i, found, stay[u, : states[u]], float(log_likelihood[u]))


def expect(hmm: JointHmm, sentences: Sequence[Sentence], found: Iterator[Posterior] | None = None) -> Expected:
    """Return what utterances say about every leaf and state.

    found : their posteriors, where they are not the model's own
    """
    sums = {
        name: Sums.none(part.forest.size, *part.tied.mixtures.size[1:]) for name, part in hmm.parts.items()
    }
    stay, occupied = np.zeros(len(hmm.log_stay)), np.zeros(len(hmm.log_stay))
    log_likelihood, frames = 0.0, 0
    for posterior in posteriors(hmm, sentences) if found is None else found:
        sentence = sentences[posterior.sentence]
        leaves = hmm.leaves(sentence.states.contexts, sentence.states.numbers)
        add_all(sums, hmm.parts, sentence, posterior, leaves)
        np.add.at(stay, sentence.states.rows, posterior.stay)
        np.add.at(occupied, sentence.states.rows, posterior.states.sum(axis=0))
        log_likelihood += posterior.log_likelihood
        frames += sentence.frames
    return Expected(sums, stay, occupied, log_likelihood, frames)


def add_all(
    sums: Mapping[str, Sums], parts: Mapping[str, Part], sentence: Sentence, posterior: Posterior, groups: Leaves
) -> None:
    """Add, in place, what one utterance says about groups of its states, by stream [shape=(S,)]."""
    states = posterior.states.astype(np.float32)
    for name, stream in sentence.streams.items():
        used, local = np.unique(groups[name], return_inverse=True)
        member = np.zeros((len(local), len(used)), np.float32)
        member[np.arange(len(local)), local] = 1
        sums[name].add(used, *parts[name].tied.heard(stream, used, states @ member))


def maximised(hmm: JointHmm, expected: Expected) -> JointHmm:
    """Return the models that explain what was found best (the M-step)."""
    floor = hmm.config.variance_floor
    parts = {
        name: replace(part, tied=part.tied.maximised(expected.sums[name], floor)) for name, part in hmm.parts.items()
    }
    return replace(hmm, parts=parts, log_stay=_log_stay(hmm, expected))


def _log_stay(hmm: JointHmm, expected: Expected) -> NDArray[np.float64]:
    kept = expected.stay / np.maximum(expected.occupied, 1e-9)
    keep = np.where(expected.occupied > 1, kept, np.exp(hmm.log_stay))
    return np.log(np.clip(keep, LEAST_STAY, most_stay(hmm.inventory)))


def most_stay(inventory: Inventory) -> NDArray[np.float64]:
    """Return the highest probability that each state without context may be kept with [shape=(R,)]."""
    longest = [LONGEST_SILENCE if unit in inventory.free else LONGEST_STATE for unit, _ in inventory.rows]
    return 1 - 1 / np.array(longest)
