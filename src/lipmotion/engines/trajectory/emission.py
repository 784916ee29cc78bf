"""How the mouth moves in every tied state: a Gaussian whose mean may follow the sound around the frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.trajectory.contexts import Cut, Place
from lipmotion.engines.trajectory.window import AudioWindow
from lipmotion.stats.trees import Tree, tree_arrays, trees_from_arrays

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Hearing:
    """Linear regressions of motion on the sound around a frame.

    window       : what is heard [F numbers a frame]
    coefficients : float32 array [shape=(R, F, 3·Q)]
    rows         : int array [shape=(L,)], the coefficients of each density; -1 marks one that does not listen
    """

    window: AudioWindow
    coefficients: NDArray[np.float32]
    rows: NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Emission:
    """Densities of static value, Δ and Δ² (Q dimensions each) of all tied states.

    forest    : a tree for every part of speech and of silence (``Cut.names``)
    means, variances : float32 arrays [shape=(L, 3, Q)], leaf by leaf, tree by tree; the last is that of rest
    hearing   : how the means follow the sound (None: they do not)
    """

    forest: Mapping[str, Tree]
    means: NDArray[np.float32]
    variances: NDArray[np.float32]
    hearing: Hearing | None

    @cached_property
    def _first(self) -> dict[str, int]:
        counts = np.cumsum([0, *(len(tree.leaves) for tree in self.forest.values())])
        return dict(zip(self.forest, counts.tolist(), strict=False))

    @cached_property
    def _rank(self) -> dict[str, NDArray[np.intp]]:
        return {name: np.cumsum(tree.asked < 0) - 1 for name, tree in self.forest.items()}

    def row(self, place: Place, cut: Cut) -> int:
        """Return the density of a place."""
        if place == cut.rest:
            return len(self.means) - 1
        name = cut.name(place)
        leaf = self.forest[name].path(place.context)[-1]
        return self._first[name] + int(self._rank[name][leaf])

    def source(self, place: Place, cut: Cut) -> str:
        """Return what the density of a place rests on, in words."""
        if place == cut.rest:
            return "rest"
        name = cut.name(place)
        tree = self.forest[name]
        leaf = tree.path(place.context)[-1]
        left, unit, right = place.context
        return f"{left}-{unit}+{right} {name}: {tree.name(leaf)} ({tree.frames[leaf]:.0f} frames)"

    def statistics(self, rows: NDArray[np.intp], features: NDArray[np.float32], heard: slice) -> tuple[Array, Array]:
        """Return means and precisions [each shape=(T, 3, Q)] of successive frames.

        rows     : the density of each [shape=(T,)]
        features : of the whole recording;  heard : the frames of it that are meant
        """
        means, precisions = self.means[rows].astype(float), 1 / self.variances[rows].astype(float)
        if self.hearing is not None:
            add_heard(means, self.hearing, rows, self.hearing.window(features, heard))
        return means, precisions


def add_heard(means: Array, hearing: Hearing, rows: NDArray[np.intp], z: NDArray[np.float32]) -> None:
    """Add to means [shape=(T, 3, Q)] what the sound around each frame [shape=(T, F)] says (in place)."""
    used = hearing.rows[rows]
    for row in np.unique(used[used >= 0]):
        frames = np.nonzero(used == row)[0]
        means[frames] += (z[frames] @ hearing.coefficients[row]).reshape(len(frames), *means.shape[1:])


def emission_arrays(emission: Emission) -> dict[str, NDArray[Any]]:
    """Return the densities as arrays; means and coefficients at half precision."""
    arrays = tree_arrays(emission.forest) | {
        "means": emission.means.astype(np.float16),
        "variances": emission.variances,
    }
    if emission.hearing is not None:
        window = emission.hearing.window
        arrays |= {
            "window": np.stack([window.mean, window.scale]),
            "window_basis": window.basis.astype(np.float16),
            "coefficients": emission.hearing.coefficients.astype(np.float16),
            "coefficient_rows": emission.hearing.rows,
        }
    return arrays


def emission_from_arrays(arrays: Mapping[str, NDArray[Any]], cut: Cut, dimensions: int) -> Emission:
    """Return the densities again. Raises KeyError, ValueError: something is missing or has the wrong shape."""
    forest = trees_from_arrays(arrays)
    if list(forest) != cut.names:
        raise ValueError(f"trees for {len(forest)} parts, required {len(cut.names)}: {' '.join(cut.names)}")
    leaves = sum(len(tree.leaves) for tree in forest.values()) + 1
    _check("means", arrays, (leaves, 3, dimensions))
    _check("variances", arrays, (leaves, 3, dimensions))
    if not (arrays["variances"] > 0).all():
        raise ValueError("variances that are not more than 0")
    hearing = _hearing(arrays, leaves, dimensions) if _has_hearing(arrays) else None
    return Emission(forest, arrays["means"].astype(np.float32), arrays["variances"].astype(np.float32), hearing)


_HEARING = ("window", "window_basis", "coefficients", "coefficient_rows")


def _has_hearing(arrays: Mapping[str, NDArray[Any]]) -> bool:
    return any(name in arrays for name in _HEARING)


def _hearing(arrays: Mapping[str, NDArray[Any]], leaves: int, dimensions: int) -> Hearing:
    inputs, axes = arrays["window_basis"].shape
    _check("window", arrays, (2, inputs))
    _check("window_basis", arrays, (inputs, axes))
    _check("coefficients", arrays, (len(arrays["coefficients"]), axes, 3 * dimensions))
    _check("coefficient_rows", arrays, (leaves,))
    rows = arrays["coefficient_rows"].astype(np.int32)
    if rows.min() < -1 or rows.max() >= len(arrays["coefficients"]):
        raise ValueError(f"a density that follows regression {rows.max()} of {len(arrays['coefficients'])}")
    if not (arrays["window"][1] > 0).all():
        raise ValueError("features of no spread")
    mean, scale = arrays["window"].astype(np.float32)
    window = AudioWindow(mean, scale, arrays["window_basis"].astype(np.float32))
    return Hearing(window, arrays["coefficients"].astype(np.float32), rows)


def _check(name: str, arrays: Mapping[str, NDArray[Any]], shape: Sequence[int]) -> None:
    if arrays[name].shape != tuple(shape):
        raise ValueError(f"{name} of shape {arrays[name].shape}, required {tuple(shape)}")
    if not np.isfinite(arrays[name]).all():
        raise ValueError(f"{name} holds values that are not finite")
