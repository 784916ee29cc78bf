"""A model of one's own from less than a minute of recordings, beside simple alternatives.

    python benchmarks/own_model.py VIDEO [VIDEO ...] [--model FILE] [--pieces 2,4,8]

Each video, or folder of videos, is one talker. It is cut into pieces of five seconds; the first four fifths train, the
last fifth is judged; no transcripts. With ``--pieces``, models are trained on the first 2, 4, 8 ... pieces, too: a
learning curve. Printed: mean correlation of each channel over the judged pieces, for

own        : ``train`` with the model of ``--model`` (default: the one that ships) to start from
alone      : ``train`` with no model to start from
ridge      : ridge regression on ±160 ms of the log mel spectrum, its parameter chosen by cross-validation
mapped     : the shipped model's channels, mapped by least squares on the training pieces
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from pathlib import Path

import numpy as np
from anyone import CHANNELS, compared, correlations, pieces
from numpy.typing import NDArray

from lipmotion import Corpus, animate, load_model, train
from lipmotion.corpora.store import Selection
from lipmotion.errors import CorpusError
from lipmotion.pipeline.model import Model
from lipmotion.speech.features.analysed_audio import analysed
from lipmotion.speech.features.spectrum import spectrum
from lipmotion.types import Audio, Motion, Track, Utterance

RIDGES = tuple(10.0**power for power in range(1, 7))
REACH = 4
"""Steps of 40 ms before and after: 160 ms."""
Curves = NDArray[np.float64]


def main() -> None:
    """Print one JSON object a talker."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("talkers", nargs="+", type=Path)
    parser.add_argument("--model", type=Path, help="to start from; default: the one that ships")
    parser.add_argument("--pieces", default="", metavar="N,N", help="also train on the first N pieces alone")
    options = parser.parse_args()
    prior = load_model(options.model)
    for path in options.talkers:
        files = sorted(path.glob("*.mp4")) if path.is_dir() else [path]
        utterances = [utterance(name, audio, track) for file in files for name, audio, track in pieces(file)]
        count = len(utterances) * 4 // 5
        sizes = [int(size) for size in options.pieces.split(",") if size and int(size) < count]
        for size in [*sizes, count]:
            print(
                json.dumps({"talker": path.stem, **compare(utterances[:size], utterances[count:], prior)}), flush=True
            )


def compare(training: list[Utterance], judged: list[Utterance], prior: Model) -> dict[str, object]:
    """Return the figures of all four on one talker, and the seconds of training."""
    figures: dict[str, object] = {"pieces": [len(training), len(judged)]}
    for name, start in (("own", prior), ("alone", None)):
        begin = time.perf_counter()
        try:
            model = trained(training, start)
        except CorpusError as error:
            figures[name] = str(error)
            continue
        figures[f"{name}_s"] = round(time.perf_counter() - begin, 1)
        figures[name] = mean([animate(u.audio, model=model).motion for u in judged], judged)
    figures["ridge"] = mean(ridge(training, judged), judged)
    figures["mapped"] = mean(mapped(prior, training, judged), judged)
    return figures


def utterance(name: str, audio: Audio, track: Track) -> Utterance:
    """Return a piece as an utterance without transcript."""
    return Utterance(
        name.replace(" ", "-"), audio, analysed(audio).mfcc(), track, None, "train", {"collection": "open"}
    )


def trained(training: list[Utterance], prior: Model | None) -> Model:
    """Return a model of some utterances."""
    with tempfile.TemporaryDirectory() as folder:
        corpus = Corpus.create(Path(folder) / "corpus")
        for each in training:
            corpus.add(each)
        return train(corpus, selection=Selection(None), prior=prior)[0]


def mean(motions: list[Motion], judged: list[Utterance]) -> dict[str, float]:
    """Return the mean correlation of each channel over utterances."""
    each = [correlations(*compared(motion, u.track)) for motion, u in zip(motions, judged, strict=True)]
    return {name: round(float(np.mean([row[name] for row in each])), 3) for name in CHANNELS}


def ridge(training: list[Utterance], judged: list[Utterance]) -> list[Motion]:
    """Return motion by ridge regression on the spectrum."""
    data = [rows_of(window(u.audio), u.track) for u in training]

    def fitted(chosen: list[int], strength: float) -> tuple[Curves, Curves]:
        x = np.concatenate([data[n][0] for n in chosen])
        y = np.concatenate([data[n][1] for n in chosen])
        centred = x - x.mean(axis=0)
        weights = np.linalg.solve(centred.T @ centred + strength * np.eye(x.shape[1]), centred.T @ (y - y.mean(axis=0)))
        return weights, y.mean(axis=0) - x.mean(axis=0) @ weights

    def error(strength: float) -> float:
        total = 0.0
        for fold in range(4):
            weights, offset = fitted([n for n in range(len(data)) if n % 4 != fold], strength)
            total += sum(float(np.square(x @ weights + offset - y)[:, 0].sum()) for x, y in data[fold::4])
        return total

    weights, offset = fitted(list(range(len(data))), min(RIDGES, key=error))
    return [curves(window(u.audio) @ weights + offset, u) for u in judged]


def mapped(prior: Model, training: list[Utterance], judged: list[Utterance]) -> list[Motion]:
    """Return the motion of the model to start from, mapped by least squares."""

    def columns(u: Utterance) -> Curves:
        motion = animate(u.audio, model=prior).motion
        values = np.stack([motion[name][::4] for name in CHANNELS], axis=1)
        return np.concatenate([values, np.ones((len(values), 1))], axis=1)

    pairs = [rows_of(columns(u), u.track) for u in training]
    weights = np.linalg.lstsq(np.concatenate([x for x, _ in pairs]), np.concatenate([y for _, y in pairs]), rcond=None)[
        0
    ]
    return [curves(columns(u) @ weights, u) for u in judged]


def window(audio: Audio) -> Curves:
    """Return the spectrum around every 40 ms [shape=(T', 9·40)]."""
    bands = spectrum(audio).astype(float)
    count = -(-len(bands) // 4)
    padded = np.concatenate([bands, np.repeat(bands[-1:], 4 * count - len(bands), axis=0)])
    steps = padded.reshape(count, 4, -1).mean(axis=1)
    around = np.clip(np.arange(count)[:, None] + np.arange(-REACH, REACH + 1), 0, count - 1)
    return steps[around].reshape(count, -1)


def rows_of(steps: Curves, track: Track) -> tuple[Curves, Curves]:
    """Return inputs at the pictures with a face, and the channels in them."""
    positions = track.motion.time_s * 25
    inputs = np.stack([np.interp(positions, np.arange(len(steps)), column) for column in steps.T], axis=1)
    recorded = np.stack([track.motion[name] for name in CHANNELS], axis=1)
    return inputs[track.seen], recorded[track.seen]


def curves(values: Curves, u: Utterance) -> Motion:
    """Return values every 40 ms as motion."""
    channels = tuple(c for name in CHANNELS for c in u.track.motion.channels if c.name == name)
    return Motion(values, 25.0, channels)


if __name__ == "__main__":
    main()
