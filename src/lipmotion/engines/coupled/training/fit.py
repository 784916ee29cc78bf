"""Learning a coupled model from examples."""

from __future__ import annotations

import itertools
import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.densities import Observed
from lipmotion.engines.coupled.chains.model import Chains
from lipmotion.engines.coupled.chains.structures import HMM, Structure, structure_of
from lipmotion.engines.coupled.chains.visual_streams import EIGENLIPS, GEOMETRY, VisualStream, unseen, visual_streams
from lipmotion.engines.coupled.config import CoupledConfig
from lipmotion.engines.coupled.conversion.em import speech_alone
from lipmotion.engines.coupled.conversion.regression import (
    Following,
    Heard,
    Surroundings,
    belief_axes,
    fit_following,
    fit_surroundings,
)
from lipmotion.engines.coupled.model import CALM_S, CoupledModel
from lipmotion.engines.coupled.training.speech_only import MoreSpeech, with_more_speech
from lipmotion.engines.coupled.training.train import Labelled, Schedule, Step, growing_chains
from lipmotion.errors import CorpusError
from lipmotion.kernels.banded import generate
from lipmotion.motion.closure import fit_closure_of
from lipmotion.motion.rest import away_from_speech, speech_intervals
from lipmotion.motion.space import fit_reduced_motion
from lipmotion.motion.variance_scaling import scaling_factors
from lipmotion.stats.delta_windows import dynamics_known
from lipmotion.types import FRAME_RATE_HZ, Example, Monitor, Progress, Timeline, Unit, part_of
from lipmotion.units import VISEME_OF, is_silent

Array = NDArray[np.float64]
ResultT = TypeVar("ResultT")
SPEECH = "speech"


def fit_coupled(examples: Sequence[Example], config: CoupledConfig, monitor: Monitor) -> CoupledModel:
    """Return a model of speech with its motion.

    Examples in which no motion was seen are for the second stage of training, which makes the densities of speech those
    of more speakers (``more_speech``). They teach nothing before it; after it, what follows from the beliefs of these
    densities is learned from the examples with motion only.
    Raises CorpusError: no example with motion that was seen, or examples of different channels.
    Raises InputError: no such unit set, or a structure that does not fit together.
    """
    return deque(growing_models(examples, config, monitor), maxlen=1)[0]()


def growing_models(
    examples: Sequence[Example], config: CoupledConfig, monitor: Monitor
) -> Iterator[Callable[[], CoupledModel]]:
    """Give what makes the models with 1, 2, 4, … Gaussians that ``fit_coupled`` learns on its way, itself the last.

    Raises as ``fit_coupled``.
    """
    structure = structure_of(config.structure, config.chains, config.states, config.asynchrony, config.cross_units)
    moving = [example for example in examples if dynamics_known(example.valid).any()]
    space, values = fit_reduced_motion(moving or examples, config.components)
    if all(is_silent(span.label.phone) for example in moving for span in example.speech.units):
        raise CorpusError(f"nothing is said in {len(moving)} examples with motion; learn from speech")
    seen = [dynamics_known(example.valid) for example in moving]
    visual = visual_streams(space, values, seen, config.dynamic)
    data = [
        Labelled(
            Observed((_features(example), *(stream.observed(x) for stream in visual)), (None, *(mask for _ in visual))),
            example.speech.units,
        )
        for example, x, mask in zip(moving, values, seen, strict=True)
    ]
    rest, closure = _rest(moving, values, seen), fit_closure_of(space.direct_names, values, moving)
    others = [
        Labelled(unseen(_features(example), visual), example.speech.units)
        for example in examples
        if not dynamics_known(example.valid).any()
    ]
    first, second = (0.4, 0.7) if others else (0.7, 0.7)

    def model_of(chains: Chains) -> CoupledModel:
        if others:
            chains = _second_stage(chains, data, others, config, part_of(monitor, first, second))
        model = CoupledModel(chains, space, visual, None, np.ones(space.dimensions), rest, closure)
        if config.dynamic and config.acoustic_regression:
            monitor(Progress("following the sound", 1, 1, 0.75))
            model = replace(model, follow=_follow(model, data))
        if config.dynamic and config.variance_scaling:
            model = replace(model, gain=_gain(model, data, values))
        monitor(Progress("following the sound", 1, 1, 1.0))
        return model

    names, how = (SPEECH, *(stream.name for stream in visual)), _schedule(structure, visual, config)
    steps = how.most * max(how.mixtures).bit_length()
    told = _told("chains", steps, part_of(monitor, 0, first))
    for chains in growing_chains(structure, names, data, how, told, workers()):
        yield partial(model_of, chains)


def _schedule(structure: Structure, visual: Sequence[VisualStream], config: CoupledConfig) -> Schedule:
    mixtures = (config.mixtures, *(config.visual_mixtures for _ in visual))
    weights = {GEOMETRY: config.visual_weight, EIGENLIPS: config.eigenlips_weight}
    return Schedule(
        mixtures[:1] if structure.kind == HMM else mixtures,
        (config.audio_weight, *(weights[stream.name] for stream in visual)),
    )


def _second_stage(
    chains: Chains, data: Sequence[Labelled], others: Sequence[Labelled], config: CoupledConfig, monitor: Monitor
) -> Chains:
    """Return the chains after the second stage of training, on speech without motion as well."""
    more = MoreSpeech(config.speech_only_mixtures, config.speech_only_steps, config.speech_only_weight)
    steps = more.steps * max(more.mixtures // config.mixtures, 1).bit_length()
    return with_more_speech(chains, data, others, more, _told("more speech", steps, monitor), workers())


def workers() -> int:
    """Return how many threads share the work; the result does not depend on it."""
    return min(os.cpu_count() or 1, 8)


def _features(example: Example) -> NDArray[np.float32]:
    return np.asarray(example.speech.features.values)


def _told(stage: str, most: int, monitor: Monitor) -> Callable[[Step], None]:
    """Return what reports the steps of a stage of training; how many there will be is not known beforehand.

    most : steps, if none is left out
    """
    done = itertools.count(1)

    def tell(step: Step) -> None:
        number = next(done)
        monitor(Progress(stage, number, most, number / most, step.log_likelihood))

    return tell


def _rest(examples: Sequence[Example], values: Sequence[Array], seen: Sequence[NDArray[np.bool_]]) -> Array:
    """Return the median pose of silence away from speech; of everything where there is none [shape=(Q,)]."""
    poses = [
        x[mask & calm(example.speech.units, len(x))] for example, x, mask in zip(examples, values, seen, strict=True)
    ]
    chosen = np.concatenate(poses)
    if not len(chosen):
        chosen = np.concatenate([x[mask] for x, mask in zip(values, seen, strict=True)])
    rest: Array = np.median(chosen, axis=0)
    return rest


def calm(units: Timeline[Unit], frames: int) -> NDArray[np.bool_]:
    """Return which frames are silence away from speech [shape=(T,)]."""
    return away_from_speech(np.arange(frames) / FRAME_RATE_HZ, speech_intervals(units), CALM_S)


def _follow(model: CoupledModel, data: Sequence[Labelled]) -> tuple[Surroundings, tuple[Following, ...]]:
    """Return how the visual means follow what is around a frame, believed as when only speech is known."""
    chains = model.chains
    structure = chains.structure
    others = [structure.chain_of(stream + 1) for stream in range(len(model.visual))]
    believed = list(_each(lambda one: _believed(chains, one, (0, *others)), data))
    axes = belief_axes(posterior for posterior, *_ in believed)
    heard = [
        Heard(
            one.observed.streams[0],
            posterior @ axes,
            gates,
            one.observed.streams[1:],
            np.asarray(one.observed.seen[1]),
        )
        for one, (posterior, *gates) in zip(data, believed, strict=True)
    ]
    around = fit_surroundings(axes, heard)
    return around, tuple(
        fit_following(around, heard, stream, *_kinds(structure, chain)) for stream, chain in enumerate(others)
    )


def _believed(chains: Chains, one: Labelled, which: Sequence[int]) -> tuple[NDArray[np.float32], ...]:
    evidence = chains.evidence(speech_alone(one.observed), chains.everywhere)
    posteriors = chains.posteriors(evidence, chains.everywhere)
    return tuple(posteriors.chains[chain] for chain in which)


def _kinds(structure: Structure, chain: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return a number for the viseme and place of each state of a chain [shape=(N,)], and the viseme of each [(E,)]."""
    visemes = [VISEME_OF[structure.chains[chain].phones(unit)[0]] for unit in structure.units[chain]]
    numbers = np.unique(visemes, return_inverse=True)[1]
    family = np.repeat(np.arange(numbers.max() + 1), structure.states)
    return (numbers[:, None] * structure.states + np.arange(structure.states)).ravel().astype(np.intp), family


def _gain(model: CoupledModel, data: Sequence[Labelled], values: Sequence[Array]) -> Array:
    """Return by how much movements must grow to be as large as the original's [shape=(Q,)]."""
    chains = model.chains

    def spread(one: Labelled) -> Array:
        observed = speech_alone(one.observed)
        motion, _ = generate(*model.statistics(chains.inferred(observed, chains.everywhere)))
        deviation: Array = motion[one.observed.seen[1]].std(axis=0)
        return deviation

    generated = list(_each(spread, data))
    original = [x[one.observed.seen[1]].std(axis=0) for one, x in zip(data, values, strict=True)]
    return scaling_factors(original, generated)


def _each(function: Callable[[Labelled], ResultT], data: Sequence[Labelled]) -> Iterator[ResultT]:
    with ThreadPoolExecutor(workers()) as pool:
        yield from pool.map(function, data)
