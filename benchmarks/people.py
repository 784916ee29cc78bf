"""Several people in one model: the fifth person from four others and s1, against s1 alone.

    python benchmarks/people.py CORPUS -o FOLDER [--clips 100] [--set conditions=0] [--engine trajectory]

Trains on 100 utterances of s1 and one clip of each of four other GRID speakers, and judges the clip of the fifth; five
times. ``alone``: s1 without the others; ``pooled``: all as one person; ``maps``: each person's motion mapped to that of
the mean person. ACC of opening, width and outer: of the fifth person the mean over clips, at the best lag within 60 ms
(as ``anyone.py``), of s1 the figures of ``evaluate`` on ``val``. Corpus: docs/results/voices-people.md.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
from anyone import CHANNELS, best_lag

from lipmotion import Corpus, animate, load_model, save_model
from lipmotion.corpora.store import Selection
from lipmotion.engines import engine_from_settings
from lipmotion.pipeline.evaluation.evaluate import evaluate
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.request import SpeechRequest
from lipmotion.pipeline.training.train import train

MAIN = "s1"


def main() -> None:
    """Print one JSON object a figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path, help="prepared, of s1 and others")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, help="folder for models; those in it are used again"
    )
    parser.add_argument("--clips", type=int, default=100, help="of s1 (default: 100)")
    parser.add_argument("--engine", default="trajectory")
    parser.add_argument("--set", action="append", default=[])
    parser.add_argument("--only", action="append", choices=["alone", "pooled", "maps"])
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    corpus = Corpus.open(options.corpus)
    others = [name for name in corpus.speakers if name and name != MAIN]
    for kind in options.only or ["alone", "pooled", "maps"]:
        each, own = {}, []
        for person in others:
            model = trained(options, corpus, kind, [name for name in others if name != person])
            each[person] = of_person(corpus, model, person)
            if kind != "alone" or not own:
                own.append(of_main(corpus, model))
        means = {name: round(float(np.mean([clip[name] for clip in each.values()])), 3) for name in CHANNELS}
        print(json.dumps({"judged": "the fifth person", "trained": kind, **means, "each": each}), flush=True)
        means = {name: round(float(np.mean([row[name] for row in own])), 4) for name in CHANNELS}
        print(json.dumps({"judged": MAIN, "trained": kind, **means}), flush=True)


def trained(options: argparse.Namespace, corpus: Corpus, kind: str, others: list[str]) -> Model:
    """Return a model of s1, and of some others unless it is to be alone."""
    path = options.output / ("alone.lipmotion" if kind == "alone" else f"{kind}-{'-'.join(others)}.lipmotion")
    if path.exists():
        return load_model(path)
    names = list(corpus.names("train", [MAIN])[: options.clips])
    names += [] if kind == "alone" else [name for person in others for name in corpus.names(None, [person])]
    if kind == "pooled":
        corpus = unnamed(corpus, names, options.output / "unnamed")
    engine = engine_from_settings(options.engine, settings=options.set)
    model, _ = train(corpus, selection=Selection(names=names), engine=engine)
    save_model(model, path)
    return model


def unnamed(corpus: Corpus, names: list[str], folder: Path) -> Corpus:
    """Return a copy of a corpus without the names of the speakers."""
    copy = Corpus.create(folder)
    for name in sorted(set(names) - set(copy.names())):
        copy.add(replace(corpus.utterance(name), speaker=""))
    return copy


def of_person(corpus: Corpus, model: Model, person: str) -> dict[str, float]:
    """Return the correlations of a person's first clip, from audio only."""
    utterance = corpus.utterance(corpus.names(None, [person])[0])
    return best_lag(animate(SpeechRequest(utterance.audio), model=model).motion, utterance.track, 0.06)


def of_main(corpus: Corpus, model: Model) -> dict[str, float]:
    """Return the correlations of s1, from audio only."""
    figures = evaluate(model, corpus, selection=Selection("val", speakers=(MAIN,)))
    channels = figures["conditions"]["audio only"]["channels"]
    return {name: channels[name]["acc"] for name in CHANNELS}


if __name__ == "__main__":
    main()
