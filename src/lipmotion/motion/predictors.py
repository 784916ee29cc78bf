"""Predictors of motion from speech, of which a model may have one: an acoustic network, or a regression."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

from numpy.typing import NDArray

from lipmotion.motion.acoustic_network import (
    NETWORK_ARRAYS,
    AcousticNetwork,
    acoustic_network_arrays,
    acoustic_network_from_arrays,
)
from lipmotion.motion.prior_regression import (
    PRIOR_ARRAYS,
    PriorRegression,
    prior_regression_arrays,
    prior_regression_from_arrays,
)
from lipmotion.storage.schema import Arrays
from lipmotion.types import FRAME_RATE_HZ, Example

Predictor: TypeAlias = AcousticNetwork | PriorRegression
PREDICTOR_ARRAYS = (*NETWORK_ARRAYS, *PRIOR_ARRAYS)
"""Names of the arrays of ``predictor_arrays``."""
LEAST_NETWORK_S = 120.0
"""The acoustic network is trained from this much measured motion on,"""
LEAST_OWN_S = 480.0
"""and from this much on where the model could stand on another one instead."""


def measured_s(examples: Sequence[Example]) -> float:
    """Return the seconds of measured motion of some examples."""
    return sum(int(example.valid.sum()) for example in examples) / FRAME_RATE_HZ


def stands_on_another(examples: Sequence[Example]) -> bool:
    """Return whether the motion of some examples is regressed on what another model makes of their speech."""
    return measured_s(examples) < LEAST_OWN_S and all(example.speech.prior is not None for example in examples)


def predictor_arrays(predictor: Predictor | None) -> dict[str, NDArray[Any]]:
    """Serialise a predictor; no array where there is none."""
    if predictor is None:
        return {}
    if isinstance(predictor, AcousticNetwork):
        return acoustic_network_arrays(predictor)
    return prior_regression_arrays(predictor)


def predictor_from_arrays(arrays: Arrays, dimensions: int) -> Predictor | None:
    """Deserialise a predictor; None where there is none.

    dimensions : of the motion space, Q
    Raises KeyError, ValueError: an array is missing, or has a wrong shape, type or range.
    """
    network = acoustic_network_from_arrays(arrays, dimensions)
    regression = prior_regression_from_arrays(arrays, dimensions)
    if network is not None and regression is not None:
        raise ValueError("a network and a regression on another model, required one of them")
    return network or regression
