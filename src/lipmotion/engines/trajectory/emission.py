"""How the mouth moves in every tied state: a Gaussian whose mean may follow the sound around the frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.motion.context_window import WINDOW, AcousticContext, acoustic_context_arrays, acoustic_context_from
from lipmotion.motion.frame_labels import FullContextState, StateLayout
from lipmotion.motion.limits import check_spread
from lipmotion.stats.trees import TREES, Tree, tree_arrays, trees_from_arrays
from lipmotion.storage.schema import POSITIVE, Arrays, ArraySpec, checked_arrays

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class AcousticRegression:
    """Linear regressions of motion on the sound around a frame.

    window       : what is heard [F numbers a frame]
    coefficients : float32 array [shape=(R, F, 3·Q)]
    rows         : int array [shape=(L,)], the coefficients of each density; -1 marks one that does not listen
    """

    context: AcousticContext
    coefficients: NDArray[np.float32]
    rows: NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Emission:
    """Densities of static value, Δ and Δ² (Q dimensions each) of all tied states.

    forest    : a tree for every part of speech and of silence (``StateLayout.names``)
    means, variances : float32 arrays [shape=(L, 3, Q)], leaf by leaf, tree by tree; the last is that of rest
    hearing   : how the means follow the sound (None: they do not)
    """

    forest: Mapping[str, Tree]
    means: NDArray[np.float32]
    variances: NDArray[np.float32]
    regression: AcousticRegression | None

    @cached_property
    def _first(self) -> dict[str, int]:
        counts = np.cumsum([0, *(len(tree.leaves) for tree in self.forest.values())])
        return dict(zip(self.forest, counts.tolist(), strict=False))

    @cached_property
    def _rank(self) -> dict[str, NDArray[np.intp]]:
        return {name: np.cumsum(tree.asked < 0) - 1 for name, tree in self.forest.items()}

    def row(self, place: FullContextState, layout: StateLayout) -> int:
        """Return the density of a place."""
        if place == layout.rest:
            return len(self.means) - 1
        name = layout.name(place)
        leaf = self.forest[name].path(place.context)[-1]
        return self._first[name] + int(self._rank[name][leaf])

    def source(self, place: FullContextState, layout: StateLayout) -> str:
        """Return what the density of a place rests on, in words."""
        if place == layout.rest:
            return "rest"
        name = layout.name(place)
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
        if self.regression is not None:
            add_acoustic_regression(means, self.regression, rows, self.regression.context(features, heard))
        return means, precisions


def add_acoustic_regression(
    means: Array, hearing: AcousticRegression, rows: NDArray[np.intp], z: NDArray[np.float32]
) -> None:
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
    if emission.regression is not None:
        window = emission.regression.context
        arrays |= {
            **acoustic_context_arrays(window),
            "coefficients": emission.regression.coefficients.astype(np.float16),
            "coefficient_rows": emission.regression.rows,
        }
    return arrays


def emission_from_arrays(arrays: Arrays, layout: StateLayout, dimensions: int) -> Emission:
    """Return the densities again. Raises KeyError, ValueError: something is missing, out of place or out of range."""
    forest = trees_from_arrays(arrays)
    if len(forest) != layout.speech + layout.silence or list(forest) != layout.names:
        raise ValueError(
            f"trees for {len(forest)} parts, required {layout.speech} of speech and {layout.silence} of silence"
        )
    leaves = sum(len(tree.leaves) for tree in forest.values()) + 1
    found = checked_arrays(arrays, DENSITIES, L=leaves, Q=dimensions)
    check_spread(found["means"][:, 0], found["variances"][:, 0])
    hearing = _hearing(arrays, leaves, dimensions) if HEARING.keys() & arrays.keys() else None
    return Emission(forest, found["means"], found["variances"], hearing)


DENSITIES = {"means": ArraySpec(np.float32, "L 3 Q"), "variances": ArraySpec(np.float32, "L 3 Q", POSITIVE)}
HEARING = {
    **WINDOW,
    "coefficients": ArraySpec(np.float32, "C A V"),
    "coefficient_rows": ArraySpec(np.int32, "L", -1, 1e6),
}
EMISSION = (*TREES, *DENSITIES, *HEARING)
"""How they are stored: L leaves and C regressions."""


def _hearing(arrays: Arrays, leaves: int, dimensions: int) -> AcousticRegression:
    found = checked_arrays(arrays, HEARING, L=leaves, V=3 * dimensions)
    rows = found["coefficient_rows"]
    if rows.max() >= found.sizes["C"]:
        raise ValueError(f"a density that follows regression {rows.max()} of {found.sizes['C']}")
    return AcousticRegression(acoustic_context_from(found), found["coefficients"], rows)
