"""What every model of motion has beside its statistics: units, the space of the motion, and how lips close."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.trajectory.closure import OPENING, Closure
from lipmotion.engines.trajectory.space import MotionSpace
from lipmotion.stats.pca import Pca
from lipmotion.types import Channel
from lipmotion.units import UNIT_SETS, UnitSet

SINGLE = UNIT_SETS["phone"]
"""Each phone its own unit: needs no table."""


def frame_arrays(units: UnitSet, space: MotionSpace, closure: Closure | None) -> dict[str, NDArray[Any]]:
    """Return them as arrays."""
    arrays: dict[str, NDArray[Any]] = {
        "channels": np.array([(channel.name, channel.unit) for channel in space.channels]),
        "direct": space.direct,
    }
    if units != SINGLE:
        arrays["units"] = np.array(list(units.of.items()))
    if space.points is not None:
        arrays |= {"points_mean": space.points.mean, "points_basis": space.points.basis.astype(np.float32)}
    if closure is not None:
        arrays |= {"closure": np.array([closure.column, closure.closed]), "closure_follow": closure.follow}
    return arrays


def frame_from_arrays(arrays: Mapping[str, NDArray[Any]], units: str) -> tuple[UnitSet, MotionSpace, Closure | None]:
    """Return them again.

    units : the name of the unit set; the set itself is in the arrays
    Raises KeyError, ValueError, IndexError, TypeError: something is missing or has the wrong shape.
    """
    _check_shapes(arrays)
    channels = tuple(Channel(str(name), str(unit)) for name, unit in arrays["channels"])
    direct, points, closure = arrays["direct"].astype(np.intp), None, None
    if len(direct) < len(channels):
        points = Pca(arrays["points_mean"].astype(float), arrays["points_basis"].astype(float))
    space = MotionSpace(channels, direct, points)
    if OPENING in space.direct_names:
        column, closed = arrays["closure"]
        closure = Closure(int(column), float(closed), arrays["closure_follow"].astype(float))
    of = SINGLE if units == SINGLE.name else UnitSet(units, _mapping(arrays["units"]))
    return of, space, closure


def _mapping(pairs: NDArray[Any]) -> dict[str, str]:
    """Return the unit of every phone. Raises ValueError: something else."""
    of = {str(phone): str(unit) for phone, unit in pairs}
    if len(of) != len(pairs):
        raise ValueError("a phone with two units")
    return of


def _check_shapes(arrays: Mapping[str, NDArray[Any]]) -> None:
    direct, channels = len(arrays["direct"]), len(arrays["channels"])
    reduced = len(arrays["points_basis"]) if direct < channels else 0
    dimensions = direct + reduced
    required = {
        "points_mean": (channels - direct,),
        "points_basis": (reduced, channels - direct),
        "closure": (2,),
        "closure_follow": (dimensions,),
    }
    for name, shape in required.items():
        if name in arrays and arrays[name].shape != shape:
            raise ValueError(f"{name} of shape {arrays[name].shape}, required {shape}")
        if name in arrays and not np.isfinite(arrays[name]).all():
            raise ValueError(f"{name} holds values that are not finite")
    if len(set(arrays["direct"].tolist()) & set(range(channels))) < direct:
        raise ValueError(f"direct channels {arrays['direct'].tolist()}, required different ones under {channels}")
    if "closure" in arrays and not 0 <= arrays["closure"][0] < dimensions:
        raise ValueError(f"closure of column {arrays['closure'][0]}, required one under {dimensions}")
