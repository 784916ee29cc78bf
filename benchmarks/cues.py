"""Cues on held-out recordings: closures, silence and flicker; and the time of the selection.

    python benchmarks/cues.py MODEL CORPUS [--split test] [--fps 24]

Phones are those of the transcripts, aligned by the model (audio only: ``--recognised``). The baseline selects each
frame alone from the same costs, without a hold and without a cost of changes.
"""

from __future__ import annotations

import argparse
import json
import time
from itertools import pairwise

import numpy as np

import lipmotion
from lipmotion.articulation.cue_sheets import (
    CueSheet,
    choose_cues,
    cue_frame_count,
    cue_sheet,
    default_hold_frames,
    frame_costs,
)
from lipmotion.pipeline.training.train import phones_of
from lipmotion.speech.recognition.recogniser import cached_recogniser
from lipmotion.types import Generation, Motion, Speech, StateTrace, Timeline
from lipmotion.units import LIP_CLOSING, VISEMES, Lexicon, is_silent
from lipmotion.units.mouth_chart import SHAPES

MARGIN_S = 0.1
"""Silence this close to speech is not counted: the mouth may already move."""


def main() -> None:
    """Print one JSON object per method of selection, and the time for an hour."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("model")
    parser.add_argument("corpus")
    parser.add_argument("--split", default="test")
    parser.add_argument("--fps", type=float, default=24.0)
    parser.add_argument("--recognised", action="store_true", help="phones from the audio alone")
    options = parser.parse_args()
    model, corpus = lipmotion.load_model(options.model), lipmotion.Corpus.open(options.corpus)
    recogniser = cached_recogniser(model.phones, "own")
    results, references = [], []
    for name in corpus.required(options.split):
        utterance = corpus.utterance(name)
        aligned = phones_of(utterance, recogniser, Lexicon())
        recognised = options.recognised
        units = recogniser.recognise(utterance.audio, utterance.features) if recognised else aligned
        results.append(model.engine.generate(model.learned, Speech(utterance.features, units)))
        references.append(aligned)
    for way, choose in (("cues", choose_cues), ("frame by frame", frame_by_frame)):
        sheets = [choose(result, options.fps) for result in results]
        print(json.dumps({"way": way, "clips": len(sheets), **figures(sheets, references, options.fps)}))
    hour = an_hour(results)
    start = time.perf_counter()
    choose_cues(hour, options.fps)
    print(json.dumps({"figure": "cues of an hour", "value": round(time.perf_counter() - start, 2), "unit": "s"}))


def frame_by_frame(result: Generation, fps: float) -> CueSheet:
    """Return the cue sheet of the shape with least cost in every frame."""
    duration_s = max((len(result.motion.values) - 1) / result.motion.rate_hz, result.units[-1].end_s)
    best = frame_costs(result, cue_frame_count(duration_s, fps), fps).argmin(axis=1).tolist()
    changes = [0, *(k for k, (before, after) in enumerate(pairwise(best), start=1) if before != after)]
    names = list(SHAPES)
    return cue_sheet([(k, names[best[k]]) for k in changes], duration_s, fps, "".join(names))


def figures(sheets: list[CueSheet], references: list[Timeline], fps: float) -> dict[str, object]:
    """Return the figures of docs/cues.md."""
    seen = {"p b m": [0, 0], "f v": [0, 0]}
    silent: list[bool] = []
    lengths = [int(fps * b.start_s) - int(fps * a.start_s) for s in sheets for a, b in pairwise(s.cues)]
    for sheet, units in zip(sheets, references, strict=True):
        for span in units:
            for kind, phones, shape in (("p b m", LIP_CLOSING, "A"), ("f v", VISEMES["ld"], "G")):
                if span.label.phone in phones:
                    seen[kind][1] += 1
                    seen[kind][0] += any(
                        c.label == shape and c.start_s < span.end_s + 1 / fps and c.end_s > span.start_s - 1 / fps
                        for c in sheet.cues
                    )
        silent += [shape_at(sheet, t) in "AX" for t in silent_frames(units, fps)]
    duration_s = sum(sheet.duration_s for sheet in sheets)
    flicker = sum(length < default_hold_frames(fps) for length in lengths)
    return {
        **{f"{kind} seen": f"{hit} of {wanted}" for kind, (hit, wanted) in seen.items()},
        "A or X in silence": round(float(np.mean(silent)), 4),
        "changes per second": round(len(lengths) / duration_s, 2),
        "shortest, frames": min(lengths),
        "shapes under the hold": flicker,
    }


def silent_frames(units: Timeline, fps: float) -> list[float]:
    """Return the middle of every frame that lies in silence, ``MARGIN_S`` away from speech."""
    middles = (np.arange(int(units[-1].end_s * fps)) + 0.5) / fps
    spans = [span for span in units if not is_silent(span.label.phone)]
    return [t for t in middles.tolist() if all(t < s.start_s - MARGIN_S or t > s.end_s + MARGIN_S for s in spans)]


def shape_at(sheet: CueSheet, time_s: float) -> str:
    """Return the shape that is shown at a time."""
    return next((cue.label for cue in sheet.cues if cue.start_s <= time_s < cue.end_s), sheet.rest)


def an_hour(results: list[Generation]) -> Generation:
    """Return a concatenation of results that lasts an hour."""
    values, spans, start_s, turn = [], [], 0.0, 0
    while start_s < 3600:
        result = results[turn % len(results)]
        values.append(result.motion.values)
        spans += result.units.shifted(start_s).spans
        start_s, turn = start_s + len(result.motion.values) / result.motion.rate_hz + 0.01, turn + 1
    motion = Motion(np.concatenate(values), results[0].motion.rate_hz, results[0].motion.channels)
    nothing = StateTrace(("",), np.zeros(len(motion.values), np.intp))
    return Generation(motion, motion.values, Timeline(tuple(spans)), nothing)


if __name__ == "__main__":
    main()
