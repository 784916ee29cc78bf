"""Learning how the mouth follows the sound around a frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.trajectory.emission import AcousticRegression, Emission, add_acoustic_regression
from lipmotion.engines.trajectory.training_data import TrainingClip, TrainingOptions, density_rows
from lipmotion.motion.context_window import AcousticContext, fit_acoustic_context
from lipmotion.stats.regression import (
    RegressionStatistics,
    fit_tree_regressions,
    regression_node,
    ridge,
    zero_statistics,
)

Array = NDArray[np.float64]
MOST = 170
"""A node needs at least one part in so many of all frames, or the model gets large: 450 regressions instead of 200
gained 0.001 on the validation list."""
AT_A_TIME = 64
"""Examples whose frames are sorted by what they belong to before they are added up."""


def fit_acoustic_regression(emission: Emission, observed: Sequence[TrainingClip], how: TrainingOptions) -> Emission:
    """Return the same densities with means that follow the sound, and variances around these.

    A linear regression on the sound around the frame is learned from all frames, one for each node of the trees with
    enough of them, drawn towards that of the node above it: so a state with little data listens as its relatives do.
    """
    window = fit_acoustic_context((one.features for one in observed), how.acoustic_components)
    owners = _owners(emission, how)
    axes, outputs = window.basis.shape[1], emission.means[0].size
    moments = {key: zero_statistics(axes, outputs) for key in dict.fromkeys(owners) if key is not None}
    for key, z, error in _frames(emission, observed, how, window, owners):
        moments[key].add(z, error)
    coefficients, index = _coefficients(emission, moments, how)
    rows = np.array([-1 if key is None else index[key] for key in owners], np.int32)
    hearing = AcousticRegression(window, coefficients, rows)
    return replace(emission, regression=hearing, variances=_variances(emission, hearing, observed, how))


_Key = tuple[str, int]
"""A tree and a node of it."""


def _owners(emission: Emission, how: TrainingOptions) -> list[_Key | None]:
    """Return, density by density, the node whose regression it uses; rest uses none."""
    least = max(how.ridge_frames, sum(float(tree.frames[0]) for tree in emission.forest.values()) / MOST)
    found: list[_Key | None] = []
    for name, tree in emission.forest.items():
        found += [(name, regression_node(tree, tree.path_to(int(leaf)), least)) for leaf in tree.leaves]
    return [*found, None]


def _frames(
    emission: Emission,
    observed: Sequence[TrainingClip],
    how: TrainingOptions,
    window: AcousticContext,
    owners: Sequence[_Key | None],
) -> Iterator[tuple[_Key, NDArray[np.float32], NDArray[np.float32]]]:
    """Give, for each node with a regression, what is heard and how far the motion is from its density's mean."""
    numbers = {key: number for number, key in enumerate(dict.fromkeys(owners))}
    keys, of_row = list(numbers), np.array([numbers[key] for key in owners])
    for start in range(0, len(observed), AT_A_TIME):
        block = observed[start : start + AT_A_TIME]
        rows = np.concatenate([density_rows(emission, one.training_states, how.layout) for one in block])
        z = np.concatenate([window(one.features, one.frames) for one in block])
        error = np.concatenate([one.rows for one in block]) - emission.means[rows]
        order = np.argsort(of_row[rows], kind="stable")
        z, error = z[order], error[order].reshape(len(order), -1).astype(np.float32)
        found, first = np.unique(of_row[rows][order], return_index=True)
        for number, begin, end in zip(found, first, [*first[1:], len(order)], strict=True):
            key = keys[number]
            if key is not None:
                yield key, z[begin:end], error[begin:end]


def _coefficients(
    emission: Emission, moments: dict[_Key, RegressionStatistics], how: TrainingOptions
) -> tuple[NDArray[np.float32], dict[_Key, int]]:
    every = list(moments.values())
    shared = ridge(sum(every[1:], every[0]), np.zeros_like(every[0].targets), how.shared_ridge)
    found: dict[_Key, Array] = {}
    for name, tree in emission.forest.items():
        own = {node: moments[tree_name, node] for tree_name, node in moments if tree_name == name}
        found |= {(name, node): matrix for node, matrix in fit_tree_regressions(tree, own, shared, how.ridge).items()}
    index = {key: number for number, key in enumerate(found)}
    return np.array(list(found.values()), np.float32), index


def _variances(
    emission: Emission, hearing: AcousticRegression, observed: Sequence[TrainingClip], how: TrainingOptions
) -> NDArray[np.float32]:
    """Return the variances around means that follow the sound, shrunk towards those of all frames together."""
    squares, counts = np.zeros(emission.means.shape), np.zeros(len(emission.means))
    for one in observed:
        rows = density_rows(emission, one.training_states, how.layout)
        means = emission.means[rows].astype(float)
        add_acoustic_regression(means, hearing, rows, hearing.context(one.features, one.frames))
        np.add.at(squares, rows, np.square(one.rows - means))
        np.add.at(counts, rows, 1)
    return _shrunk(emission, squares, counts, how.variance_shrinkage)


def _shrunk(emission: Emission, squares: Array, counts: Array, strength: float) -> NDArray[np.float32]:
    before = emission.variances.astype(float)
    ratio = squares[:-1].sum(axis=0) / np.maximum((before[:-1] * counts[:-1, None, None]).sum(axis=0), 1e-30)
    prior = before * np.clip(ratio, 0, 1)  # what the density had, less what listening explains on the average
    after = (squares + strength * prior) / (counts + strength)[:, None, None]
    after[-1] = before[-1]  # rest
    return np.maximum(after, 1e-3 * before).astype(np.float32)
