"""From the motion of a face to what its mouth looks like: a regression of eigenlips on channels of motion."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.stats.trees import create_statistics, ridge
from lipmotion.storage.schema import POSITIVE, Arrays, ArraySpec, check_arrays, format_errors, refuse_undeclared
from lipmotion.types import Channel, Motion
from lipmotion_faces.appearance.candidates import choose_candidates, square_distances

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

COMPONENTS = 20  # principal components of the motion that are regressors
LIKENESS_COMPONENTS = 12  # the first of them, in which likenesses to recorded poses are measured
CENTRES = 400  # recorded poses to which the likeness is a regressor
FRAMES_PER_CENTRE = 3  # so many frames are needed for each of them
WIDTH = 4.0  # standard deviation of the Gaussian of likeness, in deviations of a component
WEIGHT = 10.0  # weight of the likenesses beside the components, against which the ridge is
RIDGE, RIDGE_FRAMES = 1.0, 1000
"""The ridge parameter of T frames is RIDGE + (RIDGE_FRAMES / T)²: short footage is trusted less."""
OUTER_PERCENTAGE = 0.2
"""Percentage of the frames at each end of a component beyond which it is cut off: no map holds far from all footage."""
MIN_DEVIATION = 1e-4  # a channel that moves less, in its unit, is left out


@dataclass(frozen=True, eq=False)
class MotionMap:
    """A regression of some values on the motion in the same frame.

    names        : of the channels of motion [C texts]
    mean, scale  : of the channels [each shape=(C,)]
    basis        : from standardised channels to principal components of unit variance [shape=(C, D)]
    limits       : least and largest value of each component in the footage; others are cut off [shape=(2, D)]
    centres      : recorded poses, in the first of these components [shape=(N, E), E ≤ D]
    coefficients : of 1, the components and the likenesses to the poses [shape=(1 + D + N, V)]
    The likeness of a pose is the Gaussian of its distance: teeth appear all at once, which no linear map shows.
    """

    names: tuple[str, ...]
    mean: Array
    scale: Array
    basis: Array
    limits: Array
    centres: Floats
    coefficients: Floats

    def predict(self, motion: Motion) -> Floats:
        """Return the values at every frame [shape=(T, V)]. Raises InputError: a channel is missing, or not finite."""
        return self._stack_regressors(select_channels(motion, self.names)) @ self.coefficients

    def _stack_regressors(self, values: Array) -> Floats:
        components = np.clip((values - self.mean) / self.scale @ self.basis, *self.limits).astype(np.float32)
        near = np.ascontiguousarray(components[:, : self.centres.shape[1]])
        likeness = WEIGHT * np.exp(square_distances(near, self.centres) / (-2 * WIDTH**2))
        return np.concatenate([np.ones((len(values), 1), np.float32), components, likeness], axis=1)


def select_channels(motion: Motion, names: tuple[str, ...]) -> Array:
    """Return some channels of a motion [shape=(T, len(names))]. Raises InputError: one is missing, or not finite."""
    missing = [name for name in names if name not in motion.names]
    if missing:
        raise InputError(
            f"the motion has no channel {missing[0]!r} ({len(missing)} of the {len(names)} that this face needs are "
            "missing); required: motion of tracked points, or eigenlips, of a model that was trained on videos"
        )
    values = np.asarray(motion.selected(names).values, np.float64)
    if not np.isfinite(values).all():
        raise InputError("the motion has values that are not finite; give whole curves")
    return values


def fit_motion_map(values: Array, channels: tuple[Channel, ...], targets: NDArray[np.floating[Any]]) -> MotionMap:
    """Return the regression of ``targets`` [shape=(T, V)] on motion [shape=(T, C)], frame by frame.

    Raises InputError: fewer frames than targets of regression need (3), or values that are not finite.
    """
    if len(values) != len(targets) or len(values) < FRAMES_PER_CENTRE or not np.isfinite(values).all():
        raise InputError(
            f"motion of shape {values.shape} for {len(targets)} pictures, required finite motion of as many frames, "
            f"at least {FRAMES_PER_CENTRE}"
        )
    used = values.std(axis=0) > MIN_DEVIATION
    names = tuple(channel.name for channel, use in zip(channels, used, strict=True) if use)
    mean, scale = values[:, used].mean(axis=0), values[:, used].std(axis=0)
    standardised = (values[:, used] - mean) / scale
    variances, vectors = np.linalg.eigh(standardised.T @ standardised / len(standardised))
    variances, vectors = variances[::-1][:COMPONENTS], vectors[:, ::-1][:, :COMPONENTS]
    moving = variances > MIN_DEVIATION
    basis = vectors[:, moving] / np.sqrt(variances[moving])
    components = standardised @ basis
    limits = np.percentile(components, [OUTER_PERCENTAGE, 100 - OUTER_PERCENTAGE], axis=0)
    near = np.clip(components, *limits)[:, :LIKENESS_COMPONENTS].astype(np.float32)
    centres = near[choose_candidates(near, min(CENTRES, len(near) // FRAMES_PER_CENTRE))]
    unfitted = MotionMap(names, mean, scale, basis, limits, centres, np.zeros((0, 0), np.float32))
    regressors = unfitted._stack_regressors(values[:, used]).astype(np.float64)
    moments = create_statistics(regressors.shape[1], targets.shape[1])
    moments.add(regressors, targets.astype(np.float64))
    prior = np.zeros((regressors.shape[1], targets.shape[1]))
    prior[0] = targets.mean(axis=0)
    strength = RIDGE + (RIDGE_FRAMES / len(values)) ** 2
    return replace(unfitted, coefficients=ridge(moments, prior, strength).astype(np.float32))


def motion_map_to_arrays(fitted: MotionMap) -> dict[str, NDArray[Any]]:
    """Return a regression serialised as arrays (``MOTION_MAP``)."""
    return {name: np.asarray(getattr(fitted, name)) for name in MOTION_MAP}


def motion_map_from_arrays(arrays: Arrays, values: int) -> MotionMap:
    """Return the regression with ``values`` targets in arrays. Raises ModelFormatError: they do not fit."""
    with format_errors("the map from motion to pictures", "build the face again"):
        refuse_undeclared(arrays, MOTION_MAP)
        stored = check_arrays(arrays, MOTION_MAP, V=values)
        names = tuple(stored["names"].tolist())
        rows = 1 + stored["basis"].shape[1] + len(stored["centres"])
        if len(stored["coefficients"]) != rows or stored["centres"].shape[1] > stored["basis"].shape[1]:
            raise ValueError(f"{len(stored['coefficients'])} coefficients, required {rows}")
        if len(set(names)) < len(names) or (stored["limits"][0] > stored["limits"][1]).any():
            raise ValueError("channels twice, or limits the wrong way round")
        return MotionMap(names, *(stored[name] for name in MOTION_MAP if name != "names"))


MOTION_MAP = {
    "names": ArraySpec(np.str_, "C"),
    "mean": ArraySpec(np.float64, "C"),
    "scale": ArraySpec(np.float64, "C", POSITIVE),
    "basis": ArraySpec(np.float64, "C D"),
    "limits": ArraySpec(np.float64, "2 D"),
    "centres": ArraySpec(np.float32, "N E"),
    "coefficients": ArraySpec(np.float32, "R V"),
}
