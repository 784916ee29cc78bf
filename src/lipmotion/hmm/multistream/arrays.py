"""A joint model as plain arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import ModelFormatError
from lipmotion.hmm.multistream.densities import LEAST_SCALE, Scale, Tied
from lipmotion.hmm.multistream.forest import Forest
from lipmotion.hmm.multistream.inventory import Inventory
from lipmotion.hmm.multistream.model import JointConfig, JointHmm, Part
from lipmotion.hmm.multistream.streams import F0_STREAMS, MOTION, SPEECH, STREAMS
from lipmotion.stats.bigram import BIGRAM, bigram_from
from lipmotion.stats.mixture import MIXTURES, mixtures_from
from lipmotion.stats.trees import TREES, tree_arrays, trees_from_arrays
from lipmotion.storage.schema import BELOW_ONE, NEGATIVE, POSITIVE, Arrays, Member, checked, only, under


def joint_arrays(hmm: JointHmm, precision: type[np.floating[Any]] = np.float16) -> dict[str, NDArray[Any]]:
    """Return a model as arrays; its configuration is not among them.

    precision : of means and variances, in the streams' own scales; float32 is all there is
    """
    arrays: dict[str, NDArray[Any]] = {
        "units": np.array(hmm.inventory.names),
        "free": np.array(hmm.inventory.free),
        "spoken": np.isin(hmm.inventory.names, hmm.spoken).astype(np.int8),
        "streams": np.array(list(hmm.parts)),
        "log_stay": hmm.log_stay,
        "durations": hmm.durations,
        "bigram": hmm.bigram.log_probability,
    }
    for name, part in hmm.parts.items():
        found: dict[str, NDArray[Any]] = {
            "mean": part.scale.mean,
            "deviation": part.scale.deviation,
            "log_weights": part.tied.mixtures.log_weights,
            "means": part.tied.mixtures.means.astype(precision),
            "variances": part.tied.mixtures.variances.astype(precision),
            **tree_arrays(part.forest.trees),
        }
        if part.tied.voiced is not None:
            found["voiced"] = part.tied.voiced
        arrays |= {f"{name}/{key}": array for key, array in found.items()}
    return arrays


def joint_from_arrays(arrays: Arrays, config: JointConfig) -> JointHmm:
    """Return the model again. Raises ModelFormatError: something is missing, out of place or out of range."""
    try:
        named = checked(arrays, NAMES)
        units, free, streams = (tuple(named[key].tolist()) for key in ("units", "free", "streams"))
        only(arrays, NAMES, TIMES, (name for name in arrays if name.partition("/")[0] in streams and "/" in name))
        if config.states > arrays["log_stay"].size:
            raise ValueError(f"{config.states} states a unit, of {arrays['log_stay'].size} in all")
        inventory = Inventory(units, free, config.states)
        spoken = tuple(unit for unit, heard in zip(units, named["spoken"], strict=True) if heard)
        if inventory.silence not in spoken:
            raise ValueError("silence was not heard in training")
        if SPEECH not in streams or not set(streams) <= set(STREAMS) or len(set(streams)) < len(streams):
            raise ValueError(f"streams {streams}")
        found = checked(arrays, TIMES, U=len(units), R=len(inventory.rows))
        parts = {name: _part(name, under(arrays, f"{name}/"), inventory) for name in streams}
        bigram = bigram_from(units, found["bigram"])
        return JointHmm(config, inventory, parts, found["log_stay"], found["durations"], spoken, bigram)
    except (KeyError, ValueError, TypeError, IndexError, OverflowError) as error:
        raise ModelFormatError(f"the joint model is damaged ({error}); train or download it again") from error


NAMES = {
    "units": Member(np.str_, "U"),
    "free": Member(np.str_, "F"),
    "spoken": Member(np.int8, "U", 0, 1),
    "streams": Member(np.str_, "S"),
}
TIMES = {
    **BIGRAM,
    "log_stay": Member(np.float64, "R", -1e4, NEGATIVE),
    "durations": Member(np.float64, "R 2", POSITIVE, 1e9),
}
LEAST_STORED_SCALE = LEAST_SCALE / 10
"""As half precision may keep ``LEAST_SCALE``; squares of what is divided by less are not finite in single precision."""
PART = {
    **MIXTURES,
    "mean": Member(np.float64, "D", -1e6, 1e6),
    "deviation": Member(np.float64, "D", LEAST_STORED_SCALE, 1e6),
}
VOICED = {"voiced": Member(np.float64, "G", POSITIVE, BELOW_ONE)}
"""How a model is stored, and each of its streams; R states have no context."""


def _part(name: str, arrays: Arrays, inventory: Inventory) -> Part:
    try:
        table = PART | VOICED if name in F0_STREAMS else PART
        only(arrays, TREES, table)
        forest = Forest(inventory, trees_from_arrays(arrays))
        if list(forest.trees) != list(inventory.trees):
            raise ValueError(f"trees {' '.join(forest.trees)}, required {' '.join(inventory.trees)}")
        found = checked(arrays, table, G=forest.size)
        if name == MOTION and found.sizes["D"] % 3:
            raise ValueError(f"{found.sizes['D']} dimensions")
        tied = Tied(mixtures_from(found), found.arrays.get("voiced"))
        return Part(Scale(found["mean"], found["deviation"]), forest, tied)
    except (KeyError, ValueError) as error:
        raise ValueError(f"{name}: {error}") from error
