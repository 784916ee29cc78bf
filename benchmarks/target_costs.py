"""Target costs of unit selection, learned: does it pay to fit their weights to motion?

    python benchmarks/target_costs.py CORPUS --model SELECTION.lipmotion [--split test]

On `val`, each candidate of each phone has parts of its target cost (other phones one and two further on, duration,
edges of words, stress, distance to the guide) and a true cost: its distance to the recorded motion. Weights are
learned in two ways: ``regression`` of the true cost on the parts, none below 0 (Hunt & Black 1996, §4); ``risk``: least
expected true cost where candidates are drawn with a probability that falls exponentially with their cost, which is
discriminative: only their order counts. The weight of the guide stays, so that join costs mean the same.
Printed: weights, and ACC of opening, width and outer on the split, unpinned; ``oracle`` guides by the recorded motion.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize, nnls

from lipmotion import Corpus, load_model
from lipmotion.corpora.store import Selection
from lipmotion.engines.selection.config import SelectionConfig
from lipmotion.engines.selection.costs import Costs
from lipmotion.engines.selection.engine import SelectionEngine
from lipmotion.engines.selection.guide import at_points
from lipmotion.engines.selection.model import SelectionModel
from lipmotion.engines.selection.targets import target_of
from lipmotion.measures.curves import pooled_correlation
from lipmotion.motion.resample import model_motion
from lipmotion.pipeline.evaluation.held_out import (
    HeldOutRecordings,
    compare_with_recorded,
    held_out_recordings,
    speech_of_condition,
)
from lipmotion.pipeline.model import Model
from lipmotion.speech.recognition.recogniser import cached_recogniser
from lipmotion.types import Speech

CHANNELS = ("opening", "width", "outer")
NOTHING: dict[str, Any] = {"context": 0, "farther": 0, "word": 0, "stress": 0, "duration": 0, "guide": 0}
PARTS: Mapping[str, dict[str, Any]] = {
    "near": NOTHING | {"context": 1},
    "near and far": NOTHING | {"context": 1, "farther": 1},
    "duration": NOTHING | {"duration": 1},
    "word": NOTHING | {"word": 1},
    "stress": NOTHING | {"stress": 1},
    "guide": NOTHING | {"guide": 1},
}
LEAST_WEIGHT = 1e-3
Array = NDArray[np.float64]


class Phone(NamedTuple):
    """Candidates of one phone: parts of their target costs [shape=(N, 6)], and their true costs [shape=(N,)]."""

    parts: Array
    true: Array


def main() -> None:
    """Print one JSON object for each choice of weights and condition."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("--model", type=Path, required=True)
    parser.add_argument("--split", default="test")
    options = parser.parse_args()
    corpus, model = Corpus.open(options.corpus), load_model(options.model)
    fitted_on, judged = (held_out(corpus, model, split) for split in ("val", options.split))
    for condition in judged.conditions:
        phones = list(candidates(fitted_on, condition, model))
        learned = {"as it is": {}, "regression": regression(phones), "risk": least_risk(phones)}
        for name, weights in learned.items():
            engine = SelectionEngine(replace(SelectionConfig(), **weights)).without_closures()
            spoken = speech_of_condition(judged, condition, engine, model.learned)
            made = compare_with_recorded(judged, spoken, engine, model.learned)
            acc = correlations([clip.generated for clip in made], [clip.original for clip in made])
            show(options.split, condition, name, acc, weights)
        engine = SelectionEngine(SelectionConfig()).without_closures()
        guided = [
            oracle(engine, model.learned, spoken, judged, number)
            for number, spoken in enumerate(speech_of_condition(judged, condition, engine, model.learned))
        ]
        show(options.split, condition, "oracle", correlations(*zip(*guided, strict=True)), {})


def show(split: str, condition: str, name: str, acc: list[float], weights: Mapping[str, float]) -> None:
    """Print one row."""
    shown = {key: round(value, 3) for key, value in weights.items()}
    row = {"split": split, "condition": condition, "weights": name, "acc": acc, "changed": shown}
    print(json.dumps(row), flush=True)


def held_out(corpus: Corpus, model: Model, split: str) -> HeldOutRecordings:
    """Return the recordings of a list."""
    names, recogniser = corpus.required(split), cached_recogniser(model.phones)
    return held_out_recordings(corpus, recogniser, selection=Selection(names=names), channels=CHANNELS)


def candidates(recordings: HeldOutRecordings, condition: str, model: Model) -> Iterator[Phone]:
    """Yield the candidates of every phone of some recordings."""
    learned, config = model.learned, SelectionConfig()
    costs = learned.costs(config)
    parts = [Costs(costs.inventory, replace(config, **changes), costs.scale) for changes in PARTS.values()]
    engine = SelectionEngine(config)
    for number, spoken in enumerate(speech_of_condition(recordings, condition, engine, learned)):
        target, truth = target_of(learned, costs, spoken), recorded_motion(learned, recordings, number)
        if target.by_sound or target.guided is None:
            continue
        wanted = replace(target, guided=at_points(truth, target.windows.times_s) * costs.scale)
        exact = Costs(costs.inventory, replace(config, **PARTS["guide"], trust=0.0), costs.scale)
        for phone in range(len(target)):
            units = costs.candidates(target, phone)
            rows = np.stack([part.target_costs(target, phone, units) for part in parts], axis=1)
            yield Phone(rows, exact.target_costs(wanted, phone, units))


def recorded_motion(learned: SelectionModel, recordings: HeldOutRecordings, number: int) -> Array:
    """Return the recorded motion of one utterance in the motion space [shape=(T, Q)]."""
    utterance = recordings.utterances[number]
    motion, _ = model_motion(utterance.track, len(utterance.features.values))
    names = [channel.name for channel in learned.motion.space.channels]
    return learned.motion.space.reduce(np.stack([motion[name] for name in names], axis=1).astype(float))


def oracle(
    engine: SelectionEngine, learned: SelectionModel, spoken: Speech, recordings: HeldOutRecordings, number: int
) -> tuple[Array, Array]:
    """Return channels of what a perfect guide makes of one utterance, and of the recording [each shape=(T, 3)]."""
    truth = recorded_motion(learned, recordings, number)
    made = engine.generate_guided(learned, spoken, truth).motion
    utterance = recordings.utterances[number]
    motion, valid = model_motion(utterance.track, len(utterance.features.values))
    return tuple(np.stack([x[name][valid] for name in CHANNELS], axis=1).astype(float) for x in (made, motion))  # type: ignore[return-value]


def regression(phones: list[Phone]) -> dict[str, float]:
    """Return weights by regression of the true cost on the parts, with a constant for each phone."""
    rows = np.concatenate([phone.parts - phone.parts.mean(axis=0) for phone in phones])
    true = np.concatenate([phone.true - phone.true.mean() for phone in phones])
    return as_options(nnls(rows, true)[0])


def least_risk(phones: list[Phone]) -> dict[str, float]:
    """Return weights of the least expected true cost."""
    start = np.log(np.maximum([0.2, 0.1, 0.3, 0.05, 0.05, 20.0], LEAST_WEIGHT))

    def risk(logarithms: Array) -> tuple[float, Array]:
        weights, total, gradient = np.exp(logarithms), 0.0, np.zeros(len(logarithms))
        for phone in phones:
            costs = phone.parts @ weights
            share = np.exp(costs.min() - costs)
            share /= share.sum()
            expected = float(share @ phone.true)
            total += expected
            gradient -= ((share * (phone.true - expected)) @ phone.parts) * weights
        return total / len(phones), gradient / len(phones)

    found = minimize(
        risk, start, jac=True, method="L-BFGS-B", bounds=[(np.log(LEAST_WEIGHT), np.log(1e3))] * len(start)
    )
    return as_options(np.exp(found.x))


def as_options(weights: Array) -> dict[str, float]:
    """Return options with the proportions of some weights of ``PARTS``, and the weight of the guide that they have."""
    near, both, duration, word, stress, _ = weights * (SelectionConfig().guide / max(weights[-1], LEAST_WEIGHT))
    context = near + both
    farther = both / max(context, LEAST_WEIGHT)
    return {"context": context, "farther": farther, "duration": duration, "word": word, "stress": stress}


def correlations(made: Any, recorded: Any) -> list[float]:
    """Return the ACC of each channel."""
    return [round(float(each), 4) for each in pooled_correlation(list(made), list(recorded))]


if __name__ == "__main__":
    main()
