"""Training of coupled chains: labels in time, Viterbi training, then EM with more and more Gaussians.

Source: Xie & Liu 2007, Appendix A.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.densities import (
    AudioVisualObservations,
    EmissionStatistics,
    Single,
    StreamGroup,
    create_emission_statistics,
    reestimate_group,
)
from lipmotion.engines.coupled.chains.lattice import FactorialProduct, FactorialTransitions, Lattice
from lipmotion.engines.coupled.chains.model import Chains
from lipmotion.engines.coupled.chains.product import (
    COUPLED,
    FACTORIAL,
    HMM,
    Grammar,
    JointState,
    Product,
    Structure,
    Transitions,
    create_transitions,
    find_reachable,
)
from lipmotion.errors import InputError
from lipmotion.hmm.multistream.unit_states import units_to_frames
from lipmotion.stats.bigram import estimate_bigram
from lipmotion.stats.em import EmResult, Sums, no_report, run_em, sum_statistics
from lipmotion.stats.mixture import Mixtures
from lipmotion.storage.archive import NO_CHECKPOINT, Checkpoint
from lipmotion.types import FRAME_RATE_HZ, Timeline, Unit
from lipmotion.units import SILENCE, find_similar_phone

Index = NDArray[np.intp]
SLACK_S = 0.05  # a unit is allowed this long before and after its label
FIRST_SHARE = 0.1
"""Share of the probability of the first unit that is spread over all units, whatever utterances begin with."""


@dataclass(frozen=True, eq=False)
class AlignedUtterance:
    """The observations of an utterance, and its phones in time."""

    observations: AudioVisualObservations
    phones: Timeline[Unit]


def mark_allowed_units(structure: Structure, phones: Timeline[Unit], frames: int) -> NDArray[np.bool_]:
    """Return the units that each frame may belong to [shape=(T, U)]: labelled near it; without a label, silence."""
    names, first = structure.units[0], structure.chains[0]
    allowed = np.zeros((frames, len(names)), bool)
    slack = round(SLACK_S * FRAME_RATE_HZ)
    for unit, start, stop in list_unit_segments(structure, phones, frames):
        allowed[max(start - slack, 0) : stop + slack, unit] = True
    unlabelled = ~allowed.any(axis=1)
    for silence in first.silence:
        allowed[unlabelled, names.index(silence)] = True
    return allowed


def list_unit_segments(structure: Structure, phones: Timeline[Unit], frames: int) -> list[tuple[int, int, int]]:
    """Return the unit of the first chain, the first frame, and the frame after the last, of every non-empty label."""
    names, bounds = units_to_frames(phones, frames, SILENCE)
    units = [structure.units[0].index(structure.chains[0].unit(name)) for name in names]
    return list(zip(units, bounds[:-1].tolist(), bounds[1:].tolist(), strict=True))


def split_evenly(product: Product, phones: Timeline[Unit], frames: int) -> Index:
    """Return the joint states [shape=(T,)] of uniform segmentation: all chains divide every label into equal parts."""
    structure, chains = product.structure, range(len(product.structure.chains))
    number = {joint: index for index, joint in enumerate(product.joint_states)}
    path = np.empty(frames, np.intp)
    for unit, start, stop in list_unit_segments(structure, phones, frames):
        units = tuple(structure.corresponding_units[c][unit] for c in chains)
        for frame in range(start, stop):
            state = (frame - start) * structure.states // (stop - start)
            path[frame] = number[JointState(units, (state,) * len(chains), (False,) * len(chains))]
    return path


def estimate_grammar(structure: Structure, data: Sequence[AlignedUtterance]) -> Grammar:
    """Return the bigrams, and the probabilities of the first unit, of every chain, from labels."""
    segments = (list_unit_segments(structure, each.phones, each.observations.frames) for each in data)
    sentences = [[unit for unit, _, _ in of_utterance] for of_utterance in segments]
    bigrams, initials = [], []
    for units, corresponding in zip(structure.units, structure.corresponding_units, strict=True):
        chain_sentences = [[units[corresponding[unit]] for unit in sentence] for sentence in sentences]
        bigrams.append(np.exp(estimate_bigram(units, chain_sentences).log_probability.astype(float)))
        initial = np.full(len(units), FIRST_SHARE / len(units))
        for sentence in chain_sentences:
            initial[units.index(sentence[0])] += (1 - FIRST_SHARE) / len(chain_sentences)
        initials.append(initial)
    return Grammar(tuple(bigrams), tuple(initials))


SHARD = 16  # utterances of a shard of the E-step
MIN_DENSITY_FRAMES = 3.0  # a density with less data than so many frames stays as it is
FLOOR_SHARE, MIN_VARIANCE = 0.01, 1e-4
"""No variance falls under this share of the stream's own variance, or under this least variance."""


@dataclass(frozen=True, eq=False)
class LatticeUtterance:
    """The observations of an utterance, the joint states that it may be in, and how often it counts."""

    observations: AudioVisualObservations
    lattice: Lattice
    weight: float = 1.0


def build_lattice_utterance(chains: Chains, utterance: AlignedUtterance, weight: float = 1.0) -> LatticeUtterance:
    """Return an utterance, which counts ``weight`` times, with the joint states that its phone labels allow."""
    allowed = mark_allowed_units(chains.structure, utterance.phones, utterance.observations.frames)
    return LatticeUtterance(utterance.observations, chains.lattice(allowed), weight)


@dataclass(frozen=True, eq=False)
class ChainStatistics:
    """Sufficient statistics of chains, accumulated over utterances by their weights.

    transition_counts : of the transitions [shape=(C,)]
    log_likelihood, frames : of the utterances that have a path through the chains
    """

    emissions: tuple[EmissionStatistics, ...]
    transition_counts: NDArray[np.float64]
    log_likelihood: float
    frames: float

    @property
    def mean_log_likelihood(self) -> float:
        """Log likelihood per frame."""
        return self.log_likelihood / self.frames


def e_step(chains: Chains, utterances: Sequence[LatticeUtterance], work: Checkpoint = NO_CHECKPOINT) -> ChainStatistics:
    """Return the sufficient statistics of utterances, whoever computes them. Raises InputError: none has a path."""
    shards = [utterances[start : start + SHARD] for start in range(0, len(utterances), SHARD)]
    sums = sum_statistics(_shard_sums, chains, shards, work)
    if not sums or not sums["frames"]:
        raise InputError(f"none of {len(utterances)} recordings has a path through the chains; check their labels")
    emissions = []
    for number, group in enumerate(chains.groups):
        products = tuple(sums[f"products {number} {stream}"] for stream in group.streams)
        emissions.append(EmissionStatistics(products, sums[f"occupancy {number}"]))
    return ChainStatistics(tuple(emissions), sums["transitions"], float(sums["log likelihood"]), float(sums["frames"]))


def m_step(
    chains: Chains,
    statistics: ChainStatistics,
    floors: Sequence[Single],
    *,
    streams: Sequence[int],
    transitions: bool = True,
) -> Chains:
    """Return the chains that maximise the expected log likelihood, with variances of ``floors`` at least."""
    groups = [
        reestimate_group(group, own, [floors[s] for s in group.streams], MIN_DENSITY_FRAMES, streams)
        if set(group.streams) & set(streams)
        else group
        for group, own in zip(chains.groups, statistics.emissions, strict=True)
    ]
    chains = replace(chains, groups=tuple(groups))
    if not transitions:
        return chains
    return replace(chains, transitions=chains.transitions.reestimated(statistics.transition_counts))


def compute_variance_floors(observations: Sequence[AudioVisualObservations]) -> tuple[Single, ...]:
    """Return the least variance of every stream [each shape=(D_s,)], from its variance where it was observed."""
    floors = []
    for stream in range(len(observations[0].streams)):
        pairs = ((utterance.streams[stream], utterance.observed[stream]) for utterance in observations)
        rows = [values if mask is None else values[mask] for values, mask in pairs]
        floors.append(np.maximum(FLOOR_SHARE * np.concatenate(rows).var(axis=0), MIN_VARIANCE).astype(np.float32))
    return tuple(floors)


def _shard_sums(job: tuple[Chains, Sequence[LatticeUtterance]]) -> Sums:
    chains, utterances = job
    emission_statistics = tuple(create_emission_statistics(group) for group in chains.groups)
    transition_counts = np.zeros(chains.transitions.statistic_count)
    log_likelihood, frames = 0.0, 0.0
    for utterance in utterances:
        observations, lattice, weight = utterance.observations, utterance.lattice, utterance.weight
        inference = chains.infer(observations, lattice)
        posteriors, shares = inference.posteriors, inference.responsibilities
        if not np.isfinite(posteriors.log_likelihood):
            continue
        of_groups = emission_statistics, chains.groups, lattice.densities, posteriors.densities, shares
        for statistics, group, densities, posterior, responsibilities in zip(*of_groups, strict=True):
            weighted = posterior if weight == 1 else posterior * np.float32(weight)
            statistics.accumulate(group, observations, densities, weighted, responsibilities)
        transition_counts[lattice.transition_index] += weight * posteriors.transition_counts
        log_likelihood += weight * posteriors.log_likelihood
        frames += weight * observations.frames
    sums = {"transitions": transition_counts, "log likelihood": np.array(log_likelihood), "frames": np.array(frames)}
    for number, (group, statistics) in enumerate(zip(chains.groups, emission_statistics, strict=True)):
        products = zip(group.streams, statistics.products, strict=True)
        sums |= {f"products {number} {stream}": array for stream, array in products}
        sums[f"occupancy {number}"] = statistics.occupancy
    return sums


MIN_FRAMES = 10  # a joint state with at least so many frames in training has densities of its own


def with_joint_state_densities(
    chains: Chains, transitions: Transitions, visits: NDArray[Any], structure: Structure
) -> Chains:
    """Return two chains whose frequent joint states have emission densities of their own.

    transitions : of the chains, with a limit of asynchrony
    visits      : frames spent in each joint state [shape=(S,)]
    structure   : of the returned chains: that of ``chains``, or the same without a limit of asynchrony
    """
    product = transitions.product
    frequent = np.unique(product.chain_states[:, visits >= MIN_FRAMES].T, axis=0)
    new_transitions: Transitions | FactorialTransitions = transitions
    chain_states = product.chain_states
    if structure.limit is None:  # independent chains move on with the mean probability of joint states
        first, second = (
            np.bincount(states, advance[rows], count) / np.maximum(np.bincount(states, minlength=count), 1)
            for states, advance, rows, count in zip(
                chain_states, transitions.advance, transitions.rows, structure.state_counts, strict=True
            )
        )
        new_product = FactorialProduct(structure, product.grammar)
        chain_states = new_product.chain_states
        new_transitions = FactorialTransitions(new_product, (first, second), frequent)
    number = np.full(structure.state_counts, -1)
    number[tuple(frequent.T)] = np.arange(len(frequent))
    frequent_number = number[chain_states[0], chain_states[1]]
    groups = []
    for group in chains.groups:
        chain = structure.chain_of(group.streams[0])
        mixtures = group.mixtures.concatenate(group.mixtures.select(frequent[:, chain]))
        tie = np.where(frequent_number >= 0, structure.state_counts[chain] + frequent_number, chain_states[chain])
        groups.append(replace(group, mixtures=mixtures, tie=tie))
    return Chains(chains.streams, new_transitions, tuple(groups))


VITERBI_STEPS = 2


def create_chains(
    structure: Structure,
    streams: tuple[str, ...],
    data: Sequence[AlignedUtterance],
    weights: Sequence[float],
    floors: Sequence[Single],
) -> Chains:
    """Return chains with one Gaussian for each density, learned by Viterbi training.

    floors  : the least variance of each stream [each shape=(D_s,)]
    A structure without a limit of asynchrony has one, ``start_limit``, during the Viterbi training.
    """
    limited = structure
    if structure.limit is None:
        limited = replace(structure, limit=min(structure.start_limit, structure.states - 1))
    transitions = create_transitions(find_reachable(limited, estimate_grammar(limited, data)))
    groups, numbers = [], tuple(range(len(streams)))
    dimensions = [stream.shape[1] for stream in data[0].observations.streams]
    for members in [numbers] if structure.kind == HMM else [(stream,) for stream in numbers]:
        edges = np.cumsum([0, *(dimensions[s] for s in members)]).tolist()
        chain = structure.chain_of(members[0])
        shape = (structure.state_counts[chain], 1, edges[-1])
        normal = Mixtures(np.zeros(shape[:2], np.float32), np.zeros(shape, np.float32), np.ones(shape, np.float32))
        columns, exponents = tuple(slice(a, b) for a, b in pairwise(edges)), tuple(weights[s] for s in members)
        groups.append(StreamGroup(members, columns, normal, exponents, transitions.product.chain_states[chain]))
    chains = Chains(streams, transitions, tuple(groups))
    utterances = [build_lattice_utterance(chains, utterance) for utterance in data]
    paths = [split_evenly(transitions.product, utterance.phones, utterance.observations.frames) for utterance in data]
    for _ in range(1 + VITERBI_STEPS):
        chains, transitions = _reestimate_along(chains, transitions, utterances, paths, floors)
        paths = [chains.best_path(utterance.observations, utterance.lattice)[0] for utterance in utterances]
    visits = np.bincount(np.concatenate(paths), minlength=len(transitions.product.joint_states))
    if structure.kind == COUPLED:
        return replace(chains, transitions=transitions.tied(visits))
    if structure.kind == FACTORIAL and len(structure.chains) == 2:
        return with_joint_state_densities(chains, transitions, visits, structure)
    return chains


def _reestimate_along(
    chains: Chains,
    transitions: Transitions,
    utterances: Sequence[LatticeUtterance],
    paths: Sequence[Index],
    floors: Sequence[Single],
) -> tuple[Chains, Transitions]:
    """Return the chains, and their transitions, that are most likely along paths of joint states [each shape=(T,)]."""
    emission_statistics = []
    for group in chains.groups:
        statistics = create_emission_statistics(group)
        for utterance, path in zip(utterances, paths, strict=True):
            densities, column = np.unique(group.tie[path], return_inverse=True)
            posterior = np.eye(len(densities), dtype=np.float32)[column]
            statistics.accumulate(group, utterance.observations, densities, posterior, None)
        emission_statistics.append(statistics)
    count = len(transitions.product.joint_states)
    keys = transitions.product.arc_to * count + transitions.product.arc_from
    steps = np.concatenate([path[1:] * count + path[:-1] for path in paths])
    positions = np.minimum(np.searchsorted(keys, steps), len(keys) - 1)
    arc_counts = np.bincount(positions[keys[positions] == steps], minlength=len(keys)).astype(float)
    statistics_of_paths = ChainStatistics(tuple(emission_statistics), arc_counts, 0.0, 1)
    chains = m_step(chains, statistics_of_paths, floors, streams=range(len(chains.streams)), transitions=False)
    transitions = transitions.reestimated(arc_counts)
    groups = []
    for group, statistics in zip(chains.groups, emission_statistics, strict=True):
        groups.append(_with_borrowed_densities(group, statistics.occupancy.sum(axis=0) > 0, chains.structure))
    return replace(chains, transitions=transitions, groups=tuple(groups)), transitions


def _with_borrowed_densities(group: StreamGroup, learned: NDArray[np.bool_], structure: Structure) -> StreamGroup:
    """Return the group in which states that were not ``learned`` have the densities of the most similar unit."""
    chain = structure.chain_of(group.streams[0])
    units, unit_set = structure.units[chain], structure.chains[chain]
    source = np.arange(len(learned))
    for state in np.flatnonzero(~learned):
        unit, position = divmod(int(state), structure.states)
        phones = [
            phone
            for number, name in enumerate(units)
            if learned[number * structure.states + position]
            for phone in unit_set.phones(name)
        ]
        if phones:
            similar = unit_set.unit(find_similar_phone(unit_set.phones(units[unit])[0], phones))
            source[state] = units.index(similar) * structure.states + position
    return replace(group, mixtures=group.mixtures.select(source))


FRAMES_A_GAUSSIAN = 25.0  # a density is split if it has so many frames for each Gaussian that it would have
CONVERGENCE_GAIN = 0.02  # EM ends when the log likelihood per frame gains less


Report = Callable[[int, Chains, ChainStatistics], None]
"""Called after every step of EM with its number, the new chains, and the statistics that they were estimated from."""
MAX_STEPS = 6  # greatest number of EM steps between one splitting and the next


def grow_chains(  # noqa: PLR0913
    structure: Structure,
    streams: tuple[str, ...],
    data: Sequence[AlignedUtterance],
    mixtures: Sequence[int],
    weights: Sequence[float],
    report: Report = no_report,
    work: Checkpoint = NO_CHECKPOINT,
    start: Chains | None = None,
) -> Iterator[EmResult[Chains, ChainStatistics]]:
    """Yield results of EM, started by Viterbi training: chains with 1, 2, 4, … Gaussians, each to convergence.

    streams  : the names of the streams
    mixtures : Gaussians per density of each stream group in the end, powers of two
    weights  : the exponent of each stream's density
    report   : while the number of components stays, the log likelihood never falls
    start    : chains that were yielded for the same data, from whose Gaussians others are split; None: begin
    Source: Xie & Liu 2007, §3.4 and Appendix A, with scaled recursions.
    """
    floors = compute_variance_floors([utterance.observations for utterance in data])
    chains, steps = start or create_chains(structure, streams, data, weights, floors), 1 if start else MAX_STEPS
    utterances = [build_lattice_utterance(chains, utterance) for utterance in data]
    while True:
        result = train_to_convergence(chains, utterances, floors, steps, report, work)
        if steps == MAX_STEPS:
            yield result
        if all(count >= most for count, most in zip(count_components(result.model), mixtures, strict=True)):
            return
        chains, steps = with_split_components(result.model, mixtures, result.statistics), MAX_STEPS


def train_to_convergence(
    chains: Chains,
    utterances: Sequence[LatticeUtterance],
    floors: Sequence[Single],
    max_steps: int,
    report: Report,
    work: Checkpoint,
    *,
    speech_only: bool = False,
) -> EmResult[Chains, ChainStatistics]:
    """Return the result of EM with a fixed number of components; ``speech_only``: only densities of speech change."""
    streams = range(1 if speech_only else len(chains.streams))
    return run_em(
        chains,
        lambda chains: e_step(chains, utterances, work),
        lambda chains, statistics: m_step(chains, statistics, floors, streams=streams, transitions=not speech_only),
        max_steps,
        report,
        min_gain=CONVERGENCE_GAIN,
    )


def count_components(chains: Chains) -> tuple[int, ...]:
    """Return the number of Gaussians per density of each stream group."""
    return tuple(group.mixtures.size[1] for group in chains.groups)


def with_split_components(chains: Chains, mixtures: Sequence[int], statistics: ChainStatistics) -> Chains:
    """Return chains with twice as many Gaussians in the densities of those groups that have fewer than ``mixtures``.

    statistics : of the last E-step; a density with too little data keeps its components, the new ones are switched off
    """
    groups = list(chains.groups)
    for number, (group, own, count) in enumerate(zip(chains.groups, statistics.emissions, mixtures, strict=True)):
        present, now = group.mixtures, group.mixtures.size[1]
        if now < count:
            halves = present.split()
            few = own.occupancy.sum(axis=0) < FRAMES_A_GAUSSIAN * 2 * np.isfinite(present.log_weights).sum(axis=1)
            halves.log_weights[few, :now] = present.log_weights[few]
            halves.means[few, :now] = present.means[few]
            halves.log_weights[few, now:] = -np.inf
            groups[number] = replace(group, mixtures=halves)
    return replace(chains, groups=tuple(groups))
