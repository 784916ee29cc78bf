"""Training of a coupled model from examples: chains, regression of visual means, variance scaling, rest pose."""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.base import Fit
from lipmotion.engines.coupled.chains.model import EIGENLIPS, GEOMETRY, Chains, fit_visual_streams, speech_observations
from lipmotion.engines.coupled.chains.product import HMM, list_unit_sets
from lipmotion.engines.coupled.conversion import (
    RegressionInputs,
    RegressionUtterance,
    VisualRegression,
    fit_axes,
    fit_regression_inputs,
    fit_visual_regression,
)
from lipmotion.engines.coupled.model import AWAY_FROM_SPEECH_S, CoupledConfig, CoupledModel
from lipmotion.engines.coupled.training.chain_training import (
    MAX_STEPS,
    AlignedUtterance,
    ChainStatistics,
    LatticeUtterance,
    Report,
    build_lattice_utterance,
    compute_variance_floors,
    count_components,
    grow_chains,
    train_to_convergence,
    with_split_components,
)
from lipmotion.errors import CorpusError
from lipmotion.kernels.banded import solve_mlpg
from lipmotion.motion.articulation import fit_articulation_prior
from lipmotion.motion.closure import fit_closure
from lipmotion.motion.frame_labels import mark_distant
from lipmotion.motion.generation import fit_scaling_factors
from lipmotion.motion.predictors import PREDICTORS, Predictor, PredictorTraining
from lipmotion.motion.space import fit_reduced_motion
from lipmotion.stats.curves import mark_known_dynamics
from lipmotion.stats.em import EmResult, no_report
from lipmotion.storage.archive import NO_CHECKPOINT, Checkpoint
from lipmotion.types import Example, Monitor, Progress, sub_monitor
from lipmotion.units import VISEME_OF, is_silent


def train_on_speech(
    chains: Chains,
    data: Sequence[AlignedUtterance],
    speech_only: Sequence[AlignedUtterance],
    config: CoupledConfig,
    report: Report = no_report,
    work: Checkpoint = NO_CHECKPOINT,
) -> Chains:
    """Return chains whose densities of speech are re-estimated from other speakers as well; all else stays.

    data        : what the chains were trained on; its speech is used here too, without its motion
    speech_only : utterances of other speakers; the values of their visual streams are ignored
    config      : its ``speech_only`` options count; densities never get fewer Gaussians than they have
    report      : while the number of components stays, the weighted log likelihood never falls
    Where speech and motion share their components (``hmm``), these stay as many, but their weights are re-estimated.
    """
    floors = compute_variance_floors([utterance.observations for utterance in data])
    utterances, steps = list[LatticeUtterance](), config.speech_only_steps
    for group, weight in ((data, 1.0), (speech_only, config.speech_only_weight)):
        unseen = [replace(each, observations=each.observations.without_visual_streams()) for each in group]
        utterances += [build_lattice_utterance(chains, each, weight) for each in unseen]
    present = count_components(chains)
    mixtures = present if chains.structure.kind == HMM else (max(config.speech_only_mixtures, present[0]), *present[1:])
    while True:
        result = train_to_convergence(chains, utterances, floors, steps, report, work, speech_only=True)
        if count_components(result.model) == mixtures:
            return result.model
        chains = with_split_components(result.model, mixtures, result.statistics)


Array = NDArray[np.float64]
ItemT = TypeVar("ItemT")
ResultT = TypeVar("ResultT")
SPEECH = "speech"


def _run_threaded(function: Callable[[ItemT], ResultT], items: Iterable[ItemT], /) -> Iterator[ResultT]:
    """Kernels and matrix products release the interpreter's lock."""
    with ThreadPoolExecutor(min(os.cpu_count() or 1, 8)) as pool:
        yield from pool.map(function, items)


THREADS = Checkpoint(parallel_map=_run_threaded)  # nothing is stored; threads of this process share the work


def grow_models(
    examples: Sequence[Example],
    config: CoupledConfig,
    monitor: Monitor,
    work: Checkpoint = THREADS,
    start: CoupledModel | None = None,
) -> Iterator[Callable[[], Fit[CoupledModel]]]:
    """Yield functions that return models of 1, 2, 4, … Gaussians, and figures of the training; the last is the result.

    start : a model of them, of the same examples, from which to go on: those of more Gaussians follow
    Figures are ``frames``, ``joint_states``, and ``converged``: whether EM with the greatest number of Gaussians
    ended for want of gain (1), not after the greatest number of steps (0).
    Examples without observed motion are for the second stage of training, which re-estimates the densities of speech
    from more speakers (``speech_only``). The first stage ignores them, and so does what follows the second: the
    regression of visual means, and variance scaling, which are learned from the examples with motion.
    Raises CorpusError: no example with observed motion, or examples of different channels.
    Raises InputError: no such unit set, or a structure that does not fit together.
    """
    structure = config.structure_with(list_unit_sets(config.chains))
    moving = [example for example in examples if mark_known_dynamics(example.valid).any()]
    space, values = fit_reduced_motion(moving or examples, config.components)
    if all(is_silent(span.label.phone) for example in moving for span in example.speech.units):
        raise CorpusError(f"nothing is said in {len(moving)} examples with motion; learn from speech")
    valid = [mark_known_dynamics(example.valid) for example in moving]
    visual = fit_visual_streams(space, values, valid, config.dynamic)
    data = [
        AlignedUtterance(
            speech_observations(example.speech, visual).with_visual_streams([s.standardised(x) for s in visual], mask),
            example.speech.units,
        )
        for example, x, mask in zip(moving, values, valid, strict=True)
    ]
    speech_only = [
        AlignedUtterance(speech_observations(example.speech, visual), example.speech.units)
        for example in examples
        if not mark_known_dynamics(example.valid).any()
    ]
    rest_pose, closure = _find_rest_pose(moving, values, valid), fit_closure(space.direct_names, values, moving)
    prior = fit_articulation_prior(space, values, moving) if config.articulation else None
    encoding: Predictor | None = None
    if config.uses_encoding and all(example.speech.encoding is not None for example in moving):
        encoding = PREDICTORS.load("encoding").fit(PredictorTraining(moving, values, len(space.direct))).predictor
    first_share, second_share = (0.4, 0.7) if speech_only else (0.7, 0.7)

    def finish(grown: EmResult[Chains, ChainStatistics]) -> Fit[CoupledModel]:
        chains = grown.model
        if speech_only:
            second_monitor = sub_monitor(monitor, first_share, second_share)
            doublings = max(config.speech_only_mixtures // config.mixtures, 1).bit_length()
            report = _make_report("more speech", config.speech_only_steps * doublings, second_monitor)
            chains = train_on_speech(chains, data, speech_only, config, report, work)
        model = CoupledModel(chains, space, visual, None, np.ones(space.dimensions), rest_pose, closure, prior)
        model = replace(model, encoding=encoding)
        if config.dynamic and config.acoustic_regression:
            monitor(Progress("regression of visual means", 1, 1, 0.75))
            model = replace(model, regression=_estimate_regression(model, data))
        if config.dynamic and config.variance_scaling:
            recorded = [x[mask] for x, mask in zip(values, valid, strict=True)]
            model = replace(model, scaling=fit_scaling_factors(recorded, _generate(model, data)))
        monitor(Progress("regression of visual means", 1, 1, 1.0))
        joint_states = model.chains.transitions.product.chain_states.shape[1]
        frames = sum(int(example.valid.sum()) for example in examples)
        return Fit(model, {"frames": frames, "joint_states": joint_states, "converged": float(grown.converged)})

    weight_of = {GEOMETRY: config.visual_weight, EIGENLIPS: config.eigenlips_weight}
    names, weights = (SPEECH, *(s.name for s in visual)), (config.audio_weight, *(weight_of[s.name] for s in visual))
    mixtures = (config.mixtures, *(config.visual_mixtures for _ in visual if structure.kind != HMM))
    report = _make_report("chains", MAX_STEPS * max(mixtures).bit_length(), sub_monitor(monitor, 0, first_share))
    for grown in grow_chains(structure, names, data, mixtures, weights, report, work, start.chains if start else None):
        yield partial(finish, grown)


def _make_report(stage: str, max_steps: int, monitor: Monitor) -> Report:
    """Return a function that reports the steps of a stage of training, ``max_steps`` at most, to the monitor."""
    numbers = itertools.count(1)

    def report(_: int, __: Chains, statistics: ChainStatistics) -> None:
        number = next(numbers)
        monitor(Progress(stage, number, max_steps, number / max_steps, statistics.mean_log_likelihood))

    return report


def _find_rest_pose(examples: Sequence[Example], values: Sequence[Array], valid: Sequence[NDArray[np.bool_]]) -> Array:
    """Return the median pose of silence away from speech, or that of all frames if there is none [shape=(Q,)]."""
    away = (mark_distant(example.speech.units, len(example.valid), AWAY_FROM_SPEECH_S) for example in examples)
    poses = np.concatenate([x[mask & silent] for x, mask, silent in zip(values, valid, away, strict=True)])
    if not len(poses):
        poses = np.concatenate([x[mask] for x, mask in zip(values, valid, strict=True)])
    return np.median(poses, axis=0)


def _estimate_regression(
    model: CoupledModel, data: Sequence[AlignedUtterance]
) -> tuple[RegressionInputs, tuple[VisualRegression, ...]]:
    """Return the regression of visual means on acoustic features and on the posteriors given speech alone."""
    chains, structure = model.chains, model.chains.structure
    visual_chains = [structure.chain_of(stream + 1) for stream in range(len(model.visual))]

    def infer_chains(utterance: AlignedUtterance) -> tuple[NDArray[np.float32], ...]:
        """Return the posteriors of the states of all chains given speech alone, without transcript."""
        return chains.infer(utterance.observations.without_visual_streams(), chains.full_lattice).posteriors.chains

    posteriors = list(_run_threaded(infer_chains, data))
    axes = fit_axes(first for first, *_ in posteriors)
    utterances = [
        RegressionUtterance(
            utterance.observations.streams[0],
            of_chains[0] @ axes,
            [of_chains[chain] for chain in visual_chains],
            utterance.observations.streams[1:],
            np.asarray(utterance.observations.observed[1]),
        )
        for utterance, of_chains in zip(data, posteriors, strict=True)
    ]
    inputs, regressions = fit_regression_inputs(axes, utterances), []
    for stream, chain in enumerate(visual_chains):  # each state of each viseme has a regression
        visemes = [VISEME_OF[structure.chains[chain].phones(unit)[0]] for unit in structure.units[chain]]
        numbers = np.unique(visemes, return_inverse=True)[1]
        family = np.repeat(np.arange(numbers.max() + 1), structure.states)
        of_state = (numbers[:, None] * structure.states + np.arange(structure.states)).ravel().astype(np.intp)
        regressions.append(fit_visual_regression(inputs, utterances, stream, of_state, family))
    return inputs, tuple(regressions)


def _generate(model: CoupledModel, data: Sequence[AlignedUtterance]) -> list[Array]:
    """Return what a model generates for utterances, in the frames whose motion was observed [each shape=(N, Q)]."""
    chains = model.chains

    def generate(utterance: AlignedUtterance) -> Array:
        speech = utterance.observations.without_visual_streams()
        motion, _ = solve_mlpg(*model.motion_statistics(chains.infer(speech, chains.full_lattice)))
        return motion[utterance.observations.observed[1]]

    return list(_run_threaded(generate, data))
