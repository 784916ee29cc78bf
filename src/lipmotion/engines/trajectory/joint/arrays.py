"""A joint model as plain arrays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.trajectory.joint.densities import Scale, Tied
from lipmotion.engines.trajectory.joint.forest import Forest
from lipmotion.engines.trajectory.joint.inventory import Inventory
from lipmotion.engines.trajectory.joint.model import JointConfig, JointHmm, Part
from lipmotion.engines.trajectory.joint.streams import F0_STREAMS, MOTION, SPEECH, STREAMS
from lipmotion.errors import ModelFormatError
from lipmotion.stats.bigram import Bigram
from lipmotion.stats.mixture import Mixtures
from lipmotion.stats.trees import tree_arrays, trees_from_arrays

Arrays = Mapping[str, NDArray[Any]]


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
    """Return the model again. Raises ModelFormatError: something is missing, has the wrong shape or is no number."""
    try:
        units, free, streams = (tuple(map(str, arrays[key])) for key in ("units", "free", "streams"))
        inventory = Inventory(units, free, config.states)
        _check(arrays, {"spoken": (len(units),)})
        spoken = tuple(unit for unit, heard in zip(units, arrays["spoken"], strict=True) if heard)
        if inventory.silence not in spoken:
            raise ValueError("silence was not heard in training")
        if SPEECH not in streams or not set(streams) <= set(STREAMS) or len(set(streams)) < len(streams):
            raise ValueError(f"streams {streams}")
        states, count = len(inventory.rows), len(units)
        _check(arrays, {"log_stay": (states,), "durations": (states, 2), "bigram": (count, count)})
        if not (arrays["log_stay"] < 0).all() or not (arrays["durations"] > 0).all():
            raise ValueError("probabilities not less than 1, or durations not more than 0")
        parts = {name: _part(arrays, name, inventory) for name in streams}
        bigram = Bigram(units, arrays["bigram"].astype(np.float32))
        times = arrays["log_stay"].astype(float), arrays["durations"].astype(float)
        return JointHmm(config, inventory, parts, *times, spoken, bigram)
    except (KeyError, ValueError, TypeError, IndexError, OverflowError) as error:
        raise ModelFormatError(f"the joint model is damaged ({error}); train or download it again") from error


def _part(arrays: Arrays, name: str, inventory: Inventory) -> Part:
    mine = {key.partition("/")[2]: array for key, array in arrays.items() if key.startswith(f"{name}/")}
    forest = Forest(inventory, trees_from_arrays(mine))
    if list(forest.trees) != list(inventory.trees):
        raise ValueError(f"{name}: trees {' '.join(forest.trees)}, required {' '.join(inventory.trees)}")
    dimensions, components = len(mine["mean"]), mine["means"].shape[1]
    each = (forest.size, components, dimensions)
    shapes = {"mean": each[2:], "deviation": each[2:], "means": each, "variances": each}
    _check(mine, shapes | ({"voiced": each[:1]} if name in F0_STREAMS else {}))
    _check_values(mine, name, each)
    voiced = mine["voiced"].astype(float) if name in F0_STREAMS else None
    mixtures = Mixtures(*(mine[key].astype(np.float32) for key in ("log_weights", "means", "variances")))
    return Part(Scale(mine["mean"].astype(float), mine["deviation"].astype(float)), forest, Tied(mixtures, voiced))


def _check_values(arrays: Arrays, name: str, each: tuple[int, int, int]) -> None:
    log_weights = arrays["log_weights"]
    if log_weights.shape != each[:2] or not np.isfinite(log_weights.max(axis=1)).all() or (log_weights > 1).any():
        raise ValueError(f"{name}: a leaf without a Gaussian of a finite weight")
    if not (arrays["variances"] > 0).all() or not (arrays["deviation"] > 0).all():
        raise ValueError(f"{name}: variances or deviations that are not more than 0")
    if "voiced" in arrays and not ((arrays["voiced"] > 0) & (arrays["voiced"] < 1)).all():
        raise ValueError(f"{name}: probabilities that are not between 0 and 1")
    if each[2] < 1 or (name == MOTION and each[2] % 3):
        raise ValueError(f"{name}: {each[2]} dimensions")


def _check(arrays: Arrays, shapes: Mapping[str, tuple[int, ...]]) -> None:
    for name, shape in shapes.items():
        if arrays[name].shape != shape:
            raise ValueError(f"{name} of shape {arrays[name].shape}, required {shape}")
        if not np.isfinite(arrays[name]).all():
            raise ValueError(f"{name} holds values that are not finite")
