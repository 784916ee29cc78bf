"""How fast the lips part, guessed from the sound alone by a linear map: enough to see whether the two are in step."""

from __future__ import annotations

import json
from collections.abc import Iterable
from functools import cache
from importlib import resources

import numpy as np
from numpy.typing import NDArray

from lipmotion.speech.mfcc import regression_delta
from lipmotion.types import Features

Array = NDArray[np.float64]

STATIC_FEATURES = 13
"""The columns used: c1-c12 and log energy; their surroundings hold the deltas."""
FRAME_OFFSETS = tuple(range(-15, 16, 3))
"""Frames before and after that are looked at: 150 ms either way."""
RIDGE = 100.0
WEIGHTS = "lip-speed.json"


def predicted_opening_speed(features: Features) -> Array:
    """Return how fast the lips are likely to part [shape=(T,)], in no particular unit.

    Of no use as lip motion; its maximum over shifts against tracked lips tells the offset of sound and video.
    """
    return _surroundings(features) @ _weights()


def measured_opening_speed(opening: Array) -> Array:
    """Return how fast measured lips part: the slope over ±2 frames [shape=(T,)]."""
    return regression_delta(opening.astype(np.float32)[:, None])[:, 0].astype(float)


def fit_opening_speed(examples: Iterable[tuple[Features, Array]]) -> Array:
    """Return the weights [shape=(143,)] of the map, by ridge regression.

    examples : features and ``measured_opening_speed`` of the lips [shape=(at most T,)], of clips where the two are in step
    """
    count = STATIC_FEATURES * len(FRAME_OFFSETS)
    products: Array = RIDGE * np.eye(count)
    targets: Array = np.zeros(count)
    for features, measured in examples:
        inputs = _surroundings(features)[: len(measured)]
        inputs -= inputs.mean(axis=0)
        target = measured[: len(inputs)] / max(float(measured.std()), 1e-9)
        products += inputs.T @ inputs
        targets += inputs.T @ target
    return np.asarray(np.linalg.solve(products, targets), float)


def _surroundings(features: Features) -> Array:
    static = features.values[:, :STATIC_FEATURES].astype(float)
    frames = np.arange(len(static))[:, None] + np.array(FRAME_OFFSETS)
    return static[np.clip(frames, 0, len(static) - 1)].reshape(len(static), -1)


@cache
def _weights() -> Array:
    content = json.loads((resources.files("lipmotion") / "models" / WEIGHTS).read_text(encoding="utf-8"))
    return np.array(content["weights"])
