"""Serialising a multi-stream model as plain arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.hmm.multistream.densities import LEAST_SCALE, StreamScale, TiedDensities
from lipmotion.hmm.multistream.forest import Forest
from lipmotion.hmm.multistream.model import JointConfig, JointHmm, StreamModel
from lipmotion.hmm.multistream.streams import F0_STREAMS, MOTION, SPEECH, STREAMS
from lipmotion.hmm.multistream.unit_states import Inventory
from lipmotion.stats.bigram import BIGRAM, bigram_from_array
from lipmotion.stats.mixture import MIXTURES, mixtures_from_arrays
from lipmotion.stats.trees import TREES, tree_arrays, trees_from_arrays
from lipmotion.storage.schema import (
    BELOW_ONE,
    NEGATIVE,
    POSITIVE,
    Arrays,
    ArraySpec,
    arrays_under,
    check_arrays,
    format_errors,
    refuse_undeclared,
)


def joint_arrays(hmm: JointHmm, precision: type[np.floating[Any]] = np.float16) -> dict[str, NDArray[Any]]:
    """Serialise a model; its configuration is not included.

    precision : of means and variances; float32 keeps them exactly
    """
    arrays: dict[str, NDArray[Any]] = {
        "units": np.array(hmm.inventory.names),
        "free": np.array(hmm.inventory.free),
        "spoken": np.isin(hmm.inventory.names, hmm.spoken).astype(np.int8),
        "streams": np.array(list(hmm.models)),
        "log_stay": hmm.log_stay,
        "durations": hmm.durations,
        "bigram": hmm.bigram.log_probability,
    }
    for name, model in hmm.models.items():
        of_stream: dict[str, NDArray[Any]] = {
            "mean": model.scale.mean,
            "deviation": model.scale.deviation,
            "log_weights": model.tied.mixtures.log_weights,
            "means": model.tied.mixtures.means.astype(precision),
            "variances": model.tied.mixtures.variances.astype(precision),
            **tree_arrays(model.forest.trees),
        }
        if model.tied.voiced is not None:
            of_stream["voiced"] = model.tied.voiced
        arrays |= {f"{name}/{key}": array for key, array in of_stream.items()}
    return arrays


def joint_from_arrays(arrays: Arrays, config: JointConfig) -> JointHmm:
    """Deserialise a model. Raises ModelFormatError: an array is missing, undeclared, inconsistent or out of range."""
    with format_errors("the joint model"):
        named = check_arrays(arrays, NAMES)
        units, free, streams = (tuple(named[key].tolist()) for key in ("units", "free", "streams"))
        refuse_undeclared(
            arrays, NAMES, TIMES, (name for name in arrays if name.partition("/")[0] in streams and "/" in name)
        )
        if config.states > arrays["log_stay"].size:
            raise ValueError(f"{config.states} states a unit, of {arrays['log_stay'].size} in all")
        inventory = Inventory(units, free, config.states)
        spoken = tuple(unit for unit, occurred in zip(units, named["spoken"], strict=True) if occurred)
        if inventory.silence not in spoken:
            raise ValueError("silence did not occur in training")
        if SPEECH not in streams or not set(streams) <= set(STREAMS) or len(set(streams)) < len(streams):
            raise ValueError(f"streams {streams}")
        stored = check_arrays(arrays, TIMES, U=len(units), R=len(inventory.monophones))
        models = {name: _stream_model(name, arrays_under(arrays, f"{name}/"), inventory) for name in streams}
        bigram = bigram_from_array(units, stored["bigram"])
        return JointHmm(config, inventory, models, stored["log_stay"], stored["durations"], spoken, bigram)


NAMES = {
    "units": ArraySpec(np.str_, "U"),
    "free": ArraySpec(np.str_, "F"),
    "spoken": ArraySpec(np.int8, "U", 0, 1),
    "streams": ArraySpec(np.str_, "S"),
}
TIMES = {
    **BIGRAM,
    "log_stay": ArraySpec(np.float64, "R", -1e4, NEGATIVE),
    "durations": ArraySpec(np.float64, "R 2", POSITIVE, 1e9),
}
LEAST_STORED_SCALE = LEAST_SCALE / 10
"""Below ``LEAST_SCALE``, for rounding to half precision; squares of values divided by less overflow in float32."""
STREAM = {
    **MIXTURES,
    "mean": ArraySpec(np.float64, "D", -1e6, 1e6),
    "deviation": ArraySpec(np.float64, "D", LEAST_STORED_SCALE, 1e6),
}
VOICED = {"voiced": ArraySpec(np.float64, "G", POSITIVE, BELOW_ONE)}
"""How a model (``NAMES``, ``TIMES``) and each of its streams (``STREAM``, ``VOICED``) are stored; R states have no
context."""


def _stream_model(name: str, arrays: Arrays, inventory: Inventory) -> StreamModel:
    try:
        table = STREAM | VOICED if name in F0_STREAMS else STREAM
        refuse_undeclared(arrays, TREES, table)
        forest = Forest(inventory, trees_from_arrays(arrays))
        if list(forest.trees) != list(inventory.trees):
            raise ValueError(f"trees {' '.join(forest.trees)}, required {' '.join(inventory.trees)}")
        stored = check_arrays(arrays, table, G=forest.size)
        if name == MOTION and stored.sizes["D"] % 3:
            raise ValueError(f"{stored.sizes['D']} dimensions")
        tied = TiedDensities(mixtures_from_arrays(stored), stored.arrays.get("voiced"))
        return StreamModel(StreamScale(stored["mean"], stored["deviation"]), forest, tied)
    except (KeyError, ValueError) as error:
        raise ValueError(f"{name}: {error}") from error
