"""Generations for writers of curves and of cues, and the shortest way to write them."""

import json
from collections.abc import Sequence
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np

from lipmotion.formats import write_motion
from lipmotion.formats.label_files import read_transcript
from lipmotion.types import WEIGHT, Channel, Generation, Motion, Span, StateTrace, TimedTranscript, Timeline, Unit
from testing.toy import toy_motion

_CASES = Path(__file__).with_name("label_cases.json").read_text(encoding="utf-8")
LABEL_CASES: dict[str, dict[str, Any]] = {case["name"]: case for case in json.loads(_CASES)}
"""Labels of every kind as programs and services write them (a text, or a value of JSON), and what is read of each:
words and lines in time, phones with their words and the end of one, or the error."""
NOTHING_SAID: Timeline[Unit] = Timeline(())


def of_motion(motion: Motion, units: Timeline[Unit] = NOTHING_SAID, stepped: tuple[str, ...] = ()) -> Generation:
    trace = StateTrace(("a",), np.zeros(len(motion.values), np.intp))
    return Generation(motion, np.ones_like(motion.values), units, trace, stepped=stepped)


def written(path: Path, generation: Generation, /, **source: str) -> Path:
    write_motion(path, generation, source=source, model={})
    return path


def timeline(phones: Sequence[tuple[str, float]]) -> Timeline[Unit]:
    ends = list(accumulate((duration_s for _, duration_s in phones), initial=0.0))
    return Timeline(tuple(Span(a, b, Unit(phone)) for a, b, (phone, _) in zip(ends, ends[1:], phones, strict=False)))


def result(units: Timeline[Unit], motion: Motion | None = None) -> Generation:
    return of_motion(motion or toy_motion(units, 100.0), units)


def timed(path: Path, **choice: str) -> TimedTranscript:
    transcript = read_transcript(path, **choice)
    assert isinstance(transcript, TimedTranscript)
    return transcript


def spoken(text: str, duration_s: float = 0.1, silence_s: float = 0.3) -> Generation:
    said = [(phone, duration_s) for phone in text.split()]
    return result(timeline([("sil", silence_s), *said, ("sil", silence_s)]))


def generation(*names: str, rate_hz: float = 30.0, frames: int = 31, stepped: tuple[str, ...] = ()) -> Generation:
    """Weights that rest for ten frames, then move; angles of the head, where their names are among them."""
    values = np.random.default_rng(5).random((frames, len(names)))
    values[:10] = 0.25
    for column, name in enumerate(names):
        if name in stepped:
            values[:, column] = np.repeat([0.25, 0.75, 0.5], [10, 10, frames - 20])
        if name.startswith("head"):
            values[:, column] -= 0.5
    channels = tuple(Channel(name, "radian" if name.startswith("head") else WEIGHT) for name in names)
    return of_motion(Motion(values, rate_hz, channels), stepped=stepped)
