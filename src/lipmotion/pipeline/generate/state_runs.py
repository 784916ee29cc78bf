"""The states behind a whole recording: ``state_runs(speech) → runs``, and their text and JSON."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lipmotion.pipeline.generate.animate import animate
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.request import SpeechInput
from lipmotion.printable import printable
from lipmotion.types import Generation

LONGEST_STATE_CHARACTERS = 110
"""Most characters of a state in a line of text."""


@dataclass(frozen=True)
class StateRun:
    """Consecutive frames of generated motion behind which stands one state of the model.

    start_s, end_s : seconds; the frames are centred at times from ``start_s`` (included) to ``end_s`` (excluded)
    phone, word    : which take most of the run; empty: none, or not known
    state          : as in ``Generation.trace``; of the engine ``selection`` it names a recording and the times in it
    """

    start_s: float
    end_s: float
    phone: str
    word: str
    state: str


def state_runs(
    speech: SpeechInput, *, model: Model | str | Path | None = None, transcript: str | Path | None = None
) -> tuple[StateRun, ...]:
    """Return which state of the model stands behind every frame of the motion that ``animate`` generates.

    speech, model, transcript : as of ``animate``
    Returns the runs of frames with one state, in order and without gaps.
    Raises InputError, AlignmentError: as ``animate``.

    >>> import lipmotion
    >>> runs = lipmotion.state_runs("examples/welcome.flac")
    >>> runs[0].start_s, runs[0].state, runs[0].end_s == runs[1].start_s
    (0.0, 'rest', True)
    """
    return runs_of(animate(speech, model=model, transcript=transcript))


def runs_of(generation: Generation) -> tuple[StateRun, ...]:
    """Return the runs of frames with one state of generated motion."""
    frames, rate_hz = generation.trace.frames, generation.motion.rate_hz
    firsts = [0, *(np.flatnonzero(np.diff(frames)) + 1).tolist()] if len(frames) else []
    times_s = [first / rate_hz for first in (*firsts, len(frames))]
    spans, number = generation.units.spans, 0
    runs = []
    for first, start_s, end_s in zip(firsts, times_s, times_s[1:], strict=False):
        while number < len(spans) and spans[number].end_s <= start_s:
            number += 1
        longest_s, phone, word = 0.0, "", ""
        for span in spans[number:]:
            if span.start_s >= end_s:
                break
            shared_s = min(span.end_s, end_s) - max(span.start_s, start_s)
            if shared_s > longest_s:
                longest_s, phone, word = shared_s, span.label.phone, span.label.word
        runs.append(StateRun(start_s, end_s, phone, word, generation.trace.states[frames[first]]))
    return tuple(runs)


def run_lines(runs: Sequence[StateRun], count: int) -> Iterator[str]:
    """Yield runs as lines of text for people to read, the first ``count`` of them, with a title."""
    shown = runs[: max(count, 0)]
    width = max([len("word"), *(len(printable(run.word)) for run in shown)])
    yield f"{'from':>8} {'to':>8}  phone  {'word':{width}}  state"
    for run in shown:
        state = (
            run.state if len(run.state) <= LONGEST_STATE_CHARACTERS else run.state[:LONGEST_STATE_CHARACTERS] + "..."
        )
        yield f"{run.start_s:8.2f} {run.end_s:8.2f}  {run.phone:5}  {run.word:{width}}  {state}"
    if len(runs) > len(shown):
        yield f"and {len(runs) - len(shown)} more (--count N prints N, --json all)"


def run_document(run: StateRun) -> dict[str, Any]:
    """Return a run as an object of JSON (docs/explain.md)."""
    return asdict(run)
