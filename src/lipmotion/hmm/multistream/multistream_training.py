"""Training of joint models: embedded Baum–Welch over all streams, from a flat start or known times to tied states."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import CorpusError, InputError
from lipmotion.hmm.multistream.densities import (
    F0_STREAMS,
    MIN_POSTERIOR,
    MOTION,
    SPEECH,
    SPLIT_FRAMES,
    STREAMS,
    GaussianStatistics,
    StreamObservations,
    fit_scale,
    make_standard_normals,
)
from lipmotion.hmm.multistream.model import (
    JointConfig,
    JointHmm,
    StreamModel,
    build_unit_forest,
    grow_forest,
    list_context_questions,
)
from lipmotion.hmm.multistream.unit_states import Inventory, TriphoneState, expand_triphones
from lipmotion.hmm.unit_training import MIN_STAY_PROBABILITY, StatePosteriors, group_by_length, infer_chains, limit_stay
from lipmotion.kernels.forward_backward import LOG_ZERO
from lipmotion.stats.bigram import estimate_bigram
from lipmotion.stats.em import Sums, run_em, sum_statistics
from lipmotion.stats.trees import Question
from lipmotion.storage.archive import NO_CHECKPOINT, Checkpoint
from lipmotion.types import Monitor, Progress, silent_monitor, sub_monitor

MIN_MIXTURE_POSTERIOR = 1e-5
"""Smaller state posteriors are left out of the statistics of mixtures; nearly all posteriors are smaller."""
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


@dataclass(frozen=True, eq=False)
class StreamStatistics:
    """The sufficient statistics of utterances for the models of all streams (the result of the E-step).

    densities : by stream, of its leaves, for all their Gaussians, or of every state in context
                (``PreparedUtterances.triphones``), for one Gaussian each
    stay, occupied : [shape=(R,)], expected transitions of each state without context to itself, and its frames
    """

    densities: Mapping[str, GaussianStatistics]
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


def infer_batches(
    hmm: JointHmm, leaves: Leaves, items: Sequence[PreparedUtterance]
) -> Iterator[tuple[PreparedUtterance, StatePosteriors]]:
    """Give utterances with the posteriors of their states; those without a path are left out."""
    if not items:
        return
    weights, log_emissions = hmm.config.training, []
    for item in items:
        streams = {name: stream for name, stream in item.streams.items() if name in weights.active}
        item_leaves = {name: leaves[name][item.triphones] for name in streams}
        log_emissions.append(hmm.log_density(streams, item_leaves, weights))
    found = infer_chains(log_emissions, [hmm.log_stay[item.monophones] for item in items])
    yield from (pair for pair in zip(items, found, strict=True) if pair[1].log_likelihood > LOG_ZERO / 2)


class _Accounts(NamedTuple):
    """Models, the leaves of all states in context, and whether statistics are those of these states, not of leaves."""

    hmm: JointHmm
    leaves: Leaves
    by_triphone: bool


def accumulate_statistics(
    hmm: JointHmm, utterances: PreparedUtterances, work: Checkpoint = NO_CHECKPOINT, *, by_triphone: bool = False
) -> StreamStatistics:
    """Return the sufficient statistics of utterances (E-step), of leaves or of every state in context.

    Utterances that are too short, or without an active stream, are left out.
    """
    active = set(hmm.config.training.active)
    usable = [item for item in utterances.items if item.fits and active & set(item.streams)]
    batches = group_by_length([item.frames for item in usable], [len(item.monophones) for item in usable])
    shards = [[usable[i] for i in batch] for batch in batches] or [[]]
    accounts = _Accounts(hmm, hmm.leaves(utterances.triphones), by_triphone)
    return _statistics(hmm, sum_statistics(_shard_sums, accounts, shards, work))


def _shard_sums(job: tuple[_Accounts, Sequence[PreparedUtterance]]) -> Sums:
    accounts, items = job
    return _add_up(accounts, infer_batches(accounts.hmm, accounts.leaves, items))


def _add_up(accounts: _Accounts, posteriors: Iterable[tuple[PreparedUtterance, StatePosteriors]]) -> Sums:
    """Return the statistics of utterances with the posteriors of their states."""
    hmm, leaves, by_triphone = accounts
    statistics = dict[str, GaussianStatistics]()
    waiting = defaultdict[str, list[tuple[Rows, NDArray[np.intp], Rows]]](list)
    for name, model in hmm.models.items():
        count, components, dimensions = model.tied.mixtures.size
        statistics[name] = GaussianStatistics.zeros(len(leaves[name]) if by_triphone else count, components, dimensions)
    stay, occupied = np.zeros((2, len(hmm.log_stay)))
    log_likelihood, frames = 0.0, 0
    for item, posterior in posteriors:
        states = posterior.states.astype(np.float32)
        states[states < MIN_POSTERIOR] = 0
        by_state = (states @ item.member).T
        for name, rows in item.streams.items():
            if hmm.models[name].tied.mixtures.size[1] > 1:
                frame, state = np.nonzero(states > MIN_MIXTURE_POSTERIOR)
                waiting[name].append((rows[frame], leaves[name][item.triphones][state], states[frame, state]))
            else:
                densities = item.distinct if by_triphone else leaves[name][item.distinct]
                statistics[name].add(densities, by_state @ rows)
        np.add.at(stay, item.monophones, posterior.stay)
        np.add.at(occupied, item.monophones, posterior.states.sum(axis=0))
        log_likelihood += posterior.log_likelihood
        frames += item.frames
    for name, pairs in waiting.items():  # of many utterances at once: that is faster
        arrays = (np.concatenate(each) for each in zip(*pairs, strict=True))
        hmm.models[name].tied.accumulate_components(statistics[name], *arrays)
    sums = {"stay": stay, "occupied": occupied, "log likelihood": np.array(log_likelihood), "frames": np.array(frames)}
    for name, each in statistics.items():
        sums |= {f"{name} frames": each.frames, f"{name} moments": each.moments}
    return sums


def _statistics(hmm: JointHmm, sums: Sums) -> StreamStatistics:
    densities = {name: GaussianStatistics(sums[f"{name} frames"], sums[f"{name} moments"]) for name in hmm.models}
    total = float(sums["log likelihood"]), int(sums["frames"])
    return StreamStatistics(densities, sums["stay"], sums["occupied"], *total)


def reestimate_hmm(hmm: JointHmm, statistics: StreamStatistics) -> JointHmm:
    """Return the models re-estimated from sufficient statistics (the M-step)."""
    floor = hmm.config.variance_floor
    models = {
        name: replace(model, tied=model.tied.reestimate(statistics.densities[name], floor))
        for name, model in hmm.models.items()
    }
    measured = statistics.stay / np.maximum(statistics.occupied, 1e-9)
    stay = np.where(statistics.occupied > 1, measured, np.exp(hmm.log_stay))
    longest = limit_stay((unit for unit, _ in hmm.inventory.monophones), hmm.inventory.free)
    log_stay = np.log(np.clip(stay, MIN_STAY_PROBABILITY, longest))
    return replace(hmm, models=models, log_stay=log_stay)


@dataclass(frozen=True, eq=False)
class TrainingUtterance:
    """The observations of an utterance, and its units.

    bounds : the first frame of each unit, and the frame count at the end [shape=(len(units) + 1,)], to start
             from; None: a flat start, with states of equal length
    """

    observed: StreamObservations
    units: tuple[str, ...]
    bounds: NDArray[np.intp] | None = None


def grow_joint(
    utterances: Sequence[TrainingUtterance],
    inventory: Inventory,
    classes: Mapping[str, frozenset[str]],
    config: JointConfig,
    monitor: Monitor = silent_monitor,
    work: Checkpoint = NO_CHECKPOINT,
) -> Iterator[JointHmm]:
    """Yield models of all streams, trained together, of 1, 2, 4 … Gaussians for speech, then of more for motion.

    classes : sets of units, by name, that the trees ask about, besides single units
    A stream of weight 0 in training does not affect the alignment, but its densities are learned.
    Within each stage the likelihood never falls.
    Raises CorpusError: no utterance, or none with as many frames as its units have states.
    Raises InputError: an unknown unit, or no stream that is active in training.
    Source: Hofer 2008, §4 and §6; tying by minimum description length as in ``stats.trees``.  Deviations: utterances
    with ``bounds`` start from these, not flat; trees of acoustic streams ask about one neighbour, unless
    ``both_neighbours`` is set (``model.choose_positions``).
    """
    hmm, prepared = _start(utterances, inventory, config)
    splits = [count.bit_length() - 1 for count in (config.mixtures, config.motion_mixtures)]
    widths = [config.plain_iterations, 1, config.iterations, *(2 * config.iterations * count for count in splits), 1]
    plain, trees, tied, *mixed, last = _split_monitor(monitor, widths)
    hmm = _run_em(hmm, prepared, "units", config.plain_iterations, plain, work)
    hmm = _tie_states(hmm, prepared, list_context_questions(inventory, classes), trees, work)
    hmm = _run_em(hmm, prepared, "units in context", config.iterations, tied, work)
    yield hmm
    for name, count, of_stream in zip((SPEECH, MOTION), splits, mixed, strict=True):
        for part in _split_monitor(of_stream, [1] * count) if name in hmm.models else ():
            model, statistics = hmm.models[name], accumulate_statistics(hmm, prepared, work).densities[name]
            if not (statistics.moments[:, :, 0] >= SPLIT_FRAMES).any():
                break
            halves = model.tied.split(statistics)
            hmm = replace(hmm, models={**hmm.models, name: replace(model, tied=halves)})
            stage = f"{halves.mixtures.size[1]} Gaussians for {name}"
            hmm = _run_em(hmm, prepared, stage, config.iterations, part, work)
            yield hmm
    last(Progress("lengths of states", 1, 1, 1.0))


def _start(
    utterances: Sequence[TrainingUtterance], inventory: Inventory, config: JointConfig
) -> tuple[JointHmm, PreparedUtterances]:
    """Return the utterances and models without context, from states of equal length. Raises as ``grow_joint``."""
    if not utterances:
        raise CorpusError("no utterances to train on; give at least one")
    streams = [name for name in STREAMS if any(name in utterance.observed.streams for utterance in utterances)]
    if not set(streams) & set(config.training.active):
        raise InputError(f"switched on are {', '.join(config.training.active)}; observed were {', '.join(streams)}")
    occurring = {unit for utterance in utterances for unit in utterance.units} | {inventory.silence}
    spoken = tuple(unit for unit in inventory.names if unit in occurring)
    models = {}
    for name in streams:
        scale, known = fit_scale([u.observed.streams[name] for u in utterances if name in u.observed.streams])
        forest = build_unit_forest(inventory, spoken)
        tied = make_standard_normals(forest.size, len(scale.mean), name in F0_STREAMS, known)
        models[name] = StreamModel(scale, forest, tied)
    free, silence = inventory.free, inventory.silence
    sequences = [tuple(silence if unit in free else unit for unit in utterance.units) for utterance in utterances]
    log_stay = np.log(limit_stay((unit for unit, _ in inventory.monophones), free))
    bigram = estimate_bigram(inventory.names, sequences)
    hmm = JointHmm(config, inventory, models, log_stay, spoken, bigram)
    prepared = prepare_utterances(hmm, [(each.observed, each.units) for each in utterances])
    if not any(item.fits for item in prepared.items):
        raise CorpusError(
            f"none of {len(utterances)} utterances has room for the states of its units; check them, or use fewer"
        )

    def posteriors() -> Iterator[tuple[PreparedUtterance, StatePosteriors]]:
        """Give all states of a unit, or without bounds all states, equally many frames."""
        for item, utterance in zip(prepared.items, utterances, strict=True):
            if item.fits:
                positions = expand_triphones(inventory, utterance.units).positions
                path = np.arange(item.frames) * len(positions) // item.frames
                for position, (start, end) in enumerate(pairwise([] if utterance.bounds is None else utterance.bounds)):
                    states = np.flatnonzero(positions == position)
                    path[start:end] = states[np.arange(end - start) * len(states) // max(end - start, 1)]
                posterior = np.zeros((item.frames, len(item.monophones)))
                posterior[np.arange(item.frames), path] = 1
                yield item, StatePosteriors(posterior, np.maximum(posterior.sum(axis=0) - 1, 0), 0.0)

    sums = _add_up(_Accounts(hmm, hmm.leaves(prepared.triphones), by_triphone=False), posteriors())
    return reestimate_hmm(hmm, _statistics(hmm, sums)), prepared


def _split_monitor(monitor: Monitor, widths: Sequence[int]) -> list[Monitor]:
    """Return a monitor for each part of the work; the widths are the relative amounts of work."""
    edges = np.cumsum([0, *widths]) / max(sum(widths), 1)
    return [sub_monitor(monitor, start, stop) for start, stop in pairwise(edges.tolist())]


def _run_em(
    hmm: JointHmm, prepared: PreparedUtterances, stage: str, steps: int, monitor: Monitor, work: Checkpoint
) -> JointHmm:

    def report(step: int, _: JointHmm, statistics: StreamStatistics) -> None:
        monitor(Progress(stage, step, steps, step / steps, statistics.mean_log_likelihood))

    return run_em(hmm, lambda model: accumulate_statistics(model, prepared, work), reestimate_hmm, steps, report).model


def _tie_states(
    hmm: JointHmm, prepared: PreparedUtterances, questions: tuple[Question, ...], monitor: Monitor, work: Checkpoint
) -> JointHmm:
    """Return the models with their states in context tied by decision trees, one Gaussian a leaf."""
    config, triphones = hmm.config, prepared.triphones
    statistics = accumulate_statistics(hmm, prepared, work, by_triphone=True).densities
    models = {}
    for step, (name, model) in enumerate(hmm.models.items(), start=1):
        has_spaces = model.tied.voiced is not None
        forest = grow_forest(
            name, hmm.inventory, questions, triphones, statistics[name], has_spaces=has_spaces, config=config
        )
        groups, dimensions = forest.leaves(triphones), len(model.scale.mean)
        of_leaves = GaussianStatistics.zeros(forest.size, 1, dimensions)
        np.add.at(of_leaves.frames, groups, statistics[name].frames)
        np.add.at(of_leaves.moments, groups, statistics[name].moments)
        untrained = make_standard_normals(forest.size, dimensions, has_spaces)
        models[name] = StreamModel(model.scale, forest, untrained.reestimate(of_leaves, config.variance_floor))
        monitor(Progress("trees", step, len(hmm.models), step / len(hmm.models), float(forest.size)))
    return replace(hmm, models=models)
