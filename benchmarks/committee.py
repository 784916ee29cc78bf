"""A committee of the three engines: does it pay to weigh each by its own variance, frame by frame?

    python benchmarks/committee.py CORPUS --models FOLDER [--split test]

FOLDER has the engines' models, as ``lipmotion experiment engines --models FOLDER`` leaves them. Printed, audio only and
with transcript, without pins: ACC of opening, width and outer over all frames of each engine and of four means of them:
equal; ``fixed``: by the inverse of each engine's squared error on `val`; ``framewise``: by the inverse of the variance
that each engine states for a frame, multiplied by what its squared errors on `val` are of its stated variances;
``fitted``: weights from 0 that sum to 1 of least squared error on `val`, which sees how the errors go together. Figures
of `val` have seen what was fitted there.
"""

from __future__ import annotations

import argparse
import itertools
import json
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion import Corpus
from lipmotion.corpora.store import Selection
from lipmotion.experiments.engines.engine_comparison import compared_systems
from lipmotion.experiments.engines.models import ENGINES_COMPARED, engine_models
from lipmotion.experiments.runner import ExperimentSettings
from lipmotion.measures.curves import pooled_correlation
from lipmotion.pipeline.evaluation.held_out import held_out_recordings, speech_of_condition
from lipmotion.speech.recognition.recogniser import cached_recogniser

CHANNELS = ("opening", "width", "outer")
GRID = 20
"""Steps of a fitted weight between 0 and 1."""
LEAST_VARIANCE = 1e-12
Array = NDArray[np.float64]


class Clips(NamedTuple):
    """Channels of all frames of a list, where the face was seen, and where each clip ends.

    recorded : [shape=(N, 3)]
    made     : by each engine [shape=(3, N, 3)]
    variance : that each engine states [shape=(3, N, 3)]
    edges    : first frames of the clips but the first
    """

    recorded: Array
    made: Array
    variance: Array
    edges: Array


def main() -> None:
    """Print one JSON object for each condition."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("--models", type=Path, required=True)
    parser.add_argument("--split", default="test")
    options = parser.parse_args()
    corpus = Corpus.open(options.corpus)
    fitted_on, judged = clips_of(corpus, options.models, "val"), clips_of(corpus, options.models, options.split)
    for condition, known in fitted_on.items():
        error = np.square(known.made - known.recorded)
        fixed = 1 / error.mean(axis=1, keepdims=True)
        factor = (error / np.maximum(known.variance, LEAST_VARIANCE)).mean(axis=1, keepdims=True)
        new = judged[condition]
        framewise = 1 / (factor * np.maximum(new.variance, LEAST_VARIANCE))
        fitted = fitted_weights(known)
        systems = dict(zip(ENGINES_COMPARED, np.eye(3)[:, :, None, None] * np.ones((1, 1, 1, 3)), strict=True))
        systems |= {"equal": np.ones((3, 1, 3)), "fixed": fixed, "framewise": framewise, "fitted": fitted}
        acc = {name: correlation(new, weights) for name, weights in systems.items()}
        weights = {name: np.round(each[:, 0], 2).T.tolist() for name, each in (("fixed", fixed), ("fitted", fitted))}
        print(json.dumps({"split": options.split, "condition": condition, "acc": acc, "weights": weights}), flush=True)


def clips_of(corpus: Corpus, models: Path, split: str) -> Mapping[str, Clips]:
    """Return what the engines make of a list in each condition, unpinned, beside the recordings."""
    trained = engine_models(corpus, models, ExperimentSettings())
    recogniser = cached_recogniser(trained["trajectory"].model.phones)
    names = corpus.required(split)
    recordings = held_out_recordings(corpus, recogniser, selection=Selection(names=names), channels=CHANNELS)
    systems = compared_systems(trained)
    result = {}
    for condition in recordings.conditions:
        rows: dict[str, list[tuple[Array, Array]]] = {name: [] for name in ENGINES_COMPARED}
        for name in ENGINES_COMPARED:
            engine, learned = systems[name].engine.without_closures(), systems[name].learned
            for spoken, utterance in zip(
                speech_of_condition(recordings, condition, engine, learned), recordings.utterances, strict=True
            ):
                generation = engine.generate(learned, spoken)
                time_s = seen_s(utterance)
                columns = [generation.motion.names.index(channel) for channel in CHANNELS]
                values, variance = np.asarray(generation.motion.values, float), np.asarray(generation.variance, float)
                at = [
                    np.stack([np.interp(time_s, generation.motion.time_s, x[:, k]) for k in columns], axis=1)
                    for x in (values, variance)
                ]
                rows[name].append((at[0], at[1]))
        recorded = [
            np.stack([u.track.motion[channel][np.asarray(u.track.seen)] for channel in CHANNELS], axis=1)
            for u in recordings.utterances
        ]
        made, variance = (
            np.stack([np.concatenate([pair[k] for pair in rows[name]]) for name in ENGINES_COMPARED]) for k in (0, 1)
        )
        edges = np.cumsum([len(x) for x in recorded])[:-1]
        result[condition] = Clips(np.concatenate(recorded).astype(float), made, variance, edges)
    return result


def seen_s(utterance) -> Array:  # type: ignore[no-untyped-def]
    """Return the times of the frames in which the face was seen."""
    motion = utterance.track.motion
    return (np.arange(len(motion.values)) / motion.rate_hz)[np.asarray(utterance.track.seen)]


def fitted_weights(clips: Clips) -> Array:
    """Return the weights of least squared error of each channel [shape=(3, 1, 3)]."""
    shares = [w for w in itertools.product(range(GRID + 1), repeat=len(ENGINES_COMPARED)) if sum(w) == GRID]
    tried = np.array(shares, float)[:, :, None] / GRID
    best = []
    for channel in range(len(CHANNELS)):
        errors = [
            np.square((w * clips.made[:, :, channel]).sum(axis=0) - clips.recorded[:, channel]).mean() for w in tried
        ]
        best.append(tried[int(np.argmin(errors)), :, 0])
    return np.stack(best, axis=1)[:, None]


def correlation(clips: Clips, weights: Array) -> list[float]:
    """Return the ACC of each channel of a weighted mean; weights [shape=(3, 1 or N, 3)]."""
    shares = weights / weights.sum(axis=0, keepdims=True)
    mean = (shares * clips.made).sum(axis=0)
    found = pooled_correlation(np.split(mean, clips.edges), np.split(clips.recorded, clips.edges))
    return [round(float(each), 4) for each in found]


if __name__ == "__main__":
    main()
