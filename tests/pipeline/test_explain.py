import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import lipmotion
from lipmotion import Model, Request, state_runs
from lipmotion.errors import InputError
from lipmotion.pipeline.generate import explain
from lipmotion.types import Channel, Generation, Motion, Span, StateTrace, Timeline, Unit

WORDS = "See Bob, papa & mama!"


def test_it_explains_what_animate_makes(coupled_model, toy_speech):
    result = lipmotion.animate(toy_speech, model=coupled_model, transcript=WORDS)
    one, other = lipmotion.explain(toy_speech, at=[0.804, 1.0], model=coupled_model, transcript=WORDS)
    assert (one.frame, one.time_s, other.frame) == (80, 0.8, 100)
    assert one.state == result.trace.states[result.trace.frames[80]]
    assert [value.value for value in one.motion.values()] == pytest.approx(result.motion.values[80].tolist())
    assert one.span in result.units.spans
    assert [one.confidence, other.confidence] == pytest.approx(result.confidence[[80, 100]].tolist(), abs=1e-6)
    (same,) = lipmotion.explain(Request(toy_speech, units=result.units), at=0.8, model=coupled_model)
    assert same.state == one.state
    assert [chain.name for chain in one.chains] == ["sVis", "2vis"]
    assert sum(one.chains[1].lead.values()) == pytest.approx(1, abs=1e-4)


def test_a_model_file_and_any_engine(toy_model_file, toy_speech):
    (found,) = lipmotion.explain(toy_speech, at=0.8, model=toy_model_file)
    assert "speech." in found.state or found.state == "rest"
    assert (found.chains, found.gaussians, found.joint) == ((), (), None)


def test_the_text_names_everything(coupled_model, toy_sentence):
    (found,) = lipmotion.explain(toy_sentence.audio, at=0.8, model=coupled_model, transcript=WORDS)
    text = explain.write_explanation(found)
    lines = text.splitlines()
    assert lines[0] == "0.80 s (frame 80)"
    for start in ("phone", "state", "chain 1: sVis", "chain 2: 2vis", "together", "asynchrony", "Gaussian of speech"):
        assert any(line.startswith(f"  {start} ") for line in lines)
    assert found.state in text
    for gaussian in found.gaussians:
        assert f"{gaussian.density} " in text
    opening = found.motion["opening"]
    assert f"opening {opening.value:6.3f} ± {opening.deviation:.3f}" in text
    assert f"confidence {found.confidence:.2f}" in " ".join(text.split())
    assert max(map(len, lines)) < 150
    assert text == "\n".join(line.rstrip() for line in lines)


def test_the_document_is_json_with_all_channels(coupled_model, toy_sentence):
    (found,) = lipmotion.explain(toy_sentence.audio, at=0.8, model=coupled_model)
    document = json.loads(json.dumps(explain.write_document(found), allow_nan=False))
    assert document["frame"] == 80
    assert list(document["motion"]) == list(found.motion)
    lead = document["chains"][1]["lead"]
    expected = sum(int(states) * probability for states, probability in lead.items())
    assert document["chains"][1]["expected_lead"] == pytest.approx(expected)
    assert "expected_lead" not in document["chains"][0]
    assert np.isfinite(document["gaussians"][1]["channels"]["opening"]["deviation"])


def test_times_within_and_outside_the_recording(coupled_model, toy_sentence):
    result = lipmotion.animate(toy_sentence.audio, model=coupled_model)
    last_s = float(result.motion.time_s[-1])
    (last,) = lipmotion.explain(toy_sentence.audio, at=last_s, model=coupled_model)
    assert last.frame == len(result.motion.values) - 1
    with pytest.raises(InputError, match=rf"outside the recording \(0 to {last_s:.2f} s\)"):
        lipmotion.explain(toy_sentence.audio, at=[0.1, 1e6], model=coupled_model)


UNITS = Timeline((Span(0.0, 0.03, Unit("sil")), Span(0.03, 0.05, Unit("p", "", "papa")), Span(0.05, 0.2, Unit("aa"))))


def generation(states: tuple[str, ...], frames: list[int]) -> Generation:
    motion = Motion(np.zeros((len(frames), 1)), 100.0, (Channel("opening"),))
    return Generation(motion, motion.values, UNITS, StateTrace(states, np.array(frames, np.intp)))


def test_runs_of_frames_with_one_state():
    assert explain.list_runs(generation(("x", "y"), [0, 0, 0, 1, 1, 0, 0])) == (
        explain.StateRun(0.0, 0.03, "sil", "", "x"),
        explain.StateRun(0.03, 0.05, "p", "papa", "y"),
        explain.StateRun(0.05, 0.07, "aa", "", "x"),
    )
    assert explain.list_runs(generation(("x",), [])) == ()
    (beyond,) = explain.list_runs(replace(generation(("x",), [0]), units=Timeline(())))
    assert (beyond.phone, beyond.word) == ("", "")


@pytest.mark.parametrize("name", ["toy_model", "coupled_model"])
def test_runs_are_the_trace_of_what_animate_makes(name, toy_sentence, request):
    model: Model = request.getfixturevalue(name)
    speech = Request(toy_sentence.audio, units=toy_sentence.units)
    trace = lipmotion.animate(speech, model=model).trace
    runs = state_runs(speech, model=model)
    assert all(a.end_s == pytest.approx(b.start_s) for a, b in pairwise(runs))
    assert all(a.state != b.state for a, b in pairwise(runs))
    states = [run.state for run in runs for _ in range(round(100 * (run.end_s - run.start_s)))]
    assert states == [trace.states[frame] for frame in trace.frames]
