"""Arrays of a model, damaged in every way; and what came of it."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion import Model
from lipmotion.errors import ModelFormatError
from lipmotion.hmm.model import hmm_from_arrays
from lipmotion.motion.eigenlips import eigenlips_from_arrays
from lipmotion.speech.recognition.adaptation import adaptation_from_arrays
from lipmotion.types import Generation, Speech

Array = NDArray[Any]
Damage = Callable[[Array], Array]
LARGEST_DIFFERENCE = 30.0  # spans of what the whole model generates, beyond which motion is absurd


def _one(value: float) -> Damage:
    def change(array: Array) -> Array:
        changed = array.astype(np.float64)
        changed.reshape(-1)[changed.size // 2] = value
        return changed

    return change


DAMAGES: dict[str, Damage] = {
    "times 1000": lambda a: a * (1000 if a.dtype.kind == "f" else np.int64(1000)),
    "a NaN": _one(np.nan),
    "an infinity": _one(np.inf),
    "complex": lambda a: a.astype(complex),
    "dates": lambda a: a.astype("i8").astype("M8[s]"),
    "transposed": lambda a: a.T,
    "a row less": lambda a: a[:-1],
    "emptied": lambda a: a[:0],
}
QUICK = ("times 1000", "a NaN", "dates", "transposed", "a row less")
UNREADABLE = ("a NaN", "an infinity", "complex", "dates", "a row less", "emptied")
"""What no array of numbers survives; texts are not damaged so, nor is what holds one value or none."""


def damaged(arrays: Mapping[str, Array], damages: Mapping[str, Damage]) -> Iterator[tuple[str, str, dict[str, Array]]]:
    for name, array in arrays.items():
        for what, damage in damages.items():
            try:
                changed = damage(array)
            except (TypeError, ValueError, IndexError):  # not of texts
                continue
            same = changed.dtype == array.dtype and np.array_equal(changed, array)
            if not same:
                yield name, what, {**arrays, name: changed}


def animated(model: Model, arrays: Mapping[str, Array], speech: Speech) -> Generation | None:
    """Return what comes of speech; None where the arrays, or what they say, are refused in one line."""
    try:
        learned = model.engine.from_arrays(arrays)
        return model.engine.generate(learned, speech)
    except ModelFormatError as error:
        if "\n" in str(error):
            raise
        return None


def distance(found: Generation, whole: Generation) -> float:
    """Return how far motion goes beyond that of the whole model, in spans of this; infinite if it is not finite."""
    low, high = whole.motion.values.min(axis=0), whole.motion.values.max(axis=0)
    values = found.motion.values
    if not np.isfinite(values).all():
        return float("inf")
    return float((np.maximum(values - high, low - values) / (high - low).max()).max())


READERS: dict[str, Callable[[Mapping[str, Array]], object]] = {
    "adaptation": adaptation_from_arrays,
    "eigenlips": eigenlips_from_arrays,
}


def refused(part: str, model: Model, arrays: Mapping[str, Array]) -> bool:
    """Return whether a part of a model that is not its engine's is refused, in one line."""
    try:
        _ = hmm_from_arrays(arrays, model.phones.config) if part == "phones" else READERS[part](arrays)
    except ModelFormatError as error:
        return "\n" not in str(error)
    return False
