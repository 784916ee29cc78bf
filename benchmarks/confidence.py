"""Whether the confidence of generated motion tells its error: rank correlations over seconds of speech.

    python benchmarks/confidence.py [--open FOLDER] [--corpus FOLDER --trained FILE] [--split val] [--tracks FOLDER]

Recordings: five other GRID speakers; videos of ``--open``; with ``--trained`` (a model that did not see the split) the
clips of ``--corpus``, quiet and in babble and white noise at 10 dB. The error of a second is the mean squared
difference of the opening, in the variance of the recorded one, each about its mean in speech, at the best lag.
Printed: Spearman's correlation of error and doubt (1 − confidence), and the weights of ``types.confidence`` fitted
anew, with the correlation where the weights of each recording were fitted on the others.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from anyone import conditions, lag_of, pieces, show
from kept_tracks import kept_track
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.stats import spearmanr

from lipmotion import Corpus, animate, load_model
from lipmotion.motion.rest import speech_intervals
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.request import Request
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.types import Audio, Generation, Track

Curve = NDArray[np.float64]
LEAST_FRAMES = 20
"""Seconds with fewer measured frames do not count."""
MANY_SECONDS = 8
ROUNDS = 6


class Seconds(NamedTuple):
    """The seconds of speech of one recording: error, confidence [each shape=(S,)], and causes of error [shape=(S, 4)].

    The causes are those that ``types.confidence`` weighs, in its order.
    """

    kind: str
    error: Curve
    confidence: Curve
    causes: Curve


def main() -> None:
    """Print one JSON object a figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--corpora", type=Path, default=Path("../shared/corpora"))
    parser.add_argument("--open", type=Path, help="folder of videos of people who speak")
    parser.add_argument("--corpus", type=Path, default=Path("build/grid-s1"), help="prepared, of the training speaker")
    parser.add_argument("--trained", type=Path, help="model of the speaker of the corpus")
    parser.add_argument("--split", default="val")
    parser.add_argument("--tracks", type=Path, help="where tracks of videos are kept; default: they are not")
    options = parser.parse_args()
    found = [
        seconds_of(kind, animate(Request(audio, pauses="natural"), model=model), track, lag_s)
        for kind, audio, track, model, lag_s in recordings(options)
    ]
    for kind in dict.fromkeys(each.kind for each in found):
        chosen = [each for each in found if each.kind == kind]
        show(f"confidence, {kind}", **figures(chosen, [1 - each.confidence for each in chosen]))
    show("confidence, all", **figures(found, [1 - each.confidence for each in found]))
    apart = [each.causes @ fitted([other for other in found if other is not each]) for each in found]
    weights = fitted(found).round(2).tolist()
    show("confidence, weights of each recording fitted on the others", weights_of_all=weights, **figures(found, apart))


def recordings(options: argparse.Namespace) -> Iterator[tuple[str, Audio, Track, Model, float]]:
    """Yield recordings: kind, sound, track, the model for it, and the greatest lag in seconds."""
    shipped = load_model()
    for path in sorted((options.corpora / "grid-others").glob("*.mpg")):
        yield "GRID strangers", read_audio(path), kept_track(path, options.tracks), shipped, 0.06
    for path in sorted(options.open.rglob("*.mp4")) if options.open else ():
        for _, audio, track in pieces(path, options.tracks, whole=True):
            yield "open", audio, track, shipped, 0.12
    if options.trained is None:
        return
    corpus, model, sounds = Corpus.open(options.corpus), load_model(options.trained), conditions(options.corpora)
    for number, name in enumerate(corpus.names(options.split)):
        utterance = corpus.utterance(name)
        for condition in ("quiet", "babble 10 dB", "white 10 dB"):
            yield f"own, {condition}", sounds[condition](utterance.audio, number), utterance.track, model, 0.06


def seconds_of(kind: str, generation: Generation, track: Track, lag_s: float) -> Seconds:
    """Return error, confidence and causes of error in the seconds of speech."""
    opening, confidence, knowledge = generation.motion["opening"], generation.confidence, generation.knowledge
    if confidence is None or knowledge is None:
        raise SystemExit("the motion has no confidence")
    time_s = track.motion.time_s[track.seen] + lag_of(generation.motion, track, lag_s)
    spoken = np.zeros(len(time_s), bool)
    for start_s, end_s in speech_intervals(generation.units):
        spoken |= (time_s >= start_s) & (time_s < end_s)

    def at(curve: Curve) -> Curve:
        return np.interp(time_s, generation.motion.time_s, curve)

    recorded, made = track.motion["opening"][track.seen], at(opening)
    error = np.square((made - made[spoken].mean()) - (recorded - recorded[spoken].mean())) / recorded.var()
    causes = knowledge.causes(opening, generation.selected(["opening"]).variance[:, 0])
    second = np.floor(np.maximum(time_s, 0)).astype(int)
    frames = np.bincount(second)

    def means(values: Curve) -> Curve:
        return np.bincount(second, values) / np.maximum(frames, 1)

    kept = (frames >= LEAST_FRAMES) & (means(spoken.astype(float)) >= 0.5)
    columns = np.stack([means(at(cause))[kept] for cause in causes], axis=1)
    return Seconds(kind, means(error)[kept], means(at(confidence))[kept], columns)


def figures(found: list[Seconds], doubts: list[Curve]) -> dict[str, object]:
    """Return the rank correlation of doubt and error in all seconds, and in those of every long recording alone."""
    alone = [
        round(float(spearmanr(doubt, each.error).statistic), 2)
        for each, doubt in zip(found, doubts, strict=True)
        if len(doubt) >= MANY_SECONDS
    ]
    pooled = round(
        float(spearmanr(np.concatenate(doubts), np.concatenate([each.error for each in found])).statistic), 3
    )
    errors = np.concatenate([each.error for each in found])
    expected = np.concatenate([1 / each.confidence - 1 for each in found])
    means = {"error": round(float(errors.mean()), 2), "expected": round(float(expected.mean()), 2)}
    return {"recordings": len(found), "seconds": len(errors), **means, "rank_correlation": pooled, "alone": alone}


def fitted(found: list[Seconds]) -> Curve:
    """Return weights of the causes [shape=(4,)], none negative, by least squares of relative errors.

    Every recording counts as much; the expected error of the round before is the unit.
    """
    causes, error = np.concatenate([each.causes for each in found]), np.concatenate([each.error for each in found])
    share = np.concatenate([np.full(len(each.error), len(each.error) ** -0.5) for each in found if len(each.error)])
    expected = np.ones(len(error))
    for _ in range(ROUNDS):
        row = share / expected
        weights, _ = nnls(causes * row[:, None], error * row)
        expected = np.maximum(causes @ weights, 0.05)
    result: Curve = weights
    return result


if __name__ == "__main__":
    main()
