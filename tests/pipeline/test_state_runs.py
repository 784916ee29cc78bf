"""The states behind a whole recording."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import lipmotion
from lipmotion import Model, state_runs
from lipmotion.pipeline.generate.explain import StateRun, run_lines, runs_of
from lipmotion.pipeline.request import Request
from lipmotion.testing.toy import ToySentence
from lipmotion.types import Channel, Generation, Motion, Span, StateTrace, Timeline, Unit

UNITS = Timeline((Span(0.0, 0.03, Unit("sil")), Span(0.03, 0.05, Unit("p", "", "papa")), Span(0.05, 0.2, Unit("aa"))))


def generation(states: tuple[str, ...], frames: list[int]) -> Generation:
    motion = Motion(np.zeros((len(frames), 1)), 100.0, (Channel("opening"),))
    return Generation(motion, motion.values, UNITS, StateTrace(states, np.array(frames, np.intp)))


def test_runs_of_frames_with_one_state() -> None:
    assert runs_of(generation(("x", "y"), [0, 0, 0, 1, 1, 0, 0])) == (
        StateRun(0.0, 0.03, "sil", "", "x"),
        StateRun(0.03, 0.05, "p", "papa", "y"),
        StateRun(0.05, 0.07, "aa", "", "x"),
    )
    assert runs_of(generation(("x",), [])) == ()


def test_the_phone_is_the_one_that_takes_most_of_the_run() -> None:
    (run,) = runs_of(generation(("x",), [0] * 20))
    assert (run.phone, run.end_s) == ("aa", 0.2)
    first, second = runs_of(generation(("x", "y"), [0, 0, 0, 0, 1]))
    assert (first.phone, second.phone) == ("sil", "p")
    (beyond,) = runs_of(replace(generation(("x",), [0]), units=Timeline(())))
    assert (beyond.phone, beyond.word) == ("", "")


@pytest.mark.parametrize("name", ["toy_model", "coupled_model"])
def test_runs_are_the_trace_of_what_animate_makes(
    name: str, toy_sentence: ToySentence, request: pytest.FixtureRequest
) -> None:
    model: Model = request.getfixturevalue(name)
    speech = Request(toy_sentence.audio, units=toy_sentence.units)
    trace = lipmotion.animate(speech, model=model).trace
    runs = state_runs(speech, model=model)
    assert all(a.end_s == pytest.approx(b.start_s) for a, b in pairwise(runs))
    assert all(a.state != b.state for a, b in pairwise(runs))
    states = [run.state for run in runs for _ in range(round(100 * (run.end_s - run.start_s)))]
    assert states == [trace.states[frame] for frame in trace.frames]


def test_text_is_bounded() -> None:
    runs = [StateRun(n / 100, (n + 1) / 100, "p", "papa", "s" * 500) for n in range(10)]
    lines = list(run_lines(runs, 4))
    assert len(lines) == 6
    assert lines[1].split()[:4] == ["0.00", "0.01", "p", "papa"]
    assert max(map(len, lines)) < 160
    assert lines[5] == "and 6 more (--count N prints N, --json all)"
    assert len(list(run_lines(runs, 10))) == 11
