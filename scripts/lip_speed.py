"""Fit the map from sound to lip speed that tells the offset of sound and video.

    python scripts/lip_speed.py CORPUS [--split train]

CORPUS is a prepared corpus whose sound and video are in step. Writes src/lipmotion/models/lip-speed.json.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

import lipmotion
from lipmotion.motion.space import resample_to_model
from lipmotion.types import Features
from lipmotion_faces.corpus.sound_offset import (
    FRAME_OFFSETS,
    STATIC_FEATURES,
    WEIGHTS,
    measure_opening_speed,
    stack_context,
)

RIDGE = 100.0


def main() -> None:
    """Write the weights, with whose recordings they come from."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("corpus")
    parser.add_argument("--split", default="train")
    options = parser.parse_args()
    corpus = lipmotion.Corpus.open(options.corpus)
    names = corpus.required(options.split)
    weights = fit_opening_speed(examples(corpus, names))
    sources = [corpus.utterance(name).source for name in names]
    content = {
        "about": f"c1-c12 and log energy, {len(FRAME_OFFSETS)} frames around, to the speed of the lips' opening",
        "clips": len(names),
        "licence": sorted({source.get("licence", "") for source in sources}),
        "attribution": sorted({source.get("attribution", "") for source in sources}),
        "weights": [float(f"{weight:.4g}") for weight in weights],
    }
    target = Path(__file__).parents[1] / "src" / "lipmotion" / "models" / WEIGHTS
    target.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    print(f"{target}: {STATIC_FEATURES * len(FRAME_OFFSETS)} weights from {len(names)} clips")


def fit_opening_speed(examples: Iterable[tuple[Features, np.ndarray]]) -> np.ndarray:
    """Return the weights of the prediction [shape=(143,)], by ridge regression.

    examples : features, and the ``measure_opening_speed`` of the lips [shape=(at most T,)], of clips where both are in
               step
    """
    count = STATIC_FEATURES * len(FRAME_OFFSETS)
    products = RIDGE * np.eye(count)
    targets = np.zeros(count)
    for features, measured in examples:
        inputs = stack_context(features)[: len(measured)]
        inputs -= inputs.mean(axis=0)
        target = measured[: len(inputs)] / max(float(measured.std()), 1e-9)
        products += inputs.T @ inputs
        targets += inputs.T @ target
    return np.linalg.solve(products, targets)


def examples(corpus: lipmotion.Corpus, names: tuple[str, ...]) -> Iterator[tuple[Features, np.ndarray]]:
    """Yield features and lip speed of the clips whose face is seen throughout."""
    for name in names:
        utterance = corpus.utterance(name)
        motion, seen = utterance.track.motion, np.asarray(utterance.track.seen)
        if seen.all():
            opening = np.asarray(motion["opening"], float)[:, None]
            frames = len(utterance.features.values)
            values, valid = resample_to_model(opening, seen, motion.rate_hz, frames)
            yield utterance.features, measure_opening_speed(values[valid, 0])


if __name__ == "__main__":
    main()
