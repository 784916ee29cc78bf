"""Training of all streams together: flat start, plain units, trees, units in context, mixtures."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.trajectory.joint.align import measured_durations
from lipmotion.engines.trajectory.joint.densities import fit_scale, standard
from lipmotion.engines.trajectory.joint.expectation import (
    Posterior,
    Sentences,
    expect,
    maximised,
    most_stay,
    posteriors,
    sentences_of,
)
from lipmotion.engines.trajectory.joint.forest import grown, questions_about, unit_forest
from lipmotion.engines.trajectory.joint.inventory import Inventory, states_of
from lipmotion.engines.trajectory.joint.model import JointConfig, JointHmm, Part
from lipmotion.engines.trajectory.joint.streams import F0_STREAMS, MOTION, SPEECH, STREAMS, Observed
from lipmotion.errors import CorpusError, InputError
from lipmotion.stats.bigram import estimate_bigram
from lipmotion.types import Monitor, Progress, silent_monitor


@dataclass(frozen=True, eq=False)
class Transcribed:
    """An utterance and its units.

    bounds : the first frame of each unit, and the frame count at the end [shape=(len(units) + 1,)], for the flat
             start; None: training begins with states that are all as long
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


Progressed = Callable[[str, float], None]


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
    Raises InputError: an unknown unit.
    Source: Hofer 2008, §4 and §6; ties by minimum description length as in ``stats.trees``.
    """
    streams = [name for name in STREAMS if any(name in utterance.observed.streams for utterance in utterances)]
    if config.states != inventory.states:
        raise InputError(f"an inventory of {inventory.states} states a unit, the configuration says {config.states}")
    training = _Training(inventory, classes, monitor, config)
    hmm = _untrained(utterances, inventory, config, streams)
    sentences = _sentences(hmm, utterances)
    if not any(sentence.fits for sentence in sentences.items):
        raise CorpusError(
            f"none of {len(utterances)} utterances has room for the states of its units; "
            "check that units and recordings belong together, or give units fewer states"
        )
    hmm = _started(hmm, sentences, [(utterance.units, utterance.bounds) for utterance in utterances])
    hmm = training.improve(hmm, sentences, "units", config.plain_iterations)
    hmm = training.tie(hmm, sentences)
    hmm = training.improve(hmm, sentences, "units in context", config.iterations)
    hmm = training.split(hmm, sentences, _sentences(hmm, validation))
    return replace(hmm, durations=measured_durations(hmm, [(u.observed, u.units) for u in utterances]))


@dataclass(frozen=True)
class _Training:
    """The stages of training."""

    inventory: Inventory
    classes: Mapping[str, frozenset[str]]
    monitor: Monitor
    config: JointConfig

    def improve(self, hmm: JointHmm, sentences: Sentences, stage: str, iterations: int) -> JointHmm:
        """Take some steps of embedded Baum–Welch."""
        for step in range(iterations):
            expected = expect(hmm, sentences)
            hmm = maximised(hmm, expected)
            self._report(stage, step + 1, iterations, expected.mean_log_likelihood)
        return hmm

    def tie(self, hmm: JointHmm, sentences: Sentences) -> JointHmm:
        """Return the same models, their states in context tied by trees; a Gaussian a leaf."""
        seen, sums = sentences.places, expect(hmm, sentences).places
        questions = questions_about(self.inventory, self.classes)
        parts = {}
        for step, (name, part) in enumerate(hmm.parts.items()):
            has_spaces = part.tied.voiced is not None
            forest = grown(
                name, self.inventory, questions, seen, sums[name], has_spaces=has_spaces,
                factor=self.config.tree_factor, least_frames=self.config.least_frames,
                least_variance=self.config.variance_floor,
            )  # fmt: skip
            leaves = forest.leaves(seen)
            tied = standard(forest.size, len(part.scale.mean), has_spaces)
            tied = tied.maximised(sums[name].of_groups(leaves, forest.size), self.config.variance_floor)
            parts[name] = Part(part.scale, forest, tied)
            self._report("trees", step + 1, len(hmm.parts), float(forest.size))
        return replace(hmm, parts=parts)

    def split(self, hmm: JointHmm, sentences: Sentences, held_out: Sentences) -> JointHmm:
        """Return the models with as many Gaussians as are allowed, and as held-out utterances are better with."""
        best = mean_log_likelihood(hmm, held_out)
        for name, most in ((SPEECH, self.config.mixtures), (MOTION, self.config.motion_mixtures)):
            while name in hmm.parts and 2 * hmm.parts[name].tied.mixtures.size[1] <= most:
                new = self._twice(hmm, sentences, name)
                if new is hmm:
                    break
                count = new.parts[name].tied.mixtures.size[1]
                new = self.improve(new, sentences, f"{count} Gaussians for {name}", self.config.iterations)
                figure = mean_log_likelihood(new, held_out)
                if held_out.items and not figure > best:
                    break
                hmm, best = new, figure
        return hmm

    def _twice(self, hmm: JointHmm, sentences: Sentences, name: str) -> JointHmm:
        """Return the models with some Gaussians of a stream split in two, or the same where none has enough data."""
        part, sums = hmm.parts[name], expect(hmm, sentences).leaves[name]
        if not part.tied.splits(sums):
            return hmm
        return replace(hmm, parts={**hmm.parts, name: replace(part, tied=part.tied.split(sums))})

    def _report(self, stage: str, step: int, steps: int, figure: float) -> None:
        self.monitor(Progress(stage, step, steps, step / steps, figure))


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
    if not utterances:
        raise CorpusError("no utterances to train on; give at least one")
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
    """Return the models of units cut into states as long as each other (the flat start)."""

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
