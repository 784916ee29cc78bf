"""What the trajectory engine learns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.trajectory.closure import OPENING, Closure
from lipmotion.engines.trajectory.contexts import LEVELS, SPREAD_LEVELS, Place, level_names
from lipmotion.engines.trajectory.space import MotionSpace
from lipmotion.errors import ModelFormatError
from lipmotion.stats.pca import Pca
from lipmotion.types import Channel


@dataclass(frozen=True, eq=False)
class Level:
    """Contexts of one generality.

    rows  : the row of each context
    means : float32 array [shape=(R, 3, Q)], what each adds to the sum of the more general ones
    frames: int array [shape=(R,)], the frames behind each
    """

    rows: Mapping[str, int]
    means: NDArray[np.float32]
    frames: NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class TrajectoryModel:
    """Statistics of motion for every part of every unit in context.

    space     : the Q dimensions in which motion is modelled
    levels    : from any phone to the phone between phones
    spread    : contexts of ``SPREAD_LEVELS`` -> rows of ``variances``
    variances : float32 array [shape=(R, 3, Q)] around the full mean; static, Δ, Δ²
    closure   : how the lips close (None: the motion has no opening)
    """

    space: MotionSpace
    levels: tuple[Level, ...]
    spread: Mapping[str, int]
    variances: NDArray[np.float32]
    closure: Closure | None

    def statistics(self, place: Place) -> tuple[NDArray[np.float64], NDArray[np.float64], str]:
        """Return mean and precision [shape=(3, Q)] of a place, and what they rest on."""
        names = level_names(place)
        mean, source = np.zeros(self.variances.shape[1:]), ""
        for level, name in zip(self.levels, names, strict=True):
            row = level.rows.get(name)
            if row is not None:
                mean = mean + level.means[row]
                source = f"{name} ({level.frames[row]} frames)"
        candidates = [names[level] for level in reversed(SPREAD_LEVELS)]
        row = next(self.spread[name] for name in candidates if name in self.spread)
        return mean, 1 / self.variances[row].astype(float), source


def model_arrays(model: TrajectoryModel) -> dict[str, NDArray[Any]]:
    """Return the model as arrays; means and variances at half precision."""
    arrays: dict[str, NDArray[Any]] = {
        "channels": np.array([(channel.name, channel.unit) for channel in model.space.channels]),
        "direct": model.space.direct,
        "spread": np.array(list(model.spread)),
        "variances": model.variances,
    }
    if model.space.points is not None:
        points = model.space.points
        arrays |= {"points_mean": points.mean, "points_basis": points.basis.astype(np.float32)}
    if model.closure is not None:
        arrays |= {
            "closure": np.array([model.closure.column, model.closure.closed]),
            "closure_follow": model.closure.follow,
        }
    for number, level in enumerate(model.levels):
        arrays |= {
            f"level{number}_names": np.array(list(level.rows)),
            f"level{number}_means": level.means.astype(np.float16),
            f"level{number}_frames": level.frames,
        }
    return arrays


def model_from_arrays(arrays: Mapping[str, NDArray[Any]]) -> TrajectoryModel:
    """Return the model again. Raises ModelFormatError: something is missing or has the wrong shape."""
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
        return TrajectoryModel(
            space=space,
            levels=tuple(_level(arrays, number) for number in range(LEVELS)),
            spread={str(name): row for row, name in enumerate(arrays["spread"])},
            variances=arrays["variances"].astype(np.float32),
            closure=closure,
        )
    except (KeyError, ValueError, IndexError, TypeError) as error:
        raise ModelFormatError(f"the trajectory model is damaged ({error}); train or download it again") from error


def _check_shapes(arrays: Mapping[str, NDArray[Any]]) -> None:
    direct, channels = len(arrays["direct"]), len(arrays["channels"])
    reduced = len(arrays["points_basis"]) if direct < channels else 0
    dimensions = direct + reduced
    required = {
        "variances": (len(arrays["spread"]), 3, dimensions),
        "points_mean": (channels - direct,),
        "points_basis": (reduced, channels - direct),
        "closure": (2,),
        "closure_follow": (dimensions,),
    }
    for number in range(LEVELS):
        contexts = len(arrays[f"level{number}_names"])
        required |= {f"level{number}_means": (contexts, 3, dimensions), f"level{number}_frames": (contexts,)}
    for name, shape in required.items():
        if name in arrays and arrays[name].shape != shape:
            raise ValueError(f"{name} of shape {arrays[name].shape}, required {shape}")
        if name in arrays and not np.isfinite(arrays[name]).all():
            raise ValueError(f"{name} holds values that are not finite")
    if not (arrays["variances"] > 0).all():
        raise ValueError("variances that are not more than 0")
    if len(set(arrays["direct"].tolist()) & set(range(channels))) < direct:
        raise ValueError(f"direct channels {arrays['direct'].tolist()}, required different ones under {channels}")
    if "closure" in arrays and not 0 <= arrays["closure"][0] < dimensions:
        raise ValueError(f"closure of column {arrays['closure'][0]}, required one under {dimensions}")


def _level(arrays: Mapping[str, NDArray[Any]], number: int) -> Level:
    rows = {str(name): row for row, name in enumerate(arrays[f"level{number}_names"])}
    return Level(rows, arrays[f"level{number}_means"].astype(np.float32), arrays[f"level{number}_frames"])
