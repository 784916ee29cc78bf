"""Training of all streams together: even states, plain units, trees, units in context, mixtures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import CorpusError, InputError
from lipmotion.hmm.multistream.align import measured_durations
from lipmotion.hmm.multistream.densities import fit_scale, standard
from lipmotion.hmm.multistream.em import (
    Posterior,
    Sentences,
    expect,
    maximised,
    most_stay,
    posteriors,
    sentences_of,
)
from lipmotion.hmm.multistream.forest import grown, questions_about, unit_forest
from lipmotion.hmm.multistream.inventory import Inventory, states_of
from lipmotion.hmm.multistream.model import JointConfig, JointHmm, Part
from lipmotion.hmm.multistream.streams import F0_STREAMS, MOTION, SPEECH, STREAMS, Observed
from lipmotion.stats.bigram import estimate_bigram
from lipmotion.stats.trees import Question
from lipmotion.types import Monitor, Progress, part_of, silent_monitor


@dataclass(frozen=True, eq=False)
class Transcribed:
    """An utterance and its units.

    bounds : the first frame of each unit, and the frame count at the end [shape=(len(units) + 1,)], to start
             from; None: a flat start, states that are all as long
    Raises InputError: no units, or bounds that are not those of the units.
    """

    observed: Observed
    units: tuple[str, ...]
    bounds: NDArray[np.intp] | None = None

    def __post_init__(self) -> None:
        if not self.units:
            raise InputError("an utterance without units; give at least silence")
        bounds, frames = self.bounds, self.observed.frames
        if bounds is not None and (
            len(bounds) != len(self.units) + 1 or bounds[0] != 0 or bounds[-1] != frames or (np.diff(bounds) < 0).any()
        ):
            raise InputError(
                f"bounds {bounds.tolist()} of {len(self.units)} units; required one more than units, from 0 to {frames}"
            )


def train_joint(
    utterances: Sequence[Transcribed],
    inventory: Inventory,
    classes: Mapping[str, frozenset[str]],
    config: JointConfig,
    monitor: Monitor = silent_monitor,
    validation: Sequence[Transcribed] = (),
) -> JointHmm:
    """Train models of all streams together.

    classes    : of units, by name: what the trees ask for, besides single units
    validation : mixtures of speech and motion are split as long as these become more probable; without any, as often as
                 the configuration allows
    A stream whose weight is 0 in training has no say in when a state begins, but learns what it is like in it.
    Within each stage the likelihood never falls.
    Raises CorpusError: no utterance, or none with room for the states of its units.
    Raises InputError: an unknown unit, or no stream that is switched on in training.
    Source: Hofer 2008, §4 and §6; ties by minimum description length as in ``stats.trees``.  Deviations: utterances
    with ``bounds`` start from these, not flat; trees of what is heard ask for one neighbour (``forest.places_asked``).
    """
    if not utterances:
        raise CorpusError("no utterances to train on; give at least one")
    streams = [name for name in STREAMS if any(name in utterance.observed.streams for utterance in utterances)]
    if config.states != inventory.states:
        raise InputError(f"an inventory of {inventory.states} states a unit, the configuration says {config.states}")
    if not set(streams) & set(config.training.on):
        raise InputError(f"switched on are {', '.join(config.training.on)}; observed were {', '.join(streams)}")
    hmm = _untrained(utterances, inventory, config, streams)
    sentences = _sentences(hmm, utterances)
    if not any(sentence.fits for sentence in sentences.items):
        raise CorpusError(
            f"none of {len(utterances)} utterances has room for the states of its units; "
            "check that units and recordings belong together, or give units fewer states"
        )
    hmm = _started(hmm, sentences, [(utterance.units, utterance.bounds) for utterance in utterances])
    splits = _doublings(config.mixtures), _doublings(config.motion_mixtures)
    widths = [config.plain_iterations, 1, config.iterations, *(2 * config.iterations * count for count in splits), 1]
    plain, trees, tied, *mixed, last = _parts(monitor, widths)
    hmm = _improved(hmm, sentences, "units", config.plain_iterations, plain)
    hmm = _tied(hmm, sentences, questions_about(inventory, classes), trees)
    hmm = _improved(hmm, sentences, "units in context", config.iterations, tied)
    held_out = _sentences(hmm, validation)
    for name, count, part in zip((SPEECH, MOTION), splits, mixed, strict=True):
        hmm = _mixed(hmm, sentences, held_out, name, _parts(part, [1] * count)) if name in hmm.parts else hmm
    hmm = replace(hmm, durations=measured_durations(hmm, [(u.observed, u.units) for u in utterances]))
    last(Progress("lengths of states", 1, 1, 1.0))
    return hmm


def _doublings(most: int) -> int:
    """Return how often one can be doubled until it is ``most``."""
    return most.bit_length() - 1


def _parts(monitor: Monitor, widths: Sequence[int]) -> list[Monitor]:
    """Return a monitor for each part of the work, of so much of it."""
    edges = np.cumsum([0, *widths]) / max(sum(widths), 1)
    return [part_of(monitor, start, stop) for start, stop in pairwise(edges.tolist())]


def _improved(hmm: JointHmm, sentences: Sentences, stage: str, iterations: int, monitor: Monitor) -> JointHmm:
    """Return the models after some steps of embedded Baum–Welch."""
    for step in range(1, iterations + 1):
        expected = expect(hmm, sentences)
        hmm = maximised(hmm, expected)
        monitor(Progress(stage, step, iterations, step / iterations, expected.mean_log_likelihood))
    return hmm


def _tied(hmm: JointHmm, sentences: Sentences, questions: tuple[Question, ...], monitor: Monitor) -> JointHmm:
    """Return the same models, their states in context tied by trees; a Gaussian a leaf."""
    config, seen, sums = hmm.config, sentences.places, expect(hmm, sentences).places
    parts = {}
    for step, (name, part) in enumerate(hmm.parts.items(), start=1):
        has_spaces = part.tied.voiced is not None
        forest = grown(
            name, hmm.inventory, questions, seen, sums[name], has_spaces=has_spaces, factor=config.tree_factor,
            least_frames=config.least_frames, least_variance=config.variance_floor,
        )  # fmt: skip
        of_leaves = sums[name].of_groups(forest.leaves(seen), forest.size)
        tied = standard(forest.size, len(part.scale.mean), has_spaces).maximised(of_leaves, config.variance_floor)
        parts[name] = Part(part.scale, forest, tied)
        monitor(Progress("trees", step, len(hmm.parts), step / len(hmm.parts), float(forest.size)))
    return replace(hmm, parts=parts)


def _mixed(
    hmm: JointHmm, sentences: Sentences, held_out: Sentences, name: str, monitors: Sequence[Monitor]
) -> JointHmm:
    """Return the models with the Gaussians of a stream split as often as there are monitors, and as held-out
    utterances become more probable.
    """
    best = mean_log_likelihood(hmm, held_out)
    for monitor in monitors:
        part, sums = hmm.parts[name], expect(hmm, sentences).leaves[name]
        if not part.tied.splits(sums):
            break
        tied = part.tied.split(sums)
        new = replace(hmm, parts={**hmm.parts, name: replace(part, tied=tied)})
        stage = f"{tied.mixtures.size[1]} Gaussians for {name}"
        new = _improved(new, sentences, stage, hmm.config.iterations, monitor)
        figure = mean_log_likelihood(new, held_out)
        if held_out.items and not figure > best:
            break
        hmm, best = new, figure
    return hmm


def mean_log_likelihood(hmm: JointHmm, sentences: Sentences) -> float:
    """Return the log likelihood a frame, of utterances with room for their states; 0 where there are none."""
    found = [(p.log_likelihood, sentences.items[p.sentence].frames) for p in posteriors(hmm, sentences)]
    return sum(value for value, _ in found) / max(sum(frames for _, frames in found), 1)


def _sentences(hmm: JointHmm, utterances: Sequence[Transcribed]) -> Sentences:
    return sentences_of(hmm, [(utterance.observed, utterance.units) for utterance in utterances])


def _untrained(
    utterances: Sequence[Transcribed], inventory: Inventory, config: JointConfig, streams: Sequence[str]
) -> JointHmm:
    """Return models in which all units are alike."""
    spoken = {unit for utterance in utterances for unit in utterance.units}
    spoken_units = tuple(unit for unit in inventory.names if unit in spoken | {inventory.silence})
    parts = {}
    for name in streams:
        scale, known = fit_scale([u.observed.streams[name] for u in utterances if name in u.observed.streams])
        forest = unit_forest(inventory, spoken_units)
        parts[name] = Part(scale, forest, standard(forest.size, len(scale.mean), name in F0_STREAMS, known))
    sentences = [_without_pauses(utterance.units, inventory) for utterance in utterances]
    log_stay = np.log(most_stay(inventory))
    durations = np.full((len(log_stay), 2), np.nan)
    bigram = estimate_bigram(inventory.names, sentences)
    return JointHmm(config, inventory, parts, log_stay, durations, spoken_units, bigram)


def _without_pauses(units: Sequence[str], inventory: Inventory) -> tuple[str, ...]:
    return tuple(inventory.silence if unit in inventory.free else unit for unit in units)


def _started(
    hmm: JointHmm, sentences: Sentences, starts: Sequence[tuple[tuple[str, ...], NDArray[np.intp] | None]]
) -> JointHmm:
    """Return the models of units cut into states as long as each other, inside their bounds where they have some."""

    def found() -> Iterator[Posterior]:
        for number, (sentence, (units, edges)) in enumerate(zip(sentences.items, starts, strict=True)):
            if sentence.fits:
                path = _even_path(states_of(hmm.inventory, units).positions, sentence.frames, edges)
                posterior = np.zeros((sentence.frames, len(sentence.states)))
                posterior[np.arange(sentence.frames), path] = 1
                yield Posterior(number, posterior, np.maximum(posterior.sum(axis=0) - 1, 0), 0.0)

    return maximised(hmm, expect(hmm, sentences, found()))


def _even_path(positions: NDArray[np.intp], frames: int, bounds: NDArray[np.intp] | None) -> NDArray[np.intp]:
    """Return the state of every frame [shape=(T,)]: each unit cut evenly, or the whole utterance without bounds.

    positions : [shape=(S,)], the unit that each state belongs to
    """
    if bounds is None:
        return np.arange(frames) * len(positions) // frames
    path = np.empty(frames, np.intp)
    for position, (start, end) in enumerate(pairwise(bounds.tolist())):
        mine = np.flatnonzero(positions == position)
        path[start:end] = mine[np.arange(end - start) * len(mine) // max(end - start, 1)]
    return path
