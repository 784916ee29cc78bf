"""Several people in one model: the fifth person from four others and s1, against s1 alone.

    python benchmarks/people.py CORPUS -o FOLDER [--clips 100] [--set conditions=0] [--engine trajectory]

Trains on 100 utterances of s1 and one clip of each of four other GRID speakers, and judges the clip of the fifth; five
times. ``alone``: s1 without the others; ``pooled``: all as one person; ``maps``: each person's motion mapped to that of
the mean person; ``nearest``: the same models, with the motion of the person whose voice is most like the fifth's.
ACC of opening, width and outer: of the fifth person the mean over clips, at the best lag within 60 ms (as
``anyone.py``), of s1 the figures of ``evaluate`` on ``val``. Distance: mean absolute difference of the three channels
without a lag, their sum. Corpus: docs/results/voices.md.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from anyone import CHANNELS, best_lag, compared
from numpy.typing import NDArray

from lipmotion import Corpus, animate, load_model, save_model
from lipmotion.corpora.store import Selection
from lipmotion.engines import engine_from_settings
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.request import Request
from lipmotion.pipeline.training.train import train
from lipmotion_lab.evaluation.evaluate import evaluate

MAIN = "s1"
KINDS = ["alone", "pooled", "maps", "nearest"]


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
    parser.add_argument("--only", action="append", choices=KINDS)
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    corpus = Corpus.open(options.corpus)
    others = [name for name in corpus.speakers if name and name != MAIN]
    for kind in options.only or KINDS:
        each, own = {}, []
        for person in others:
            model = trained(options, corpus, kind, [name for name in others if name != person])
            whose = nearest(corpus, model, person) if kind == "nearest" else ""
            each[person] = of_person(corpus, model, person, whose) | ({"whose": whose} if whose else {})
            if kind in ("pooled", "maps") or (kind == "alone" and not own):
                own.append(of_main(corpus, model))
        show("the fifth person", kind, [*CHANNELS, "distance"], list(each.values()), each=each)
        if own:
            show(MAIN, kind, CHANNELS, own)


def show(judged: str, kind: str, figures: Sequence[str], rows: Sequence[Mapping[str, Any]], **more: object) -> None:
    """Print the mean of each figure over rows."""
    means = {name: round(float(np.mean([row[name] for row in rows])), 4) for name in figures}
    print(json.dumps({"judged": judged, "trained": kind, **means, **more}), flush=True)


def trained(options: argparse.Namespace, corpus: Corpus, kind: str, others: list[str]) -> Model:
    """Return a model of s1, and of some others unless it is to be alone."""
    kind = "maps" if kind == "nearest" else kind
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


def nearest(corpus: Corpus, model: Model, person: str) -> str:
    """Return the speaker of a model whose mean spectrum in the louder half of the frames is most like a person's."""
    assert model.speakers is not None
    return min(
        model.speakers.names, key=lambda other: float(np.linalg.norm(voice(corpus, other) - voice(corpus, person)))
    )


def voice(corpus: Corpus, speaker: str) -> NDArray[np.float64]:
    """Return a speaker's mean cepstrum in the louder half of the frames of at most 20 clips [shape=(12,)]."""
    frames = [np.asarray(corpus.utterance(name).features.values)[:, :13] for name in corpus.names(None, [speaker])[:20]]
    return np.concatenate([rows[rows[:, 0] > np.median(rows[:, 0]), 1:] for rows in frames]).mean(axis=0)


def of_person(corpus: Corpus, model: Model, person: str, whose: str) -> dict[str, Any]:
    """Return the figures of a person's first clip, from audio only, in the motion of another person of the model."""
    utterance = corpus.utterance(corpus.names(None, [person])[0])
    motion = animate(Request(utterance.audio, speaker=whose), model=model).motion
    generated, recorded = compared(motion, utterance.track)
    distance = float(np.abs(generated - recorded).mean(axis=0).sum())
    return {**best_lag(motion, utterance.track, 0.06), "distance": round(distance, 4)}


def of_main(corpus: Corpus, model: Model) -> dict[str, float]:
    """Return the correlations of s1, from audio only."""
    figures = evaluate(model, corpus, selection=Selection("val", speakers=(MAIN,)))
    channels = figures["conditions"]["audio only"]["channels"]
    return {name: channels[name]["acc"] for name in CHANNELS}


if __name__ == "__main__":
    main()
