"""Accuracy of the measured offset of sound and video: clips shifted by known amounts, single and pooled.

    python benchmarks/offset.py CORPUS [--split test] [--step 25] [--reach 200]

Prints one JSON object per method: errors in ms of the offsets that are reported as known, and their share; then the
share of known offsets for clips with the sound of another clip (it should be 0).
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace

import numpy as np

import lipmotion
from lipmotion.measures.offset import Offset, best_offset, pooled_offset
from lipmotion.speech.features.analysed_audio import analysed
from lipmotion.types import FRAME_RATE_HZ, Audio, Utterance
from lipmotion_faces.corpus.sync import clip_scores


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("corpus")
    parser.add_argument("--split")
    parser.add_argument("--step", type=float, default=25.0, help="ms")
    parser.add_argument("--reach", type=float, default=200.0, help="ms")
    parser.add_argument("--pool", type=int, default=5, help="clips pooled")
    options = parser.parse_args()
    corpus = lipmotion.Corpus.open(options.corpus)
    utterances = [corpus.utterance(name) for name in corpus.required(options.split)]
    shifts_ms = np.arange(-options.reach, options.reach + 1, options.step)
    scores = {ms: [clip_scores(late(utterance, ms)) for utterance in utterances] for ms in shifts_ms}
    single = [(best_offset(score, FRAME_RATE_HZ), ms) for ms, row in scores.items() for score in row]
    print(json.dumps({"way": "single clips", "clips": len(utterances), **figures(single)}))
    pools = [
        (pooled_offset(part, FRAME_RATE_HZ), ms) for ms, row in scores.items() for part in parts(row, options.pool)
    ]
    if pools:
        print(json.dumps({"way": f"{options.pool} clips pooled", **figures(pools)}))
    turned = [*utterances[1:], utterances[0]]
    wrong = [
        best_offset(clip_scores(replace(one, audio=other.audio, features=other.features)), FRAME_RATE_HZ)
        for one, other in zip(utterances, turned, strict=True)
    ]
    print(json.dumps({"way": "sound of another clip", "known": share([found.known for found in wrong])}))


def late(utterance: Utterance, by_ms: float) -> Utterance:
    """Return the utterance with its sound shifted against the track."""
    shift = round(by_ms / 1000 * utterance.audio.rate_hz)
    samples = utterance.audio.samples
    moved = np.pad(samples, (shift, 0), mode="reflect") if shift > 0 else samples[-shift:]
    audio = Audio(np.ascontiguousarray(moved), utterance.audio.rate_hz)
    return replace(utterance, audio=audio, features=analysed(audio).mfcc())


def parts(row: list[np.ndarray], count: int) -> list[list[np.ndarray]]:
    """Return the scores in groups of ``count`` clips; the rest is left out."""
    return [row[start : start + count] for start in range(0, len(row) - count + 1, count)]


def figures(found: list[tuple[Offset, float]]) -> dict[str, float]:
    """Return the errors of the known offsets, and of all of them."""
    errors = np.array([1000 * each.late_s - ms for each, ms in found])
    known = np.array([each.known for each, _ in found])
    sure = np.abs(errors[known])
    return {
        "trials": len(found),
        "known": share(known),
        "bias_ms": round(float(np.median(errors[known])), 1),
        "error_median_ms": round(float(np.median(sure)), 1),
        "error_95_ms": round(float(np.quantile(sure, 0.95)), 1),
        "over_80_ms": share(sure > 80),
        "error_95_all_ms": round(float(np.quantile(np.abs(errors), 0.95)), 1),
    }


def share(flags: object) -> float:
    """Return the share of true values."""
    return round(float(np.mean(np.asarray(flags))), 3)


if __name__ == "__main__":
    main()
