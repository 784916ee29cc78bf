"""Arrays of the parts of a model that engines share: the unit set, the motion space, closures, limits, scaling."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.motion import articulation
from lipmotion.motion.closure import OPENING, Closure
from lipmotion.motion.generation import LearnedMotion, VarianceScaling
from lipmotion.motion.space import MotionLimits, MotionSpace, check_poses
from lipmotion.stats.pca import Pca, check_orthonormal
from lipmotion.storage.schema import Arrays, ArraySpec, check_arrays, format_errors, refuse_undeclared
from lipmotion.types import Channel
from lipmotion.units import UNIT_SETS, UnitSet

PHONE_SET = UNIT_SETS["phone"]  # the unit set in which each phone is a unit of its own; models do not store it


def motion_to_arrays(
    units: UnitSet, space: MotionSpace, closure: Closure | None, prior: articulation.ArticulationPrior | None = None
) -> dict[str, NDArray[Any]]:
    """Serialise the mapping of phones to units, the motion space, the closure and the prior."""
    arrays: dict[str, NDArray[Any]] = {
        "channels": np.array([(channel.name, channel.unit) for channel in space.channels]),
        "direct": space.direct,
    }
    if units != PHONE_SET:
        arrays["units"] = np.array(list(units.unit_of_phone.items()))
    if space.points is not None:
        arrays |= {"points_mean": space.points.mean, "points_basis": space.points.basis.astype(np.float32)}
    if closure is not None:
        arrays |= {"closure": np.array([closure.column, closure.closed]), "closure_follow": closure.follow}
    return arrays | articulation.articulation_to_arrays(prior)


def learned_motion_to_arrays(motion: LearnedMotion) -> dict[str, NDArray[Any]]:
    """Serialise learned motion with limits and variance scaling, for engines that store no more."""
    arrays = motion_to_arrays(PHONE_SET, motion.space, motion.closure, motion.prior)
    scaling = {"scaling": np.stack(motion.scaling)} if motion.scaling is not None else {}
    return arrays | {"limits": np.stack(motion.limits)} | scaling


def learned_motion_from_arrays(arrays: Arrays) -> LearnedMotion:
    """Deserialise a learned motion. Raises ModelFormatError: damaged arrays."""
    with format_errors("the learned motion"):
        _, space, closure, prior = motion_from_arrays(arrays, PHONE_SET.name)
        limits = MotionLimits(*check_arrays(arrays, LIMITS, Q=space.dimensions)["limits"])
        check_poses(limits, space, closure)
        scaling = None
        if "scaling" in arrays:
            scaling = VarianceScaling(*check_arrays(arrays, SCALING, Q=space.dimensions)["scaling"])
        return LearnedMotion(space, closure, limits, scaling, prior)


def motion_from_arrays(
    arrays: Arrays, units: str
) -> tuple[UnitSet, MotionSpace, Closure | None, articulation.ArticulationPrior | None]:
    """Deserialise the mapping of phones to units, the motion space, the closure and the prior.

    units : the name of the unit set; the set itself is in the arrays
    Raises KeyError, ValueError, IndexError, TypeError: an array is missing, or has a wrong shape, type or range.
    """
    shapes = check_arrays(arrays, CHANNELS)
    count, direct = shapes.sizes["P"], shapes["direct"]
    channels = tuple(Channel(name, unit) for name, unit in shapes["channels"].tolist())
    if len({channel.name for channel in channels}) < count:
        raise ValueError("channels whose names repeat")
    if len(set(direct.tolist()) & set(range(count))) < len(direct):
        raise ValueError(f"direct channels {direct.tolist()}, required different ones under {count}")
    points = closure = None
    if len(direct) == count:
        refuse_undeclared(arrays.keys() & POINTS.keys())
    else:
        stored = check_arrays(arrays, POINTS, R=count - len(direct))
        check_orthonormal("points_basis", stored["points_basis"])
        points = Pca(stored["points_mean"], stored["points_basis"])
    space = MotionSpace(channels, direct, points)
    if OPENING in space.direct_names:
        stored = check_arrays(arrays, CLOSURE, Q=space.dimensions)
        column, closed = stored["closure"]
        if column != space.direct_names.index(OPENING) or closed < 0:
            raise ValueError(f"closure of column {column:g} at {closed:g}, required that of {OPENING} and 0 or more")
        closure = Closure(int(column), float(closed), stored["closure_follow"])
    unit_set = PHONE_SET
    if units != PHONE_SET.name:
        pairs = check_arrays(arrays, UNITS)["units"]
        unit_of_phone = {str(phone): str(unit) for phone, unit in pairs}
        if len(unit_of_phone) != len(pairs):
            raise ValueError("a phone with two units")
        unit_set = UnitSet(units, unit_of_phone)
    return unit_set, space, closure, articulation.articulation_from_arrays(arrays, space.dimensions)


CHANNELS = {"channels": ArraySpec(np.str_, "P 2"), "direct": ArraySpec(np.intp, "d", 0, 1e6)}
POINTS = {
    "points_mean": ArraySpec(np.float64, "R", -1e6, 1e6),
    "points_basis": ArraySpec(np.float64, "K R", -1.01, 1.01),
}
CLOSURE = {"closure": ArraySpec(np.float64, "2"), "closure_follow": ArraySpec(np.float64, "Q")}
UNITS = {"units": ArraySpec(np.str_, "N 2")}
LIMITS = {"limits": ArraySpec(np.float64, "2 Q")}
SCALING = {"scaling": ArraySpec(np.float64, "2 Q")}
MOTION_ARRAYS = (*CHANNELS, *POINTS, *CLOSURE, *UNITS, *articulation.ARTICULATION)
"""Names of the arrays of ``motion_to_arrays``: P channels, of which R are reduced to K dimensions."""
LEARNED_MOTION_ARRAYS = (*CHANNELS, *POINTS, *CLOSURE, *LIMITS, *SCALING, *articulation.ARTICULATION)
"""Names of the arrays of ``learned_motion_to_arrays``."""
