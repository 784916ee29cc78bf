"""The opening speed of the lips, predicted from sound by linear regression: it tells the offset of sound and video."""

from __future__ import annotations

import json
from functools import cache
from importlib import resources

import numpy as np
from numpy.typing import NDArray

from lipmotion.speech.features.mfcc import regression_delta
from lipmotion.types import Features

Array = NDArray[np.float64]

STATIC_FEATURES = 13
"""The first columns of the features, which are used: c1–c12 and log energy; their context holds the deltas."""
FRAME_OFFSETS = tuple(range(-15, 16, 3))
"""The context of a frame, in frames from it: 150 ms before and after."""
WEIGHTS = "lip-speed.json"


def predicted_opening_speed(features: Features) -> Array:
    """Return the predicted opening speed of the lips [shape=(T,)], in arbitrary units.

    It is of no use as lip motion; the shift at which it correlates best with tracked lips is the offset of the video.
    """
    return context_features(features) @ _weights()


def measured_opening_speed(opening: Array) -> Array:
    """Return the opening speed of measured lips: the slope over ±2 frames [shape=(T,)].

    opening : of the lips, frame by frame [shape=(T,)]
    """
    return regression_delta(opening.astype(np.float32)[:, None])[:, 0].astype(float)


def context_features(features: Features) -> Array:
    """Return the static features of every frame and its context [shape=(T, 143)]; the ends are repeated."""
    static = features.values[:, :STATIC_FEATURES].astype(float)
    frames = np.arange(len(static))[:, None] + np.array(FRAME_OFFSETS)
    return static[np.clip(frames, 0, len(static) - 1)].reshape(len(static), -1)


@cache
def _weights() -> Array:
    """Return the shipped weights of the prediction [shape=(143,)]."""
    content = json.loads((resources.files("lipmotion") / "models" / WEIGHTS).read_text(encoding="utf-8"))
    return np.array(content["weights"])
