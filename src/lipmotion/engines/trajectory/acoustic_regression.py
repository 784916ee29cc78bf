"""Training of the regression of means on the acoustic features around a frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.trajectory.emission import AcousticRegression, Emission, add_acoustic_regression
from lipmotion.engines.trajectory.training_data import TrainingClip, TrainingOptions, density_rows
from lipmotion.motion.context_window import AcousticContext, fit_acoustic_context
from lipmotion.stats.tree_regression import (
    RegressionStatistics,
    fit_tree_regressions,
    regression_node,
    ridge,
    zero_statistics,
)

Array = NDArray[np.float64]
SHARE_DIVISOR = 170
"""A node with a regression of its own has at least 1/170 of all frames; more regressions make the model larger: 450
instead of 200 gained 0.001 on the validation list."""
CLIPS_PER_BLOCK = 64
"""Examples of a block; the frames of a block are sorted by the node whose regression they belong to."""


def fit_acoustic_regression(emission: Emission, clips: Sequence[TrainingClip], options: TrainingOptions) -> Emission:
    """Return the densities with means that are regressed on acoustic features, and variances around these means.

    Every node of the trees with enough frames has a linear regression on the features around the frame, shrunk towards
    that of its parent node, so that states with few frames share the regression of their relatives.
    """
    context = fit_acoustic_context((clip.features for clip in clips), options.acoustic_components)
    owners = _owners(emission, options)
    components, outputs = context.basis.shape[1], emission.means[0].size
    statistics = {node: zero_statistics(components, outputs) for node in dict.fromkeys(owners) if node is not None}
    for node, z, error in _frames(emission, clips, options, context, owners):
        statistics[node].add(z, error)
    coefficients, index = _coefficients(emission, statistics, options)
    rows = np.array([-1 if node is None else index[node] for node in owners], np.int32)
    regression = AcousticRegression(context, coefficients, rows)
    return replace(emission, regression=regression, variances=_variances(emission, regression, clips, options))


_Node = tuple[str, int]
"""A node of a tree: name of the tree, number of the node."""


def _owners(emission: Emission, options: TrainingOptions) -> list[_Node | None]:
    """Return, for every density, the node whose regression it uses; None for the rest pose."""
    least = max(options.ridge_frames, sum(float(tree.frames[0]) for tree in emission.forest.values()) / SHARE_DIVISOR)
    owners: list[_Node | None] = []
    for name, tree in emission.forest.items():
        owners += [(name, regression_node(tree, tree.path_to(int(leaf)), least)) for leaf in tree.leaves]
    return [*owners, None]


def _frames(
    emission: Emission,
    clips: Sequence[TrainingClip],
    options: TrainingOptions,
    context: AcousticContext,
    owners: Sequence[_Node | None],
) -> Iterator[tuple[_Node, NDArray[np.float32], NDArray[np.float32]]]:
    """Yield, block by block, the frames of each node with a regression.

    Each item is the node, the reduced features around its frames [shape=(N, F)], and the motion in these frames minus
    the mean of its density [shape=(N, 3·Q)].
    """
    numbers = {node: number for number, node in enumerate(dict.fromkeys(owners))}
    nodes, of_row = list(numbers), np.array([numbers[node] for node in owners])
    for start in range(0, len(clips), CLIPS_PER_BLOCK):
        block = clips[start : start + CLIPS_PER_BLOCK]
        rows = np.concatenate([density_rows(emission, clip.training_states, options.layout) for clip in block])
        z = np.concatenate([context(clip.features, clip.frames) for clip in block])
        error = np.concatenate([clip.rows for clip in block]) - emission.means[rows]
        order = np.argsort(of_row[rows], kind="stable")
        z, error = z[order], error[order].reshape(len(order), -1).astype(np.float32)
        present, first = np.unique(of_row[rows][order], return_index=True)
        for number, begin, end in zip(present, first, [*first[1:], len(order)], strict=True):
            node = nodes[number]
            if node is not None:
                yield node, z[begin:end], error[begin:end]


def _coefficients(
    emission: Emission, statistics: dict[_Node, RegressionStatistics], options: TrainingOptions
) -> tuple[NDArray[np.float32], dict[_Node, int]]:
    """Return the coefficients of all regressions [shape=(R, F, 3·Q)], and the number of the regression of each node."""
    all_statistics = list(statistics.values())
    total = sum(all_statistics[1:], all_statistics[0])
    shared = ridge(total, np.zeros_like(all_statistics[0].targets), options.shared_ridge)
    matrices: dict[_Node, Array] = {}
    for name, tree in emission.forest.items():
        own = {node: statistics[tree_name, node] for tree_name, node in statistics if tree_name == name}
        fitted = fit_tree_regressions(tree, own, shared, options.ridge)
        matrices |= {(name, node): matrix for node, matrix in fitted.items()}
    index = {node: number for number, node in enumerate(matrices)}
    return np.array(list(matrices.values()), np.float32), index


def _variances(
    emission: Emission, regression: AcousticRegression, clips: Sequence[TrainingClip], options: TrainingOptions
) -> NDArray[np.float32]:
    """Return the variances around the regressed means, shrunk towards those of all frames together."""
    squares, counts = np.zeros(emission.means.shape), np.zeros(len(emission.means))
    for clip in clips:
        rows = density_rows(emission, clip.training_states, options.layout)
        means = emission.means[rows].astype(float)
        add_acoustic_regression(means, regression, rows, regression.context(clip.features, clip.frames))
        np.add.at(squares, rows, np.square(clip.rows - means))
        np.add.at(counts, rows, 1)
    return _shrunk(emission, squares, counts, options.variance_shrinkage)


def _shrunk(emission: Emission, squares: Array, counts: Array, strength: float) -> NDArray[np.float32]:
    """Return the variances of all densities [shape=(L, 3, Q)], shrunk towards their prior.

    squares  : sums of squared deviations from the regressed means [shape=(L, 3, Q)]
    counts   : frames of each density [shape=(L,)]
    strength : weight of the prior, in frames
    """
    before = emission.variances.astype(float)
    ratio = squares[:-1].sum(axis=0) / np.maximum((before[:-1] * counts[:-1, None, None]).sum(axis=0), 1e-30)
    prior = before * np.clip(ratio, 0, 1)  # variances without regression, reduced by the mean share that it explains
    after = (squares + strength * prior) / (counts + strength)[:, None, None]
    after[-1] = before[-1]  # the rest pose has no regression
    return np.maximum(after, 1e-3 * before).astype(np.float32)
