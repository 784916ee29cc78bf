"""Training of all streams together: equal states, units without context, decision trees, units in context, mixtures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import CorpusError, InputError
from lipmotion.hmm.multistream.align import check_bounds, measure_durations
from lipmotion.hmm.multistream.densities import fit_scale, make_standard_normals
from lipmotion.hmm.multistream.forest import TreeCosts, context_questions, grow_forest, unit_forest
from lipmotion.hmm.multistream.model import JointConfig, JointHmm, StreamModel
from lipmotion.hmm.multistream.multistream_baum_welch import (
    PreparedUtterances,
    StatePosteriors,
    StreamStatistics,
    accumulate_statistics,
    iterate_posteriors,
    max_stay_probability,
    prepare_utterances,
    reestimate_hmm,
)
from lipmotion.hmm.multistream.streams import F0_STREAMS, MOTION, SPEECH, STREAMS, StreamObservations
from lipmotion.hmm.multistream.unit_states import Inventory, expand_triphones
from lipmotion.stats.bigram import estimate_bigram
from lipmotion.stats.em import run_em
from lipmotion.stats.trees import Question
from lipmotion.types import Monitor, Progress, silent_monitor, sub_monitor


@dataclass(frozen=True, eq=False)
class TrainingUtterance:
    """The observations of an utterance, and its units.

    bounds : the first frame of each unit, and the frame count at the end [shape=(len(units) + 1,)], to start
             from; None: a flat start, with states of equal length
    Raises InputError: no units, or bounds that do not fit the units or the frames.
    """

    observed: StreamObservations
    units: tuple[str, ...]
    bounds: NDArray[np.intp] | None = None

    def __post_init__(self) -> None:
        if not self.units:
            raise InputError("an utterance without units; give at least silence")
        if self.bounds is not None:
            check_bounds(self.bounds, len(self.units), self.observed.frames)


def train_joint(
    utterances: Sequence[TrainingUtterance],
    inventory: Inventory,
    classes: Mapping[str, frozenset[str]],
    config: JointConfig,
    monitor: Monitor = silent_monitor,
    validation: Sequence[TrainingUtterance] = (),
) -> JointHmm:
    """Return models of all streams, trained together: the last of ``grow_joint``, which says what it takes."""
    *_, hmm = grow_joint(utterances, inventory, classes, config, monitor, validation)
    return with_durations(hmm, utterances)


def grow_joint(
    utterances: Sequence[TrainingUtterance],
    inventory: Inventory,
    classes: Mapping[str, frozenset[str]],
    config: JointConfig,
    monitor: Monitor = silent_monitor,
    validation: Sequence[TrainingUtterance] = (),
) -> Iterator[JointHmm]:
    """Yield models of all streams, trained together, of 1, 2, 4 … Gaussians for speech, then of more for motion.

    Their durations are not measured (NaN): ``with_durations``.

    classes    : sets of units, by name, that the trees ask about, besides single units
    validation : mixtures of speech and motion are split as long as the likelihood of these utterances rises; without
                 any, as often as the configuration allows
    A stream of weight 0 in training does not affect the alignment, but its densities are learned.
    Within each stage the likelihood never falls.
    Raises CorpusError: no utterance, or none with as many frames as its units have states.
    Raises InputError: an unknown unit, or no stream that is active in training.
    Source: Hofer 2008, §4 and §6; tying by minimum description length as in ``stats.trees``.  Deviations: utterances
    with ``bounds`` start from these, not flat; trees of acoustic streams ask about one neighbour, unless
    ``both_neighbours`` is set (``forest.choose_positions``).
    """
    hmm, prepared = _start(utterances, inventory, config)
    splits = [count.bit_length() - 1 for count in (config.mixtures, config.motion_mixtures)]
    widths = [config.plain_iterations, 1, config.iterations, *(2 * config.iterations * count for count in splits), 1]
    plain, trees, tied, *mixed, last = _split_monitor(monitor, widths)
    hmm = _run_em(hmm, prepared, "units", config.plain_iterations, plain)
    hmm = _tie_states(hmm, prepared, context_questions(inventory, classes), trees)
    hmm = _run_em(hmm, prepared, "units in context", config.iterations, tied)
    yield hmm
    held_out = _prepare(hmm, validation)
    for name, count, of_stream in zip((SPEECH, MOTION), splits, mixed, strict=True):
        for part in _split_monitor(of_stream, [1] * count) if name in hmm.models else ():
            split = _split(hmm, prepared, held_out, name, part)
            if split is None:
                break
            hmm = split
            yield hmm
    last(Progress("lengths of states", 1, 1, 1.0))


def _start(
    utterances: Sequence[TrainingUtterance], inventory: Inventory, config: JointConfig
) -> tuple[JointHmm, PreparedUtterances]:
    """Return models without context, from states of equal length inside known bounds, and the utterances. Raises as
    ``grow_joint``.
    """
    if not utterances:
        raise CorpusError("no utterances to train on; give at least one")
    streams = [name for name in STREAMS if any(name in utterance.observed.streams for utterance in utterances)]
    if config.states != inventory.states:
        raise InputError(f"an inventory of {inventory.states} states a unit, the configuration says {config.states}")
    if not set(streams) & set(config.training.active):
        raise InputError(f"switched on are {', '.join(config.training.active)}; observed were {', '.join(streams)}")
    hmm = _make_equal_models(utterances, inventory, config, streams)
    prepared = _prepare(hmm, utterances)
    if not any(item.fits for item in prepared.items):
        raise CorpusError(
            f"none of {len(utterances)} utterances has room for the states of its units; "
            "check that units and recordings belong together, or give units fewer states"
        )

    def posteriors() -> Iterator[StatePosteriors]:
        for number, (item, utterance) in enumerate(zip(prepared.items, utterances, strict=True)):
            if item.fits:
                positions = expand_triphones(inventory, utterance.units).positions
                posterior = np.zeros((item.frames, len(item.monophones)))
                posterior[np.arange(item.frames), _spread_states(positions, item.frames, utterance.bounds)] = 1
                yield StatePosteriors(number, posterior, np.maximum(posterior.sum(axis=0) - 1, 0), 0.0)

    return reestimate_hmm(hmm, accumulate_statistics(hmm, prepared, posteriors())), prepared


def _make_equal_models(
    utterances: Sequence[TrainingUtterance], inventory: Inventory, config: JointConfig, streams: Sequence[str]
) -> JointHmm:
    occurring = {unit for utterance in utterances for unit in utterance.units} | {inventory.silence}
    spoken = tuple(unit for unit in inventory.names if unit in occurring)
    models = {}
    for name in streams:
        scale, known = fit_scale([u.observed.streams[name] for u in utterances if name in u.observed.streams])
        forest = unit_forest(inventory, spoken)
        tied = make_standard_normals(forest.size, len(scale.mean), name in F0_STREAMS, known)
        models[name] = StreamModel(scale, forest, tied)
    free, silence = inventory.free, inventory.silence
    sequences = [tuple(silence if unit in free else unit for unit in utterance.units) for utterance in utterances]
    log_stay = np.log(max_stay_probability(inventory))
    durations = np.full((len(log_stay), 2), np.nan)
    bigram = estimate_bigram(inventory.names, sequences)
    return JointHmm(config, inventory, models, log_stay, durations, spoken, bigram)


def _spread_states(positions: NDArray[np.intp], frames: int, bounds: NDArray[np.intp] | None) -> NDArray[np.intp]:
    """Return the state of every frame [shape=(T,)]: all states of a unit, or without bounds all, last equally long."""
    if bounds is None:
        return np.arange(frames) * len(positions) // frames
    path = np.empty(frames, np.intp)
    for position, (start, end) in enumerate(pairwise(bounds.tolist())):
        states = np.flatnonzero(positions == position)
        path[start:end] = states[np.arange(end - start) * len(states) // max(end - start, 1)]
    return path


def with_durations(hmm: JointHmm, utterances: Sequence[TrainingUtterance]) -> JointHmm:
    """Return models with the durations of states that are measured in the alignment of their training."""
    return replace(hmm, durations=measure_durations(hmm, [(u.observed, u.units) for u in utterances]))


def _split_monitor(monitor: Monitor, widths: Sequence[int]) -> list[Monitor]:
    """Return a monitor for each part of the work; the widths are the relative amounts of work."""
    edges = np.cumsum([0, *widths]) / max(sum(widths), 1)
    return [sub_monitor(monitor, start, stop) for start, stop in pairwise(edges.tolist())]


def _run_em(hmm: JointHmm, prepared: PreparedUtterances, stage: str, steps: int, monitor: Monitor) -> JointHmm:

    def report(step: int, _: JointHmm, statistics: StreamStatistics) -> None:
        monitor(Progress(stage, step, steps, step / steps, statistics.mean_log_likelihood))

    return run_em(hmm, lambda model: accumulate_statistics(model, prepared), reestimate_hmm, steps, report).model


def _tie_states(
    hmm: JointHmm, prepared: PreparedUtterances, questions: tuple[Question, ...], monitor: Monitor
) -> JointHmm:
    """Return the models with their states in context tied by decision trees, one Gaussian a leaf."""
    config, triphones = hmm.config, prepared.triphones
    statistics = accumulate_statistics(hmm, prepared).triphones
    costs = TreeCosts(config.tree_factor, config.least_frames, config.variance_floor, config.both_neighbours)
    models = {}
    for step, (name, model) in enumerate(hmm.models.items(), start=1):
        has_spaces = model.tied.voiced is not None
        forest = grow_forest(
            name, hmm.inventory, questions, triphones, statistics[name], has_spaces=has_spaces, costs=costs
        )
        of_leaves = statistics[name].pool(forest.leaves(triphones), forest.size)
        untrained = make_standard_normals(forest.size, len(model.scale.mean), has_spaces)
        models[name] = StreamModel(model.scale, forest, untrained.reestimate(of_leaves, config.variance_floor))
        monitor(Progress("trees", step, len(hmm.models), step / len(hmm.models), float(forest.size)))
    return replace(hmm, models=models)


def _split(
    hmm: JointHmm, prepared: PreparedUtterances, held_out: PreparedUtterances, name: str, monitor: Monitor
) -> JointHmm | None:
    """Return the models with a stream's Gaussians split, and trained; None: too little data, or no gain on held-out
    speech.
    """
    model, statistics = hmm.models[name], accumulate_statistics(hmm, prepared).leaves[name]
    if not model.tied.can_split(statistics):
        return None
    tied = model.tied.split(statistics)
    new = replace(hmm, models={**hmm.models, name: replace(model, tied=tied)})
    new = _run_em(new, prepared, f"{tied.mixtures.size[1]} Gaussians for {name}", hmm.config.iterations, monitor)
    rises = not held_out.items or mean_log_likelihood(new, held_out) > mean_log_likelihood(hmm, held_out)
    return new if rises else None


def mean_log_likelihood(hmm: JointHmm, prepared: PreparedUtterances) -> float:
    """Return the mean log likelihood per frame of utterances with as many frames as states; 0 where there are none."""
    values = [(p.log_likelihood, prepared.items[p.utterance].frames) for p in iterate_posteriors(hmm, prepared)]
    return sum(value for value, _ in values) / max(sum(frames for _, frames in values), 1)


def _prepare(hmm: JointHmm, utterances: Sequence[TrainingUtterance]) -> PreparedUtterances:
    return prepare_utterances(hmm, [(utterance.observed, utterance.units) for utterance in utterances])
