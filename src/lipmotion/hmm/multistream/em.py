"""Embedded Baum–Welch over all streams: what utterances say about every state, and the models that follow from it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.hmm.em import LONGEST_SILENCE, LONGEST_STATE, batches
from lipmotion.hmm.multistream.densities import LEAST_SHARE, Sums, Tied
from lipmotion.hmm.multistream.inventory import Inventory, Place, states_of
from lipmotion.hmm.multistream.model import JointHmm
from lipmotion.hmm.multistream.streams import Observed
from lipmotion.kernels.forward_backward import IMPOSSIBLE, chain_posteriors

LEAST_STAY = 0.05
LEAST_COUNTED = 1e-5
"""State posteriors under this are left out of the statistics of mixtures: nearly all of them are."""
GATHERED = 50_000
"""Frames whose shares in mixtures are counted together."""
Rows = NDArray[np.float32]
Leaves = Mapping[str, NDArray[np.intp]]


@dataclass(frozen=True, eq=False)
class Sentence:
    """An utterance in the model's scale, and the states of its units.

    streams  : from ``Scale.inside``
    states   : [shape=(S,)], the number of each without context
    places   : [shape=(S,)], of each in its context, in ``Sentences.places``
    distinct : those places, each once;  member : [shape=(S, len(distinct))], 1 where a state is in a place, else 0
    """

    streams: Mapping[str, Rows]
    states: NDArray[np.intp]
    places: NDArray[np.intp]
    distinct: NDArray[np.intp]
    member: NDArray[np.float32]
    frames: int

    @property
    def fits(self) -> bool:
        """Whether there is room for all states."""
        return len(self.states) <= self.frames


@dataclass(frozen=True, eq=False)
class Sentences:
    """Utterances, and all different states in context that they have."""

    items: tuple[Sentence, ...]
    places: tuple[Place, ...]

    def leaves(self, hmm: JointHmm) -> Leaves:
        """Return the leaves of all places, by stream."""
        return hmm.leaves(self.places)


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

    places         : by stream, about every state in context (``Sentences.places``), a Gaussian each
    leaves         : by stream, about its leaves
    stay, occupied : [shape=(R,)], how often each state without context was kept, and how many frames it had
    """

    places: Mapping[str, Sums]
    leaves: Mapping[str, Sums]
    stay: NDArray[np.float64]
    occupied: NDArray[np.float64]
    log_likelihood: float
    frames: int

    @property
    def mean_log_likelihood(self) -> float:
        """Per frame."""
        return self.log_likelihood / max(self.frames, 1)


def sentences_of(hmm: JointHmm, utterances: Iterable[tuple[Observed, Sequence[str]]]) -> Sentences:
    """Return utterances in the model's scale, and the states of their units. Raises InputError: an unknown unit."""
    index: dict[Place, int] = {}
    items = []
    for observed, units in utterances:
        states = states_of(hmm.inventory, units)
        places = np.array([index.setdefault(place, len(index)) for place in states.places], np.intp)
        distinct, local = np.unique(places, return_inverse=True)
        member = np.eye(len(distinct), dtype=np.float32)[local]
        streams = {n: hmm.parts[n].scale.inside(stream) for n, stream in observed.streams.items() if n in hmm.parts}
        items.append(Sentence(streams, states.rows, places, distinct, member, observed.frames))
    return Sentences(tuple(items), tuple(index))


def posteriors(hmm: JointHmm, sentences: Sentences) -> Iterator[Posterior]:
    """Give the state posteriors of utterances, not in their order.

    Those without room for their states, or without a stream that is switched on, are left out.
    """
    leaves, log_move, weights = sentences.leaves(hmm), hmm.log_move, hmm.config.training
    usable = [
        i for i, sentence in enumerate(sentences.items) if sentence.fits and set(weights.on) & set(sentence.streams)
    ]
    items = [sentences.items[i] for i in usable]
    counts = [len(sentence.states) for sentence in items]
    for batch in batches([sentence.frames for sentence in items], counts):
        frames = np.array([items[i].frames for i in batch], np.intp)
        states = np.array([counts[i] for i in batch], np.intp)
        log_emission = np.zeros((frames.max(), len(batch), states.max()))
        log_keep, log_leave = np.full((2, len(batch), states.max()), -1.0)
        for u, i in enumerate(batch):
            sentence, inside = items[i], (slice(frames[u]), u, slice(states[u]))
            streams = {name: stream for name, stream in sentence.streams.items() if name in weights.on}
            mine = {name: leaves[name][sentence.places] for name in streams}
            log_emission[inside] = hmm.log_density(streams, mine, weights)
            log_keep[inside[1:]], log_leave[inside[1:]] = hmm.log_stay[sentence.states], log_move[sentence.states]
        posterior, stay, log_likelihood = chain_posteriors(log_emission, log_keep, log_leave, frames, states)
        for u, i in enumerate(batch):
            if log_likelihood[u] > IMPOSSIBLE / 2:
                found = posterior[: frames[u], u, : states[u]]
                yield Posterior(usable[i], found, stay[u, : states[u]], float(log_likelihood[u]))


class _Mixed:
    """What frames say about mixtures, gathered over many utterances: many frames of one mixture at a time are fast."""

    def __init__(self, tied: Tied) -> None:
        self._tied, self._sums = tied, Sums.none(*tied.mixtures.size)
        self._kept: list[tuple[Rows, NDArray[np.intp], Rows]] = []

    def add(self, rows: Rows, leaves: NDArray[np.intp], posterior: Rows) -> None:
        """Add an utterance; posterior of its states [shape=(T, S)]."""
        frame, state = np.nonzero(posterior > LEAST_COUNTED)
        self._kept.append((rows[frame], leaves[state], posterior[frame, state]))
        if sum(len(kept) for _, kept, _ in self._kept) > GATHERED:
            self.all()

    def all(self) -> Sums:
        """Return what all frames so far say."""
        if self._kept:
            rows, leaves, shares = (np.concatenate(each) for each in zip(*self._kept, strict=True))
            self._tied.add_components(self._sums, rows, leaves, shares)
            self._kept.clear()
        return self._sums


def expect(hmm: JointHmm, sentences: Sentences, found: Iterator[Posterior] | None = None) -> Expected:
    """Return what utterances say about every place, every leaf of mixtures, and every state.

    found : their posteriors, where they are not the model's own
    """
    places = {name: Sums.none(len(sentences.places), 1, len(part.scale.mean)) for name, part in hmm.parts.items()}
    mixed = {name: _Mixed(part.tied) for name, part in hmm.parts.items() if part.tied.mixtures.size[1] > 1}
    stay, occupied, which = np.zeros(len(hmm.log_stay)), np.zeros(len(hmm.log_stay)), sentences.leaves(hmm)
    log_likelihood, frames = 0.0, 0
    for posterior in posteriors(hmm, sentences) if found is None else found:
        sentence = sentences.items[posterior.sentence]
        states = posterior.states.astype(np.float32)
        states[states < LEAST_SHARE] = 0
        shares = (states @ sentence.member).T
        for name, rows in sentence.streams.items():
            places[name].add(sentence.distinct, shares @ rows)
            if name in mixed:
                mixed[name].add(rows, which[name][sentence.places], states)
        np.add.at(stay, sentence.states, posterior.stay)
        np.add.at(occupied, sentence.states, posterior.states.sum(axis=0))
        log_likelihood += posterior.log_likelihood
        frames += sentence.frames
    leaves = {
        name: mixed[name].all() if name in mixed else places[name].of_groups(which[name], part.forest.size)
        for name, part in hmm.parts.items()
    }
    return Expected(places, leaves, stay, occupied, log_likelihood, frames)


def maximised(hmm: JointHmm, expected: Expected) -> JointHmm:
    """Return the models that explain what was found best (the M-step)."""
    floor = hmm.config.variance_floor
    parts = {
        name: replace(part, tied=part.tied.maximised(expected.leaves[name], floor)) for name, part in hmm.parts.items()
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
