"""What the trajectory engine learns."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.trajectory.closure import OPENING, Closure
from lipmotion.engines.trajectory.contexts import Cut
from lipmotion.engines.trajectory.emission import Emission, emission_arrays, emission_from_arrays
from lipmotion.engines.trajectory.space import MotionSpace
from lipmotion.errors import ModelFormatError
from lipmotion.stats.pca import Pca
from lipmotion.types import Channel
from lipmotion.units import UNIT_SETS, UnitSet

SINGLE = UNIT_SETS["phone"]
"""Each phone its own unit: needs no table."""


@dataclass(frozen=True, eq=False)
class TrajectoryModel:
    """Statistics of motion for every part of every unit in context.

    units    : the unit of every phone
    space    : the Q dimensions in which motion is modelled
    emission : densities of all tied states
    gain     : by how much movements away from rest are made larger [shape=(Q,)]
    closure  : how the lips close (None: the motion has no opening)
    """

    units: UnitSet
    space: MotionSpace
    emission: Emission
    gain: NDArray[np.float64]
    closure: Closure | None


def model_arrays(model: TrajectoryModel) -> dict[str, NDArray[Any]]:
    """Return the model as arrays."""
    arrays: dict[str, NDArray[Any]] = {
        "channels": np.array([(channel.name, channel.unit) for channel in model.space.channels]),
        "direct": model.space.direct,
        "gain": model.gain,
    }
    if model.units != SINGLE:
        arrays["units"] = np.array(list(model.units.of.items()))
    if model.space.points is not None:
        points = model.space.points
        arrays |= {"points_mean": points.mean, "points_basis": points.basis.astype(np.float32)}
    if model.closure is not None:
        arrays |= {
            "closure": np.array([model.closure.column, model.closure.closed]),
            "closure_follow": model.closure.follow,
        }
    return arrays | emission_arrays(model.emission)


def model_from_arrays(arrays: Mapping[str, NDArray[Any]], cut: Callable[[UnitSet], Cut], units: str) -> TrajectoryModel:
    """Return the model again.

    cut   : how the parts of some units are cut
    units : the name of its unit set; the set itself is in the arrays
    Raises ModelFormatError: something is missing or has the wrong shape.
    """
    try:
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
        emission = emission_from_arrays(arrays, cut(of), space.dimensions)
        return TrajectoryModel(of, space, emission, arrays["gain"], closure)
    except (KeyError, ValueError, IndexError, TypeError) as error:
        raise ModelFormatError(f"the trajectory model is damaged ({error}); train or download it again") from error


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
        "gain": (dimensions,),
        "closure": (2,),
        "closure_follow": (dimensions,),
    }
    for name, shape in required.items():
        if name in arrays and arrays[name].shape != shape:
            raise ValueError(f"{name} of shape {arrays[name].shape}, required {shape}")
        if name in arrays and not np.isfinite(arrays[name]).all():
            raise ValueError(f"{name} holds values that are not finite")
    if not (arrays["gain"] > 0).all():
        raise ValueError("a gain that is not more than 0")
    if len(set(arrays["direct"].tolist()) & set(range(channels))) < direct:
        raise ValueError(f"direct channels {arrays['direct'].tolist()}, required different ones under {channels}")
    if "closure" in arrays and not 0 <= arrays["closure"][0] < dimensions:
        raise ValueError(f"closure of column {arrays['closure'][0]}, required one under {dimensions}")
