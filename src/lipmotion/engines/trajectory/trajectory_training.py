"""The training of the trajectory engine: decision trees, emission densities, variance scaling."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.trajectory.model import (
    NETWORK_SHARE,
    AcousticRegression,
    Emission,
    Experts,
    TrajectoryConfig,
    TrajectoryModel,
)
from lipmotion.errors import CorpusError
from lipmotion.hmm.multistream.phone_recogniser import fit_phone_recogniser
from lipmotion.kernels.banded import solve_mlpg
from lipmotion.motion.articulation import fit_articulation_prior
from lipmotion.motion.closure import fit_closure
from lipmotion.motion.context_window import fit_acoustic_context
from lipmotion.motion.frame_labels import FullContextState, StateLayout, label_full_context
from lipmotion.motion.generation import fit_scaling_factors
from lipmotion.motion.modulation_filter import learn_filter
from lipmotion.motion.predictors import PredictorTraining, choose_predictor, split_folds
from lipmotion.motion.space import fit_reduced_motion
from lipmotion.stats.curves import mark_known_dynamics, with_dynamics
from lipmotion.stats.trees import (
    Question,
    Tree,
    create_statistics,
    fit_tree_regressions,
    grow_tree,
    ridge,
    score_gaussian,
)
from lipmotion.storage.archive import NO_CHECKPOINT, Checkpoint
from lipmotion.types import Example, Monitor, Progress, Speech, sub_monitor
from lipmotion.units import load_unit_set


@dataclass(frozen=True, eq=False)
class TrainingClip:
    """One example, prepared for training.

    states   : full-context state of each frame [length T]
    frames   : int array [shape=(N,)], the frames that are valid and have valid neighbours
    rows     : float32 array [shape=(N, 3, Q)], static value, Δ and Δ² of the motion in these frames
    """

    speech: Speech
    states: list[FullContextState]
    frames: NDArray[np.intp]
    rows: NDArray[np.float32]

    @property
    def training_states(self) -> list[FullContextState]:
        """Full-context state of each frame of ``frames`` [length N]."""
        return [self.states[frame] for frame in self.frames]


Array = NDArray[np.float64]
SHARE_DIVISOR = 170
"""A node with a regression of its own has at least 1/170 of all frames; more regressions make the model larger: 450
instead of 200 gained 0.001 on the validation list."""
CLIPS_PER_BLOCK = 64
"""Examples of a block; the frames of a block are sorted by the node whose regression they belong to."""


def fit_acoustic_regression(emission: Emission, clips: Sequence[TrainingClip], options: TrajectoryConfig) -> Emission:
    """Return the densities with means that are regressed on acoustic features, and variances around these means.

    Every node of the trees with enough frames has a linear regression on the features around the frame, shrunk towards
    that of its parent node, so that states with few frames share the regression of their relatives.
    """
    context = fit_acoustic_context((clip.speech.features.values for clip in clips), options.acoustic_components)
    frames = sum(float(tree.frames[0]) for tree in emission.forest.values())
    min_frames = max(options.ridge_frames, frames / SHARE_DIVISOR)
    owners: list[_Node | None] = []  # of each density, the last node on its path with enough frames; or the root
    for name, tree in emission.forest.items():
        for leaf in tree.leaves.tolist():
            path = reversed(tree.path_to(leaf))
            owners.append((name, next((node for node in path if tree.frames[node] >= min_frames), 0)))
    nodes = list(dict.fromkeys(owners))
    owners.append(None)  # the rest pose
    size = context.basis.shape[1], emission.means[0].size
    statistics = {node: create_statistics(*size) for node in nodes if node is not None}
    number_of_row = np.array([nodes.index(node) if node is not None else len(nodes) for node in owners])
    for start in range(0, len(clips), CLIPS_PER_BLOCK):
        block = clips[start : start + CLIPS_PER_BLOCK]
        rows = np.concatenate([emission.rows(clip.training_states) for clip in block])
        z = np.concatenate([context(clip.speech.features.values, clip.frames) for clip in block])
        error = np.concatenate([clip.rows for clip in block]) - emission.means[rows]
        order = np.argsort(number_of_row[rows], kind="stable")
        z, error = z[order], error[order].reshape(len(order), -1).astype(np.float32)
        present, first = np.unique(number_of_row[rows][order], return_index=True)
        for number, begin, end in zip(present, first, [*first[1:], len(order)], strict=True):
            if number < len(nodes):
                statistics[nodes[number]].add(z[begin:end], error[begin:end])
    total = sum(list(statistics.values())[1:], next(iter(statistics.values())))
    shared = ridge(total, np.zeros_like(total.targets), options.shared_ridge)
    matrices: dict[_Node, Array] = {}
    for name, tree in emission.forest.items():
        of_tree = {node: statistics[tree_name, node] for tree_name, node in statistics if tree_name == name}
        fitted = fit_tree_regressions(tree, of_tree, shared, options.ridge)
        matrices |= {(name, node): matrix for node, matrix in fitted.items()}
    index = {node: number for number, node in enumerate(matrices)}
    rows = np.array([-1 if node is None else index[node] for node in owners], np.int32)
    regression = AcousticRegression(context, np.array(list(matrices.values()), np.float32), rows)
    emission = replace(emission, regression=regression)
    return replace(emission, variances=_variances(emission, clips, options))


_Node = tuple[str, int]  # a node of a tree: name of the tree, number of the node


def _variances(emission: Emission, clips: Sequence[TrainingClip], options: TrajectoryConfig) -> NDArray[np.float32]:
    """Return the variances around the regressed means, shrunk towards those of all frames together."""
    squares, counts = np.zeros(emission.means.shape), np.zeros(len(emission.means))
    for clip in clips:
        rows = emission.rows(clip.training_states)
        means, _ = emission.statistics(rows, clip.speech.features.values, clip.frames)
        np.add.at(squares, rows, np.square(clip.rows - means))
        np.add.at(counts, rows, 1)
    strength = options.variance_shrinkage
    before = emission.variances.astype(float)
    ratio = squares[:-1].sum(axis=0) / np.maximum((before[:-1] * counts[:-1, None, None]).sum(axis=0), 1e-30)
    prior = before * np.clip(ratio, 0, 1)  # variances without regression, reduced by the mean share that it explains
    after = (squares + strength * prior) / (counts + strength)[:, None, None]
    after[-1] = before[-1]  # the rest pose has no regression
    return np.maximum(after, 1e-3 * before).astype(np.float32)


MIN_VARIANCE_SHARE, MIN_VARIANCE = 1e-3, 1e-12
"""Smallest variance: a share of the variance of all frames, and a constant for dimensions that never move."""


def fit_trajectory(
    examples: Sequence[Example], options: TrajectoryConfig, monitor: Monitor, checkpoint: Checkpoint = NO_CHECKPOINT
) -> TrajectoryModel:
    """Return a model of the motion: densities of full-context states, tied by decision trees.

    Raises CorpusError: no example with valid motion in speech, or examples of different channels.
    """
    space, values = fit_reduced_motion(examples, options.components)
    phone_recogniser = None
    if options.joint_recogniser:
        phone_recogniser = fit_phone_recogniser(examples, values, sub_monitor(monitor, 0, 0.3), checkpoint)
    monitor = sub_monitor(monitor, 0.3, 1)
    layout = options.layout(load_unit_set(options.units))
    clips = []
    for example, x in zip(examples, values, strict=True):
        frames = np.nonzero(mark_known_dynamics(example.valid))[0]
        rows = with_dynamics(x)[frames].astype(np.float32)
        labels = label_full_context(example.speech.units, len(x), layout)
        clips.append(TrainingClip(example.speech, labels, frames, rows))
    states = (state for clip in clips for state in clip.training_states)
    covered = {layout.name(state) for state in states if state.unit not in layout.units.silence}
    if len(covered) < layout.speech:
        raise CorpusError(f"{len(covered)} of {layout.speech} states of a phone have motion; learn from more speech")
    monitor(Progress(_STAGE, 1, 3, 0.1))
    emission = _fit_emission(clips, options, layout)
    if options.acoustic_regression:
        monitor(Progress(_STAGE, 2, 3, 0.3))
        emission = fit_acoustic_regression(emission, clips, options)
    prior = fit_articulation_prior(space, values, examples) if options.articulation else None
    network, share, direct = None, NETWORK_SHARE, len(space.direct)
    kind = choose_predictor(options.predictor, examples)
    if kind is not None:
        predictor_monitor = sub_monitor(monitor, 0.4, 0.99)
        training = PredictorTraining(examples, values, direct, options.epochs, predictor_monitor, checkpoint)
        network, held_out = kind.fit(training)
        if held_out is not None:
            share = _weigh_predictor(held_out, clips, options, layout, direct)
    recorded, generated = list[NDArray[np.float32]](), list[Array]()
    for clip in clips:
        if len(clip.frames) >= 2:
            experts = Experts(emission, emission.rows(clip.states), clip.speech, network, prior, share)
            recorded.append(clip.rows[:, 0])
            generated.append(solve_mlpg(*experts.statistics(slice(None)))[0][clip.frames])
    factors = fit_scaling_factors(recorded, generated) if recorded else np.ones(emission.means.shape[2])
    scaled = ((original, factors * made) for original, made in zip(recorded, generated, strict=True))
    modulation = learn_filter(options.modulation_filter, scaled, examples, values)
    monitor(Progress(_STAGE, 3, 3, 1.0))
    closure = fit_closure(space.direct_names, values, examples)
    return TrajectoryModel(
        layout.units, space, emission, factors, closure, phone_recogniser, network, prior, share, modulation
    )


_STAGE = "trees"


def _weigh_predictor(
    predictions: Sequence[Array],
    clips: Sequence[TrainingClip],
    options: TrajectoryConfig,
    layout: StateLayout,
    direct: int,
) -> float:
    """Return the weight of a predictor beside the states, by cross-validation over the same folds: 0 to 1."""
    if len(clips) < 2:
        return 1.0
    products = squares = 0.0
    for inside, outside in split_folds(len(clips)):
        learned = [clips[number] for number in inside]
        emission = _fit_emission(learned, options, layout)
        if options.acoustic_regression:
            emission = fit_acoustic_regression(emission, learned, options)
        for number in outside:
            clip, features = clips[number], clips[number].speech.features.values
            means, precisions = emission.statistics(emission.rows(clip.states), features, slice(None))
            states = solve_mlpg(means, precisions)[0][clip.frames, :direct]
            recorded, predicted = clip.rows[:, 0, :direct], predictions[number][clip.frames, :direct]
            spread = np.maximum(recorded.std(axis=0), 1e-6)
            change = (predicted - states) / spread
            products += float((change * (recorded - states) / spread).sum())
            squares += float(np.square(change).sum())
    return float(np.clip(products / max(squares, 1e-12), 0, 1))


def _fit_emission(clips: Sequence[TrainingClip], options: TrajectoryConfig, layout: StateLayout) -> Emission:
    """Return the Gaussians of all leaves; each mean and variance is shrunk towards that of its parent node."""
    moves = ([state != layout.rest for state in clip.training_states] for clip in clips)
    rows = [clip.rows[inside] for clip, inside in zip(clips, moves, strict=True)]
    moving = np.concatenate(rows, dtype=np.float64)
    centre, overall = moving.mean(axis=0), moving.var(axis=0)
    floor = np.maximum(MIN_VARIANCE_SHARE * overall, MIN_VARIANCE)
    scale = np.sqrt(np.maximum(overall, floor))
    grouped = _sum_context_moments(clips, layout, centre, scale)
    questions = [Question(place, *unit_class) for place in range(3) for unit_class in layout.units.classes().items()]
    empty = {layout.rest.context: np.zeros(1 + 2 * overall.size)}  # a state without any frame has a single leaf
    forest = {
        name: grow_tree(
            list(contexts or empty),
            np.array(list((contexts or empty).values())),
            questions,
            score_gaussian,
            parameters=2 * overall.size,
            factor=options.tree_factor,
            min_frames=options.least_frames,
        )
        for name, contexts in grouped.items()
    }
    fitted = (_fit_leaves(tree, grouped[name], overall.size, options) for name, tree in forest.items())
    leaves = [gaussian for of_tree in fitted for gaussian in of_tree]
    means, variances = (np.array(rows).reshape(-1, *overall.shape) for rows in zip(*leaves, strict=True))
    poses = [
        clip.rows[number, 0]
        for clip in clips
        for number, state in enumerate(clip.training_states)
        if state == layout.rest
    ]
    rest_mean, rest_variance = centre, overall
    if poses:  # the rest pose is the median pose in silence away from speech
        rest_mean = np.zeros_like(overall)
        rest_mean[0] = np.median(poses, axis=0)
        rest_variance = options.variance_shrinkage * overall / (len(poses) + options.variance_shrinkage)
    means = np.concatenate([means * scale + centre, rest_mean[None]])
    variances = np.concatenate([variances * scale * scale, rest_variance[None]])
    return Emission(layout, forest, means.astype(np.float32), np.maximum(variances, floor).astype(np.float32), None)


_Contexts = dict[tuple[str, str, str], Array]
"""Count, sums and sums of squares of the frames of every context [each shape=(1 + 2·3·Q,)]."""


def _sum_context_moments(
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


def _fit_leaves(tree: Tree, contexts: _Contexts, size: int, options: TrajectoryConfig) -> list[tuple[Array, Array]]:
    """Return mean and variance [each shape=(3·Q,)] of every leaf, in standardised units."""
    totals = np.zeros((len(tree.splits), 1 + 2 * size))
    parents = np.full(len(tree.splits), -1)
    for context, moments in contexts.items():
        path = tree.path(context)
        totals[path] += moments
        parents[path[1:]] = path[:-1]
    means, variances = np.zeros((len(tree.splits), size)), np.ones((len(tree.splits), size))
    for node, (total, parent) in enumerate(zip(totals, parents, strict=True)):
        count, sums, squares = total[0], total[1 : 1 + size], total[1 + size :]
        mean, variance = (means[parent], variances[parent]) if parent >= 0 else (np.zeros(size), np.ones(size))
        means[node] = (sums + options.shrinkage * mean) / (count + options.shrinkage)
        deviations = squares - 2 * means[node] * sums + count * means[node] ** 2
        variances[node] = (deviations + options.variance_shrinkage * variance) / (count + options.variance_shrinkage)
    return [(means[leaf], variances[leaf]) for leaf in tree.leaves]
