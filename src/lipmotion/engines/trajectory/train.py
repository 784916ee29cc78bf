"""Learning how the mouth moves in every part of every unit in context."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.trajectory.acoustic_regression import fit_acoustic_regression
from lipmotion.engines.trajectory.emission import Emission
from lipmotion.engines.trajectory.model import TrajectoryModel
from lipmotion.engines.trajectory.phone_recogniser import fit_phone_recogniser
from lipmotion.engines.trajectory.training_data import TrainingClip, TrainingOptions, density_rows
from lipmotion.errors import CorpusError
from lipmotion.kernels.banded import generate
from lipmotion.motion.closure import fit_closure
from lipmotion.motion.frame_labels import FullContextState, StateLayout, full_context_states
from lipmotion.motion.space import fit_reduced_motion
from lipmotion.motion.variance_scaling import scaling_factors
from lipmotion.stats.delta_windows import dynamics_known, with_dynamics
from lipmotion.stats.trees import Question, Tree, gaussian_log_likelihood, grow_tree
from lipmotion.storage.checkpoint import NO_CHECKPOINT, Checkpoint
from lipmotion.types import Example, Monitor, Progress, sub_monitor

Array = NDArray[np.float64]
LEAST_VARIANCE_SHARE, LEAST_VARIANCE = 1e-3, 1e-12
"""No variance falls under this share of the overall one, nor under this: some dimensions never move."""


def fit_trajectory(
    examples: Sequence[Example], how: TrainingOptions, monitor: Monitor, checkpoint: Checkpoint = NO_CHECKPOINT
) -> TrajectoryModel:
    """Return densities of the motion for every part of a phone in context, tied by decision trees.

    Raises CorpusError: no example with motion that was seen in speech, or examples of different channels.
    """
    space, values = fit_reduced_motion(examples, how.components)
    listener = None
    if how.joint_recogniser:
        listener = fit_phone_recogniser(examples, values, sub_monitor(monitor, 0, 0.8), checkpoint)
    monitor = sub_monitor(monitor, 0.8, 1)
    observed = [training_clip(example, x, how.layout) for example, x in zip(examples, values, strict=True)]
    quiet = how.layout.units.silence
    covered = {how.layout.name(place) for one in observed for place in one.training_states if place.unit not in quiet}
    if len(covered) < how.layout.speech:
        raise CorpusError(
            f"motion was seen in {len(covered)} of {how.layout.speech} parts of a phone; learn from more speech"
        )
    monitor(Progress(_STAGE, 1, 3, 0.1))
    emission = _tied(observed, how)
    if how.acoustic_regression:
        monitor(Progress(_STAGE, 2, 3, 0.3))
        emission = fit_acoustic_regression(emission, observed, how)
    gain = _scaling(emission, observed, how)
    monitor(Progress(_STAGE, 3, 3, 1.0))
    closure = fit_closure(space.direct_names, values, examples)
    return TrajectoryModel(how.layout.units, space, emission, gain, closure, listener)


_STAGE = "trees"


def _scaling(emission: Emission, observed: Sequence[TrainingClip], how: TrainingOptions) -> Array:
    """Return the factors of variance scaling [shape=(Q,)]; 1 where no example is long enough to vary."""
    recorded, generated = [], []
    for one in observed:
        if len(one.frames) < 2:
            continue
        means, precisions = emission.statistics(
            density_rows(emission, one.states, how.layout), one.features, slice(None)
        )
        recorded.append(one.rows[:, 0].std(axis=0))
        generated.append(generate(means, precisions)[0][one.frames].std(axis=0))
    return scaling_factors(recorded, generated) if recorded else np.ones(emission.means.shape[2])


def training_clip(example: Example, values: Array, layout: StateLayout) -> TrainingClip:
    """Return what training needs of an example, whose motion in the model's space is ``values`` [shape=(T, Q)]."""
    frames = np.nonzero(dynamics_known(example.valid))[0]
    where = full_context_states(example.speech.units, len(values), layout)
    features = np.asarray(example.speech.features.values)
    dynamics = with_dynamics(values)[frames].astype(np.float32)
    return TrainingClip(features, where, frames, dynamics)


def _tied(observed: Sequence[TrainingClip], how: TrainingOptions) -> Emission:
    """Return the Gaussians of all leaves: each mean and variance is drawn towards that of the node above it."""
    moving = np.concatenate(
        [one.rows[[place != how.layout.rest for place in one.training_states]] for one in observed], dtype=np.float64
    )
    centre, overall = moving.mean(axis=0), moving.var(axis=0)
    least = np.maximum(LEAST_VARIANCE_SHARE * overall, LEAST_VARIANCE)
    scale = np.sqrt(np.maximum(overall, least))
    grouped = _grouped(observed, how.layout, centre, scale)
    forest = {name: _grown(contexts, 2 * overall.size, how) for name, contexts in grouped.items()}
    leaves = [
        gaussian
        for name, tree in forest.items()
        for gaussian in _leaf_gaussians(tree, grouped[name], overall.size, how)
    ]
    means, variances = (np.array(part).reshape(-1, *overall.shape) for part in zip(*leaves, strict=True))
    rest_mean, rest_variance = _rest(observed, how, centre, overall)
    means = np.concatenate([means * scale + centre, rest_mean[None]])
    variances = np.concatenate([variances * scale * scale, rest_variance[None]])
    return Emission(forest, means.astype(np.float32), np.maximum(variances, least).astype(np.float32), None)


def _grown(contexts: _Contexts, parameters: int, how: TrainingOptions) -> Tree:
    """Return the tree of one part; a single leaf where the part was never seen."""
    unseen = {how.layout.rest.context: np.zeros(1 + parameters)}
    return grow_tree(
        list(contexts or unseen),
        np.array(list((contexts or unseen).values())),
        [Question(place, *named) for place in range(3) for named in how.layout.units.classes().items()],
        gaussian_log_likelihood,
        parameters=parameters,
        factor=how.tree_factor,
        least=how.least_frames,
    )


_Contexts = dict[tuple[str, str, str], Array]
"""Count, sums and sums of squares of the frames of every context."""


def _grouped(
    observed: Sequence[TrainingClip], layout: StateLayout, centre: Array, scale: Array
) -> dict[str, _Contexts]:
    """Return the moments of the standardised frames of every context, part by part."""
    grouped: dict[str, _Contexts] = {name: {} for name in layout.names}
    for one in observed:
        index: dict[FullContextState, list[int]] = {}
        for number, place in enumerate(one.training_states):
            index.setdefault(place, []).append(number)
        for place, numbers in index.items():
            if place == layout.rest:
                continue
            rows = ((one.rows[numbers] - centre) / scale).reshape(len(numbers), -1)
            moments = np.concatenate([[len(rows)], rows.sum(axis=0), (rows * rows).sum(axis=0)])
            contexts = grouped[layout.name(place)]
            contexts[place.context] = contexts.get(place.context, 0) + moments
    return grouped


def _leaf_gaussians(tree: Tree, contexts: _Contexts, size: int, how: TrainingOptions) -> list[tuple[Array, Array]]:
    """Return mean and variance [each shape=(3·Q,)] of every leaf, in standardised units."""
    totals = np.zeros((len(tree.asked), 1 + 2 * size))
    above = np.full(len(tree.asked), -1)
    for context, moments in contexts.items():
        path = tree.path(context)
        totals[path] += moments
        above[path[1:]] = path[:-1]
    means, variances = np.zeros((len(tree.asked), size)), np.ones((len(tree.asked), size))
    for node, (total, parent) in enumerate(zip(totals, above, strict=True)):
        count, sums, squares = total[0], total[1 : 1 + size], total[1 + size :]
        mean, variance = (means[parent], variances[parent]) if parent >= 0 else (np.zeros(size), np.ones(size))
        means[node] = (sums + how.shrinkage * mean) / (count + how.shrinkage)
        around = squares - 2 * means[node] * sums + count * means[node] ** 2
        variances[node] = (around + how.variance_shrinkage * variance) / (count + how.variance_shrinkage)
    return [(means[leaf], variances[leaf]) for leaf in tree.leaves]


def _rest(
    observed: Sequence[TrainingClip], how: TrainingOptions, fallback: Array, overall: Array
) -> tuple[Array, Array]:
    """Return the median pose of silence away from speech, and a variance that holds it still.

    What the mouth did there (breath, a lick of the lips) is no speech.
    """
    poses = [
        one.rows[number, 0] for one in observed for number, p in enumerate(one.training_states) if p == how.layout.rest
    ]
    if not poses:
        return fallback, overall
    mean = np.zeros_like(overall)
    mean[0] = np.median(poses, axis=0)
    return mean, how.variance_shrinkage * overall / (len(poses) + how.variance_shrinkage)
