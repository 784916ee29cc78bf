"""Learning coupled chains from speech with its motion."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.densities import Group, Observed, Single, no_sums
from lipmotion.engines.coupled.chains.joint_densities import with_pairs
from lipmotion.engines.coupled.chains.model import Chains
from lipmotion.engines.coupled.chains.product import Grammar, Joint, Product, reachable
from lipmotion.engines.coupled.chains.structures import COUPLED, FACTORIAL, HMM, Structure
from lipmotion.engines.coupled.chains.transitions import Transitions, first_transitions
from lipmotion.engines.coupled.training.expectation import Expected, Recording, expected, maximised
from lipmotion.hmm.multistream.labels import units_in_frames
from lipmotion.stats.bigram import estimate_bigram
from lipmotion.stats.mixture import Mixtures
from lipmotion.types import FRAME_RATE_HZ, Timeline, Unit
from lipmotion.units import SILENCE, most_similar_phone

Index = NDArray[np.intp]

SLACK_S = 0.05
"""A phone may be said this long before and after its label."""
FLOOR_SHARE, LEAST_VARIANCE = 0.01, 1e-4
"""No variance falls under this share of the stream's own."""
VITERBI_STEPS = 2
FRAMES_A_GAUSSIAN = 25.0
"""A density is split if it has so many frames for each Gaussian that it would have."""
FIRST_SHARE = 0.1
"""Of the probability of how recordings begin: shared by all units, said first or not."""
CONVERGED = 0.02
"""Of the log likelihood a frame: less is no progress."""


@dataclass(frozen=True, eq=False)
class Labelled:
    """Observed streams, and the phones with them."""

    observed: Observed
    phones: Timeline[Unit]


@dataclass(frozen=True)
class Step:
    """One step of training: components per density of speech and of the rest, and the mean log likelihood a frame."""

    mixtures: tuple[int, ...]
    log_likelihood: float


@dataclass(frozen=True)
class Schedule:
    """How training goes on.

    mixtures : Gaussians per density of each group, powers of two
    weights  : exponents of the streams
    most     : steps of EM between one splitting and the next, at most
    """

    mixtures: tuple[int, ...]
    weights: tuple[float, ...]
    most: int = 6


def train_chains(
    structure: Structure,
    streams: tuple[str, ...],
    data: Sequence[Labelled],
    how: Schedule,
    heard: Callable[[Step], None] = lambda _: None,
    workers: int = 1,
) -> Chains:
    """Return chains learned by EM, from the labels' times and the best paths between them.

    heard : is told every step; within a number of components the log likelihood never falls
    Source: Xie & Liu 2007, §3.4 and Appendix A, with scaled recursions.
    """
    return deque(growing_chains(structure, streams, data, how, heard, workers), maxlen=1)[0]


def growing_chains(
    structure: Structure,
    streams: tuple[str, ...],
    data: Sequence[Labelled],
    how: Schedule,
    heard: Callable[[Step], None] = lambda _: None,
    workers: int = 1,
) -> Iterator[Chains]:
    """Give the chains that ``train_chains`` learns with 1, 2, 4, … Gaussians: each as if those were all."""
    floors = variance_floors([one.observed for one in data])
    chains = _viterbi_start(structure, streams, data, how, floors)
    recordings = [recording(chains, one) for one in data]
    while True:
        chains, said = converged(chains, recordings, floors, how.most, heard, workers)
        yield chains
        now = components(chains)
        if all(n >= most for n, most in zip(now, how.mixtures, strict=True)):
            return
        chains = split(chains, how.mixtures, said)


def _viterbi_start(
    structure: Structure,
    streams: tuple[str, ...],
    data: Sequence[Labelled],
    how: Schedule,
    floors: Sequence[Single],
) -> Chains:
    """Return chains learned along the labels, then along best paths; without a limit they begin with one."""
    first = replace(structure, limit=min(1, structure.states - 1)) if structure.limit is None else structure
    transitions = first_transitions(reachable(first, grammar_of(first, data)))
    chains = _flat_start(streams, transitions, data, how)
    recordings = [recording(chains, one) for one in data]
    paths = [labelled_path(transitions.product, one.phones, one.observed.frames) for one in data]
    for _ in range(1 + VITERBI_STEPS):
        chains, transitions = _learned_along(chains, transitions, recordings, paths, floors)
        paths = [_best(chains, one) for one in recordings]
    visits = np.bincount(np.concatenate(paths), minlength=len(transitions.product.joints))
    if structure.kind == COUPLED:
        return replace(chains, transitions=transitions.tied(visits))
    if structure.kind == FACTORIAL and len(structure.chains) == 2:
        return with_pairs(chains, transitions, visits, structure)
    return chains


def recording(chains: Chains, one: Labelled, weight: float = 1.0) -> Recording:
    """Return what was observed with the part of the chains that its labels allow.

    weight : how often it counts
    """
    allowed = allowed_units(chains.structure, one.phones, one.observed.frames)
    return Recording(one.observed, chains.lattice(allowed), weight)


def components(chains: Chains) -> tuple[int, ...]:
    """Return how many Gaussians a density of each group has."""
    return tuple(group.mixtures.size[1] for group in chains.groups)


def split(chains: Chains, most: Sequence[int], said: Expected) -> Chains:
    """Return chains with twice as many Gaussians in the densities of those groups that have fewer than ``most``.

    said : by the recordings; a density with too little data keeps what it has, the new halves are switched off
    """
    groups = [
        replace(group, mixtures=_split(group.mixtures, sums.count)) if now < target else group
        for group, sums, now, target in zip(chains.groups, said.groups, components(chains), most, strict=True)
    ]
    return replace(chains, groups=tuple(groups))


def _split(mixtures: Mixtures, count: NDArray[np.float64]) -> Mixtures:
    """Return twice as many components; ``count`` are the frames of each now [shape=(M, G)]."""
    halves, now = mixtures.split(), mixtures.log_weights.shape[1]
    few = count.sum(axis=0) < FRAMES_A_GAUSSIAN * 2 * np.isfinite(mixtures.log_weights).sum(axis=1)
    halves.log_weights[few, :now] = mixtures.log_weights[few]
    halves.means[few, :now] = mixtures.means[few]
    halves.log_weights[few, now:] = -np.inf
    return halves


def allowed_units(structure: Structure, phones: Timeline[Unit], frames: int) -> NDArray[np.bool_]:
    """Return which units of the first chain may be said in each frame [shape=(T, U)]: those labelled near it.

    Between labels, silence may be.
    """
    names, first = structure.units[0], structure.chains[0]
    allowed = np.zeros((frames, len(names)), bool)
    slack = round(SLACK_S * FRAME_RATE_HZ)
    for unit, start, stop in frame_labels(structure, phones, frames):
        allowed[max(start - slack, 0) : stop + slack, unit] = True
    bare = ~allowed.any(axis=1)
    for silence in first.silence:
        allowed[bare, names.index(silence)] = True
    return allowed


def frame_labels(structure: Structure, phones: Timeline[Unit], frames: int) -> list[tuple[int, int, int]]:
    """Return the unit of the first chain, the first frame and the end of every label that has a frame."""
    names, bounds = units_in_frames(phones, frames, SILENCE)
    units = [structure.units[0].index(structure.chains[0].unit(name)) for name in names]
    return list(zip(units, bounds[:-1].tolist(), bounds[1:].tolist(), strict=True))


def labelled_path(product: Product, phones: Timeline[Unit], frames: int) -> Index:
    """Return joint states [shape=(T,)] of chains that all cut every label into equal parts."""
    structure, chains = product.structure, range(len(product.structure.chains))
    number = {joint: index for index, joint in enumerate(product.joints)}
    path = np.empty(frames, np.intp)
    for unit, start, stop in frame_labels(structure, phones, frames):
        units = tuple(structure.follows[c][unit] for c in chains)
        for frame in range(start, stop):
            state = (frame - start) * structure.states // (stop - start)
            path[frame] = number[Joint(units, (state,) * len(chains), (False,) * len(chains))]
    return path


def _flat_start(streams: tuple[str, ...], transitions: Transitions, data: Sequence[Labelled], how: Schedule) -> Chains:
    """Return chains that know which units follow which, and nothing of what they emit."""
    product, structure, groups = transitions.product, transitions.product.structure, []
    together = [tuple(range(len(streams)))] if structure.kind == HMM else [(s,) for s in range(len(streams))]
    dimensions = [stream.shape[1] for stream in data[0].observed.streams]
    for members in together:
        edges = np.cumsum([0, *(dimensions[s] for s in members)])
        chain = structure.chain_of(members[0])
        groups.append(
            Group(
                members,
                tuple(slice(a, b) for a, b in pairwise(edges.tolist())),
                _unknown(structure.counts[chain], int(edges[-1])),
                tuple(how.weights[s] for s in members),
                product.chain_states[chain],
            )
        )
    return Chains(streams, transitions, tuple(groups))


def grammar_of(structure: Structure, data: Sequence[Labelled]) -> Grammar:
    """Return which units follow which in some labels, in every chain."""
    said = [[unit for unit, _, _ in _labels(structure, one)] for one in data]
    bigrams, firsts = [], []
    for units, follows in zip(structure.units, structure.follows, strict=True):
        sentences = [[units[follows[unit]] for unit in sentence] for sentence in said]
        bigrams.append(np.exp(estimate_bigram(units, sentences).log_probability.astype(float)))
        first = np.full(len(units), FIRST_SHARE / len(units))
        for sentence in sentences:
            first[units.index(sentence[0])] += (1 - FIRST_SHARE) / len(sentences)
        firsts.append(first)
    return Grammar(tuple(bigrams), tuple(firsts))


def _labels(structure: Structure, one: Labelled) -> list[tuple[int, int, int]]:
    return frame_labels(structure, one.phones, one.observed.frames)


def _unknown(count: int, size: int) -> Mixtures:
    shape = (count, 1, size)
    return Mixtures(np.zeros((count, 1), np.float32), np.zeros(shape, np.float32), np.ones(shape, np.float32))


def variance_floors(observed: Sequence[Observed]) -> tuple[Single, ...]:
    """Return the least variance of every stream [each shape=(D_s,)], by its variance where it was seen."""
    floors = []
    for stream in range(len(observed[0].streams)):
        masks = [one.seen[stream] for one in observed]
        rows = [
            one.streams[stream] if mask is None else one.streams[stream][mask]
            for one, mask in zip(observed, masks, strict=True)
        ]
        floors.append(np.maximum(FLOOR_SHARE * np.concatenate(rows).var(axis=0), LEAST_VARIANCE).astype(np.float32))
    return tuple(floors)


def _learned_along(
    chains: Chains,
    transitions: Transitions,
    recordings: Sequence[Recording],
    paths: Sequence[Index],
    floors: Sequence[Single],
) -> tuple[Chains, Transitions]:
    """Return chains, and their transitions, that explain best what was observed along paths of joint states."""
    groups = []
    for group in chains.groups:
        sums = no_sums(group)
        for one, path in zip(recordings, paths, strict=True):
            chosen, place = np.unique(group.tie[path], return_inverse=True)
            sums.add(group, one.observed, chosen, np.eye(len(chosen), dtype=np.float32)[place], None)
        groups.append(sums)
    followed = _followed(transitions.product, paths)
    said = Expected(tuple(groups), followed, 0.0, 1)
    chains = maximised(chains, said, floors, streams=range(len(chains.streams)), moves=False)
    transitions = transitions.relearned(followed)
    structure = chains.structure
    learned = replace(
        chains,
        transitions=transitions,
        groups=tuple(
            _borrowed(group, sums.count.sum(axis=0) > 0, structure, structure.chain_of(group.streams[0]))
            for group, sums in zip(chains.groups, groups, strict=True)
        ),
    )
    return learned, transitions


def _borrowed(group: Group, known: NDArray[np.bool_], structure: Structure, chain: int) -> Group:
    """Return the group with densities for states never seen: those of the unit that is most like theirs.

    known : whether each density was learned [shape=(G,)]
    """
    units, of = structure.units[chain], structure.chains[chain]
    source = np.arange(len(known))
    for state in np.flatnonzero(~known):
        unit, place = divmod(int(state), structure.states)
        phones = [
            phone for i, name in enumerate(units) if known[structure.state(i, place)] for phone in of.phones(name)
        ]
        if phones:
            alike = of.unit(most_similar_phone(of.phones(units[unit])[0], phones))
            source[state] = structure.state(units.index(alike), place)
    return replace(group, mixtures=group.mixtures.picked(source))


def _best(chains: Chains, recording: Recording) -> Index:
    return chains.best_path(chains.evidence(recording.observed, recording.lattice), recording.lattice)[0]


def _followed(product: Product, paths: Sequence[Index]) -> NDArray[np.float64]:
    """Return how often each arc is followed; jumps without one do not count."""
    count = len(product.joints)
    keys = product.arc_to * count + product.arc_from
    jumps = np.concatenate([path[1:] * count + path[:-1] for path in paths])
    places = np.minimum(np.searchsorted(keys, jumps), len(keys) - 1)
    return np.bincount(places[keys[places] == jumps], minlength=len(keys)).astype(float)


def converged(
    chains: Chains,
    recordings: Sequence[Recording],
    floors: Sequence[Single],
    most: int,
    heard: Callable[[Step], None],
    workers: int,
    *,
    speech_only: bool = False,
) -> tuple[Chains, Expected]:
    """Return chains after EM, and what recordings said of those before its last step.

    most : steps, fewer if they do not get on;  speech_only : learn the densities of speech, and keep all else
    """
    streams = range(1 if speech_only else len(chains.streams))
    last = -np.inf
    for _ in range(most):
        said = expected(chains, recordings, workers)
        figure = said.log_likelihood / said.frames
        heard(Step(components(chains), figure))
        chains = maximised(chains, said, floors, streams=streams, moves=not speech_only)
        if figure - last < CONVERGED:
            break
        last = figure
    return chains, said
