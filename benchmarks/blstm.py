"""A BLSTM beside the models of ``lipmotion experiment learning-curve``: the same recordings, the same order of them.

    python benchmarks/blstm.py CORPUS --order FILE [--sizes 20,50,100,200,452] [--split val] [--tune]

Two layers of 192 cells in each direction (``experiments/baselines/recurrent.py``; needs the extra ``network``), from 39
acoustic features, and from these with 120 principal components of the posteriors of the phone recogniser, which are
those that our own networks know. ``--tune`` tries dropout, learning rate and epochs, with 100 recordings.
Printed: ACC of opening, width and outer on the split, over all frames; audio only; without pins, which the BLSTM lacks.
"""

from __future__ import annotations

import argparse
import itertools
import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion import Corpus
from lipmotion.corpora.splits import read_names
from lipmotion.measures.curves import pooled_correlation
from lipmotion.motion.posterior_network import COMPONENTS, LEAST_LOG_POSTERIOR
from lipmotion.motion.resample import model_motion
from lipmotion.speech.recognition.network.posteriors import installed_phone_recogniser, token_posteriors
from lipmotion.types import Example, Speech, Timeline, silent_monitor
from lipmotion_lab.baselines import recurrent

CHANNELS = ("opening", "width", "outer")
TRIED = {"DROPOUT": (0.3, 0.5), "LEARNING_RATE": (2e-3, 4e-3), "EPOCHS": (40, 80)}
TUNED_WITH = 100
BEST = {"DROPOUT": 0.5, "LEARNING_RATE": 4e-3, "EPOCHS": 80}
"""What ``--tune`` finds best on `val`, with posteriors."""


def main() -> None:
    """Print one JSON object for each network."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("--order", type=Path, required=True)
    parser.add_argument("--sizes", default="20,50,100,200,452")
    parser.add_argument("--split", default="val")
    parser.add_argument("--inputs", default="features,posteriors", help="which of both")
    parser.add_argument("--tune", action="store_true")
    options = parser.parse_args()
    corpus = Corpus.open(options.corpus)
    order = read_names(options.order)
    sizes = [TUNED_WITH] if options.tune else [int(size) for size in options.sizes.split(",")]
    trained = list(examples(corpus, order[: max(sizes)]))
    judged = list(examples(corpus, sorted(corpus.required(options.split))))
    for inputs in options.inputs.split(","):
        for size in sizes:
            part = with_posteriors(trained[:size], [*trained[:size], *judged]) if inputs == "posteriors" else None
            known, new = (part[:size], part[size:]) if part else (trained[:size], judged)
            for settings in combinations() if options.tune else (BEST,):
                start_s = process_time()
                acc = accuracies(known, new, settings)
                row = {"inputs": inputs, "clips": size, **settings, "acc": acc, "seconds": process_time() - start_s}
                print(json.dumps(row), flush=True)


def combinations() -> Iterator[dict[str, Any]]:
    """Yield the settings that are tried."""
    for values in itertools.product(*TRIED.values()):
        yield dict(zip(TRIED, values, strict=True))


def examples(corpus: Corpus, names: Sequence[str]) -> Iterator[Example]:
    """Yield speech with motion, without phones in time."""
    for name in names:
        utterance = corpus.utterance(name)
        motion, valid = model_motion(utterance.track, len(utterance.features.values))
        speech = Speech(utterance.features, Timeline(()))
        recogniser = installed_phone_recogniser()
        if recogniser is not None:
            speech = replace(speech, posteriors=token_posteriors(recogniser, utterance.audio))
        yield Example(utterance.name, speech, motion, valid)


def with_posteriors(known: Sequence[Example], all_of_them: Sequence[Example]) -> list[Example]:
    """Return examples whose features have components of the posteriors; these are of the examples in ``known``."""
    rows = np.concatenate([logarithms(example) for example in known])
    mean = rows.mean(axis=0)
    values, vectors = np.linalg.eigh(np.cov(rows - mean, rowvar=False))
    basis = vectors[:, ::-1][:, :COMPONENTS] * (2 / np.sqrt(values[-1]))
    result = []
    for example in all_of_them:
        features = example.speech.features
        components = (logarithms(example) - mean) @ basis
        at = np.minimum(np.arange(len(features.values)) // 2, len(components) - 1)
        both = np.concatenate([np.asarray(features.values), components[at]], axis=1).astype(np.float32)
        speech = replace(example.speech, features=replace(features, values=both))
        result.append(replace(example, speech=speech))
    return result


def logarithms(example: Example) -> NDArray[np.float64]:
    """Return the logarithms of the posteriors of an example [shape=(N, K)]."""
    posteriors = example.speech.posteriors
    if posteriors is None:
        raise SystemExit("no phone recogniser is installed; --inputs features needs none")
    return np.maximum(posteriors.values.astype(float), LEAST_LOG_POSTERIOR)


def accuracies(known: Sequence[Example], new: Sequence[Example], settings: dict[str, Any]) -> list[float]:
    """Return the ACC of each channel on new examples; settings are constants of ``recurrent``."""
    for name, value in settings.items():
        setattr(recurrent, name, value)
    baseline = recurrent.BlstmBaseline()
    model = baseline.fit(known, silent_monitor).model
    made, recorded = [], []
    for example in new:
        motion = baseline.generate(model, example.speech).motion
        made.append(np.stack([motion[name][example.valid] for name in CHANNELS], axis=1))
        recorded.append(np.stack([example.motion[name][example.valid] for name in CHANNELS], axis=1))
    return [float(each) for each in pooled_correlation(made, recorded)]


if __name__ == "__main__":
    main()
