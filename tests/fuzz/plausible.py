"""Plausibility checks of results, and short speech for them."""

import json
import math
import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from fuzz.inputs import Good, ImplausibleError
from lipmotion import Corpus, Model, load_model, write
from lipmotion.types import Audio, Generation, Motion
from lipmotion.types.motion import LARGEST_MAGNITUDE

GENERATED = {"eye_distance": 10.0, "weight": 100.0, "grey": 1e6}
"""Largest plausible value of generated motion, by unit: a whole head is two eye distances high."""
LONGEST_S = 3600.0
SHORT = slice(6000, 18_000)
"""Samples of the toy sentence: its first word."""


def require(holds: bool, text: str) -> None:
    if not holds:
        raise ImplausibleError(text)


@cache
def short_speech(good: Good) -> Audio:
    corpus = Corpus.open(good.corpus)
    audio = corpus.utterance(corpus.names()[0]).audio
    return Audio(audio.samples[SHORT].copy(), audio.rate_hz)


@cache
def good_model(good: Good) -> Model:
    return load_model(good.models[0])


def check_motion(motion: Motion, largest_of: Mapping[str, float] = LARGEST_MAGNITUDE) -> None:
    """Raise ImplausibleError unless all values are finite and plausible in their units."""
    require(bool(np.isfinite(motion.values).all()), "values that are not finite")
    for channel, curve in zip(motion.channels, motion.values.T, strict=True):
        largest = float(np.abs(curve).max(initial=0.0))
        require(largest <= largest_of.get(channel.unit, math.inf), f"motion in {channel.unit} that is absurd")


def check_generation(result: Generation) -> None:
    """Raise ImplausibleError unless motion, variance and written files of a generation are plausible."""
    check_motion(result.motion, GENERATED)
    require(len(result.motion.values) <= LONGEST_S * result.motion.rate_hz, "hours of motion")
    require(bool((result.variance >= 0).all()), "a variance that is negative or none")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.json"
        write(result, [path])
        json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse_constant)


def refuse_constant(name: str) -> Any:
    raise ImplausibleError(f"{name} in what was written")
