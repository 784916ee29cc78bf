"""What the trajectory engine learns."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.trajectory.closure import Closure
from lipmotion.engines.trajectory.contexts import Cut
from lipmotion.engines.trajectory.emission import Emission, emission_arrays, emission_from_arrays
from lipmotion.engines.trajectory.frame import frame_arrays, frame_from_arrays
from lipmotion.engines.trajectory.listening import Listener, listener_arrays, listener_from_arrays
from lipmotion.engines.trajectory.space import MotionSpace
from lipmotion.errors import ModelFormatError
from lipmotion.units import UnitSet


@dataclass(frozen=True, eq=False)
class TrajectoryModel:
    """Statistics of motion for every part of every unit in context.

    units    : the unit of every phone
    space    : the Q dimensions in which motion is modelled
    emission : densities of all tied states
    gain     : by how much movements away from rest are made larger [shape=(Q,)]
    closure  : how the lips close (None: the motion has no opening)
    listener : finds the phones of voices that it knows (None: there was too little speech to learn from)
    """

    units: UnitSet
    space: MotionSpace
    emission: Emission
    gain: NDArray[np.float64]
    closure: Closure | None
    listener: Listener | None = None


def model_arrays(model: TrajectoryModel) -> dict[str, NDArray[Any]]:
    """Return the model as arrays."""
    arrays = frame_arrays(model.units, model.space, model.closure) | {"gain": model.gain}
    heard = listener_arrays(model.listener) if model.listener is not None else {}
    return arrays | emission_arrays(model.emission) | heard


def model_from_arrays(arrays: Mapping[str, NDArray[Any]], cut: Callable[[UnitSet], Cut], units: str) -> TrajectoryModel:
    """Return the model again.

    cut   : how the parts of some units are cut
    units : the name of its unit set; the set itself is in the arrays
    Raises ModelFormatError: something is missing or has the wrong shape.
    """
    try:
        of, space, closure = frame_from_arrays(arrays, units)
        emission = emission_from_arrays(arrays, cut(of), space.dimensions)
        gain = arrays["gain"]
        if gain.shape != (space.dimensions,) or not ((gain > 0) & np.isfinite(gain)).all():
            raise ValueError(
                f"a gain of shape {gain.shape}, required ({space.dimensions},), all finite and more than 0"
            )
        return TrajectoryModel(of, space, emission, gain, closure, listener_from_arrays(arrays))
    except (KeyError, ValueError, IndexError, TypeError) as error:
        raise ModelFormatError(f"the trajectory model is damaged ({error}); train or download it again") from error
