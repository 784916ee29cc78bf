"""The two experts of the trajectory engine, each alone and together, in quiet, noise and on other people.

    python benchmarks/experts.py --corpus build/grid-s1 --model build/grid-s1-train.lipmotion [--split val]
        [--strangers-model FILE] [--open FOLDER]

Each line is one weight of the network beside the states: 0 is the states alone, 1 the network alone. The speech of each
clip is understood once for all weights. ``--strangers-model`` (default: the shipped one) speaks for other people.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from anyone import best_lag, compared, conditions, pieces

from lipmotion import Corpus, load_model
from lipmotion.measures.closures import closed_threshold, closure_figures
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.request import Request
from lipmotion.pipeline.understand.understood_speech import understand
from lipmotion.types import Audio, Motion, Track
from lipmotion_faces.tracking.track import track

SHARES = (0.0, 0.2, 0.35, 0.5, 0.75, 1.0)
CONDITIONS = ("quiet", "babble 10 dB", "white 10 dB", "room")


def main() -> None:
    """Print one JSON object for each weight of the network."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--corpora", type=Path, default=Path("../shared/corpora"))
    parser.add_argument("--corpus", type=Path, default=Path("build/grid-s1"), help="prepared, of the training speaker")
    parser.add_argument("--model", type=Path, required=True, help="trained on its list train")
    parser.add_argument("--split", default="val")
    parser.add_argument("--strangers-model", type=Path, help="default: the shipped one")
    parser.add_argument("--open", type=Path, help="folder of videos of people who speak English")
    options = parser.parse_args()
    figures: dict[float, dict[str, Any]] = {share: {} for share in SHARES}
    own_voice(options, figures)
    strangers(options, figures)
    for share, values in figures.items():
        print(json.dumps({"network_share": share, **values}), flush=True)


def generated(model: Model, recording: Audio | Path) -> Iterator[tuple[float, Motion]]:
    """Yield the motion of a recording at each weight of the network, audio only."""
    speech = understand(model, Request(recording))
    for share in SHARES:
        yield share, model.engine.generate(replace(model.learned, network_share=share), speech).motion


def own_voice(options: argparse.Namespace, figures: dict[float, dict[str, Any]]) -> None:
    """Add the pooled correlation of the opening in each condition, and the closure score in quiet."""
    model, corpus = load_model(options.model), Corpus.open(options.corpus)
    threshold = closed_threshold([corpus.utterance(name).track.motion["opening"] for name in corpus.names("train")])
    utterances = [corpus.utterance(name) for name in corpus.names(options.split)]
    condition_of = conditions(options.corpora)
    for name in CONDITIONS:
        pairs: dict[float, list[Any]] = {share: [] for share in SHARES}
        for seed, utterance in enumerate(utterances):
            for share, motion in generated(model, condition_of[name](utterance.audio, seed)):
                pairs[share].append([side[:, 0] for side in compared(motion, utterance.track)])
        for share, sides in pairs.items():
            made, recorded = zip(*sides, strict=True)
            acc = np.corrcoef(np.concatenate(made), np.concatenate(recorded))[0, 1]
            figures[share][name] = round(float(acc), 3)
            if name == "quiet":
                closures = closure_figures(made, recorded, threshold, 25.0)
                figures[share] |= {"closure score": round(closures.score, 3), "precision": round(closures.precision, 3)}


def strangers(options: argparse.Namespace, figures: dict[float, dict[str, Any]]) -> None:
    """Add the mean correlation over clips of other people."""
    model = load_model(options.strangers_model)
    clips: dict[str, list[tuple[Audio | Path, Track]]] = {
        "grid-others": [(path, track(path, crops=False)) for path in (options.corpora / "grid-others").glob("*.mpg")]
    }
    for path in sorted(options.open.rglob("*.mp4")) if options.open else ():
        if "french" not in path.stem:
            clips.setdefault("open", []).extend((audio, piece) for _, audio, piece in pieces(path))
    for name, recordings in clips.items():
        accuracies: dict[float, list[float]] = {share: [] for share in SHARES}
        for recording, tracked in recordings:
            for share, motion in generated(model, recording):
                limit_s = 0.06 if name == "grid-others" else 0.12
                accuracies[share].append(best_lag(motion, tracked, limit_s)["opening"])
        for share, values in accuracies.items():
            figures[share][name] = round(float(np.mean(values)), 3)


if __name__ == "__main__":
    main()
