"""Training of the trajectory engine: decision trees, emission densities, variance scaling."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.trajectory.acoustic_regression import fit_acoustic_regression
from lipmotion.engines.trajectory.emission import Emission
from lipmotion.engines.trajectory.experts import NETWORK_SHARE, Experts
from lipmotion.engines.trajectory.model import TrajectoryModel
from lipmotion.engines.trajectory.training_data import TrainingClip, TrainingOptions, density_rows
from lipmotion.errors import CorpusError
from lipmotion.hmm.multistream.phone_recogniser import fit_phone_recogniser
from lipmotion.kernels.sequences.banded import generate
from lipmotion.motion.articulation import ArticulationPrior, fit_articulation_prior
from lipmotion.motion.closure import fit_closure
from lipmotion.motion.frame_labels import FullContextState, StateLayout, full_context_states
from lipmotion.motion.modulation_filter import learned_filter
from lipmotion.motion.predictors import Predictor, PredictorTraining, folds, suitable_predictor
from lipmotion.motion.space import fit_reduced_motion
from lipmotion.motion.variance_scaling import scaling_factors
from lipmotion.stats.delta_windows import dynamics_known, with_dynamics
from lipmotion.stats.trees import Question, Tree, gaussian_log_likelihood, grow_tree
from lipmotion.storage.checkpoint import NO_CHECKPOINT, Checkpoint
from lipmotion.types import Example, Monitor, Progress, sub_monitor

Array = NDArray[np.float64]
LEAST_VARIANCE_SHARE, LEAST_VARIANCE = 1e-3, 1e-12
"""Smallest variance: a share of the variance of all frames, and a constant for dimensions that never move."""


def fit_trajectory(
    examples: Sequence[Example], options: TrainingOptions, monitor: Monitor, checkpoint: Checkpoint = NO_CHECKPOINT
) -> TrajectoryModel:
    """Return a model of the motion: densities of full-context states, tied by decision trees.

    Raises CorpusError: no example with valid motion in speech, or examples of different channels.
    """
    space, values = fit_reduced_motion(examples, options.components)
    phone_recogniser = None
    if options.joint_recogniser:
        phone_recogniser = fit_phone_recogniser(examples, values, sub_monitor(monitor, 0, 0.3), checkpoint)
    monitor = sub_monitor(monitor, 0.3, 1)
    clips = [training_clip(example, x, options.layout) for example, x in zip(examples, values, strict=True)]
    layout = options.layout
    states = (state for clip in clips for state in clip.training_states)
    covered = {layout.name(state) for state in states if state.unit not in layout.units.silence}
    if len(covered) < layout.speech:
        raise CorpusError(
            f"motion was seen in {len(covered)} of {layout.speech} states of a phone; learn from more speech"
        )
    monitor(Progress(_STAGE, 1, 3, 0.1))
    emission = _fit_emission(clips, options)
    if options.acoustic_regression:
        monitor(Progress(_STAGE, 2, 3, 0.3))
        emission = fit_acoustic_regression(emission, clips, options)
    prior = fit_articulation_prior(space, values, examples) if options.articulation else None
    network: Predictor | None = None
    share = NETWORK_SHARE
    kind, direct = suitable_predictor(options.predictor, examples), len(space.direct)
    if kind is not None:
        of_predictor = sub_monitor(monitor, 0.4, 0.99)
        network, held_out = kind.fit(
            PredictorTraining(examples, values, direct, options.epochs, of_predictor, checkpoint)
        )
        if held_out is not None:
            share = _share_of_predictor(held_out, clips, options, direct)
    recorded, generated = _recorded_and_generated(emission, network, prior, share, clips, layout)
    factors = scaling_factors(recorded, generated) if recorded else np.ones(emission.means.shape[2])
    scaled = ((original, factors * made) for original, made in zip(recorded, generated, strict=True))
    modulation = learned_filter(options.modulation_filter, scaled, examples, values)
    monitor(Progress(_STAGE, 3, 3, 1.0))
    closure = fit_closure(space.direct_names, values, examples)
    return TrajectoryModel(
        options.layout.units, space, emission, factors, closure, phone_recogniser, network, prior, share, modulation
    )


_STAGE = "trees"
"""Name of this stage in reports of progress."""


def _share_of_predictor(
    predictions: Sequence[Array], clips: Sequence[TrainingClip], options: TrainingOptions, direct: int
) -> float:
    """Return the weight of a predictor beside the states, by cross-validation: 0 to 1.

    predictions : of each clip by predictors that were trained on the other folds [each shape=(T, Q)]
    direct      : number of channels that are modelled as they are; the weight is chosen for them
    The states are trained on the same folds. With a single clip, the predictor has all the weight.
    """
    if len(clips) < 2:
        return 1.0
    products = squares = 0.0
    for inside, outside in folds(len(clips)):
        emission = _fit_emission([clips[number] for number in inside], options)
        if options.acoustic_regression:
            emission = fit_acoustic_regression(emission, [clips[number] for number in inside], options)
        for number in outside:
            clip = clips[number]
            rows = density_rows(emission, clip.states, options.layout)
            states = generate(*emission.statistics(rows, clip.features, slice(None)))[0][clip.frames, :direct]
            recorded, predicted = clip.rows[:, 0, :direct], predictions[number][clip.frames, :direct]
            spread = np.maximum(recorded.std(axis=0), 1e-6)
            change = (predicted - states) / spread
            products += float((change * (recorded - states) / spread).sum())
            squares += float(np.square(change).sum())
    return float(np.clip(products / max(squares, 1e-12), 0, 1))


def _recorded_and_generated(
    emission: Emission,
    network: Predictor | None,
    prior: ArticulationPrior | None,
    share: float,
    clips: Sequence[TrainingClip],
    layout: StateLayout,
) -> tuple[list[NDArray[np.float32]], list[Array]]:
    """Return recorded and generated motion in the valid frames of every clip that has two [each shape=(N, Q)]."""
    recorded: list[NDArray[np.float32]] = []
    generated: list[Array] = []
    for clip in clips:
        if len(clip.frames) < 2:
            continue
        rows = density_rows(emission, clip.states, layout)
        means, precisions = Experts(emission, rows, clip.speech, network, prior, share).statistics(slice(None))
        recorded.append(clip.rows[:, 0])
        generated.append(generate(means, precisions)[0][clip.frames])
    return recorded, generated


def training_clip(example: Example, values: Array, layout: StateLayout) -> TrainingClip:
    """Return an example prepared for training.

    values : its motion in the motion space [shape=(T, Q)]
    """
    frames = np.nonzero(dynamics_known(example.valid))[0]
    states = full_context_states(example.speech.units, len(values), layout)
    dynamics = with_dynamics(values)[frames].astype(np.float32)
    return TrainingClip(example.speech, states, frames, dynamics)


def _fit_emission(clips: Sequence[TrainingClip], options: TrainingOptions) -> Emission:
    """Return the Gaussians of all leaves; each mean and variance is shrunk towards that of its parent node."""
    rest = options.layout.rest
    moving = np.concatenate(
        [clip.rows[[state != rest for state in clip.training_states]] for clip in clips], dtype=np.float64
    )
    centre, overall = moving.mean(axis=0), moving.var(axis=0)
    least = np.maximum(LEAST_VARIANCE_SHARE * overall, LEAST_VARIANCE)
    scale = np.sqrt(np.maximum(overall, least))
    grouped = _context_moments(clips, options.layout, centre, scale)
    forest = {name: _grow_tree(contexts, 2 * overall.size, options) for name, contexts in grouped.items()}
    leaves = [
        gaussian
        for name, tree in forest.items()
        for gaussian in _leaf_gaussians(tree, grouped[name], overall.size, options)
    ]
    means, variances = (np.array(rows).reshape(-1, *overall.shape) for rows in zip(*leaves, strict=True))
    rest_mean, rest_variance = _rest_gaussian(clips, options, centre, overall)
    means = np.concatenate([means * scale + centre, rest_mean[None]])
    variances = np.concatenate([variances * scale * scale, rest_variance[None]])
    return Emission(forest, means.astype(np.float32), np.maximum(variances, least).astype(np.float32), None)


def _grow_tree(contexts: _Contexts, parameters: int, options: TrainingOptions) -> Tree:
    """Return the decision tree of one state; a single leaf where no training frame is in this state."""
    empty = {options.layout.rest.context: np.zeros(1 + parameters)}
    return grow_tree(
        list(contexts or empty),
        np.array(list((contexts or empty).values())),
        [Question(place, *unit_class) for place in range(3) for unit_class in options.layout.units.classes().items()],
        gaussian_log_likelihood,
        parameters=parameters,
        factor=options.tree_factor,
        least=options.least_frames,
    )


_Contexts = dict[tuple[str, str, str], Array]
"""Count, sums and sums of squares of the frames of every context [each shape=(1 + 2·3·Q,)]."""


def _context_moments(
    clips: Sequence[TrainingClip], layout: StateLayout, centre: Array, scale: Array
) -> dict[str, _Contexts]:
    """Return the moments of the standardised frames of every context, for each state by name."""
    grouped: dict[str, _Contexts] = {name: {} for name in layout.names}
    for clip in clips:
        index: dict[FullContextState, list[int]] = {}
        for number, state in enumerate(clip.training_states):
            index.setdefault(state, []).append(number)
        for state, numbers in index.items():
            if state == layout.rest:
                continue
            rows = ((clip.rows[numbers] - centre) / scale).reshape(len(numbers), -1)
            moments = np.concatenate([[len(rows)], rows.sum(axis=0), (rows * rows).sum(axis=0)])
            contexts = grouped[layout.name(state)]
            contexts[state.context] = contexts.get(state.context, 0) + moments
    return grouped


def _leaf_gaussians(tree: Tree, contexts: _Contexts, size: int, options: TrainingOptions) -> list[tuple[Array, Array]]:
    """Return mean and variance [each shape=(3·Q,)] of every leaf, in standardised units."""
    totals = np.zeros((len(tree.asked), 1 + 2 * size))
    parents = np.full(len(tree.asked), -1)
    for context, moments in contexts.items():
        path = tree.path(context)
        totals[path] += moments
        parents[path[1:]] = path[:-1]
    means, variances = np.zeros((len(tree.asked), size)), np.ones((len(tree.asked), size))
    for node, (total, parent) in enumerate(zip(totals, parents, strict=True)):
        count, sums, squares = total[0], total[1 : 1 + size], total[1 + size :]
        mean, variance = (means[parent], variances[parent]) if parent >= 0 else (np.zeros(size), np.ones(size))
        means[node] = (sums + options.shrinkage * mean) / (count + options.shrinkage)
        deviations = squares - 2 * means[node] * sums + count * means[node] ** 2
        variances[node] = (deviations + options.variance_shrinkage * variance) / (count + options.variance_shrinkage)
    return [(means[leaf], variances[leaf]) for leaf in tree.leaves]


def _rest_gaussian(
    clips: Sequence[TrainingClip], options: TrainingOptions, fallback: Array, overall: Array
) -> tuple[Array, Array]:
    """Return mean and variance [each shape=(3, Q)] of the rest pose: the median pose in silence away from speech.

    Movements in these frames (breath, a lick of the lips) are not speech: Δ and Δ² have mean 0 and a small variance.
    """
    poses = [
        clip.rows[number, 0]
        for clip in clips
        for number, state in enumerate(clip.training_states)
        if state == options.layout.rest
    ]
    if not poses:
        return fallback, overall
    mean = np.zeros_like(overall)
    mean[0] = np.median(poses, axis=0)
    return mean, options.variance_shrinkage * overall / (len(poses) + options.variance_shrinkage)
