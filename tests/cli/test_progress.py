import json
import logging
import os
import shlex
import sys
from argparse import Namespace
from contextlib import suppress
from functools import partial
from pathlib import Path

import pytest

from children import LIPMOTION, environment, run_child
from cli.conftest import Done
from lipmotion.cli.main import main
from lipmotion.cli.terminal.events import Events, JsonLines, Stopper
from lipmotion.cli.terminal.progress import report_progress
from lipmotion.errors import CorpusError
from lipmotion.types import Item, Progress
from lipmotion_lab.verbs import measure

EVENTS = (
    Progress("first", 0, 2, 0.0), Item("a", "prepared"), Progress("first", 1, 2, 0.25, -61.5),
    Item("b", "skipped", "no face\nanywhere"), Progress("second", 2, 2, 1.0),
)  # fmt: skip


def objects(done: Done) -> list[dict[str, object]]:
    return [json.loads(line) for line in done.out]


def options(machine_readable: bool) -> Namespace:
    return Namespace(
        machine_readable=machine_readable, stopper=Stopper(), events=JsonLines() if machine_readable else Events()
    )


def test_every_event_is_one_json_object_on_a_line(capsys):
    with report_progress(options(machine_readable=True)) as report:
        for event in EVENTS:
            report.receive(event)
        logging.getLogger("lipmotion").warning("strange %s", "word")
        report.finish("done", used=3, kind="video")
    out, err = capsys.readouterr()
    assert err == ""
    assert [json.loads(line) for line in out.splitlines()] == [
        {"type": "progress", "stage": "first", "step": 0, "steps": 2, "value": 0.0},
        {"type": "item", "name": "a", "outcome": "prepared", "reason": ""},
        {"type": "progress", "stage": "first", "step": 1, "steps": 2, "value": 0.25},
        {"type": "item", "name": "b", "outcome": "skipped", "reason": "no face\nanywhere"},
        {"type": "progress", "stage": "second", "step": 2, "steps": 2, "value": 1.0},
        {"type": "warning", "message": "strange word"},
        {"type": "success", "used": 3, "kind": "video"},
    ]


def test_where_nobody_watches_only_warnings_and_the_result_are_said(capsys):
    with report_progress(options(machine_readable=False)) as report:
        for event in EVENTS:
            report.receive(event)
        report.finish("done", used=3, kind="video")
    assert capsys.readouterr() == ("done\n", "lipmotion: warning: skipped b: no face\\nanywhere\n")


def test_a_terminal_gets_a_bar(capsys, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    with report_progress(options(machine_readable=False)) as report:
        for event in EVENTS:
            report.receive(event)
        report.finish("done")
    out, err = capsys.readouterr()
    assert out == "done\n"
    assert "first (1/2)" in err
    assert "25%" in err
    assert "second (2/2)" in err
    assert "100%" in err
    assert "lipmotion: warning: skipped b: no face\\nanywhere\n" in err


@pytest.mark.long
def test_training_for_a_program(run, toy_corpus, here):
    done = run("train", toy_corpus.path, "-o", "m.lipmotion", "--from", "none", "--machine-readable")
    assert (done.code, done.err) == (0, [])
    first, *between, last = objects(done)
    assert first == {"type": "start"}
    assert last == {"type": "success", "model": "m.lipmotion", "used": 8, "minutes": 0.3, "skipped": 0}
    values = [event["value"] for event in between if event["type"] == "progress"]
    assert values == sorted(values)  # type: ignore[type-var]
    assert (values[0], values[-1]) == (0, 1)
    assert [path.name for path in here.iterdir()] == ["m.lipmotion"]


def test_why_it_failed(capsys, monkeypatch):
    def fail(error: BaseException, _: Namespace) -> None:
        raise error

    errors: list[tuple[BaseException, int, str]] = [
        (CorpusError("two\nlines"), 4, "two\\nlines"),
        (KeyboardInterrupt(), 130, "stopped; run the same command again to go on"),
        (ZeroDivisionError("what"), 1, "ZeroDivisionError: what"),
    ]
    for error, code, reason in errors:
        monkeypatch.setattr(measure, "run_evaluate", partial(fail, error))
        with suppress(ZeroDivisionError):  # a bug is not hidden
            assert main(["evaluate", "m", "c", "--machine-readable"]) == code
        said = capsys.readouterr()
        start, last = map(json.loads, said.out.splitlines())
        assert (start, last) == ({"type": "start"}, {"type": "failure", "reason": reason, "exit_code": code})
        assert said.err.endswith(f"{reason}\n") or code == 1


def test_an_error_on_the_command_line_is_a_failure_too(run):
    done = run("evaluate", "--machine-readable")
    assert done.code == 2
    (failure,) = objects(done)
    assert (failure["type"], failure["exit_code"]) == ("failure", 2)
    assert "required: model, corpus; see: lipmotion evaluate --help" in str(failure["reason"])
    assert done.err == [f"lipmotion: error: {failure['reason']}"]


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full here")  # noqa: PTH110
@pytest.mark.parametrize(
    "arguments",
    [["info"], ["--help"], ["cues", "--help"], ["--version"], ["train", "CORPUS", "-o", "m", "--machine-readable"]],
)
def test_output_that_is_full(toy_corpus, here, arguments):
    command = [str(toy_corpus.path) if argument == "CORPUS" else argument for argument in arguments]
    with Path("/dev/full").open("w") as full:
        unbuffered = "1" if command[0] == "train" else ""
        done = run_child([*LIPMOTION, *command], stdout=full, variables=environment(PYTHONUNBUFFERED=unbuffered))
    assert done.returncode == 7
    assert done.stderr == "lipmotion: error: standard output cannot be written: No space left on device\n"
    assert list(here.iterdir()) == []


CLOSED = "standard {} is closed"


@pytest.mark.skipif(sys.platform == "win32", reason="streams are closed as POSIX shells do")
@pytest.mark.long
def test_streams_that_are_closed(toy_speech, toy_model_file, here):
    """No file that is opened takes the number of a standard stream."""
    own = shlex.join([str(toy_speech), "--model", str(toy_model_file), "--recogniser", "own"])
    for line, code, said in (
        ("info >&-", 7, CLOSED.format("output")),
        ("--help >&-", 7, CLOSED.format("output")),
        (f"evaluate m {here} --machine-readable >&-", 7, CLOSED.format("output")),
        (f"animate - --model {toy_model_file} -o a.json <&-", 3, CLOSED.format("input")),
        (f"cues {own} --machine-readable 2>&-", 7, ""),
        ("info nothing 2>&-", 3, ""),
        ("info nothing 2>/dev/full", 3, ""),
        (f"animate {own} -o a.json <&- 2>&-", 0, ""),
    ):
        done = run_child(["sh", "-c", f"{shlex.join(LIPMOTION)} {line}"])
        assert (done.returncode, done.stderr.count("\n")) == (code, 1 if said else 0), (line, done)
        assert said in done.stderr
        assert done.stdout == ("a.json\n" if code == 0 else "")
    assert json.loads((here / "a.json").read_text())


@pytest.mark.usefixtures("ordinary_signals")
def test_what_is_swallowed_stops_at_the_next_event(monkeypatch, run):
    """As when the signal comes during an import that treats any exception as a missing package."""

    def swallows(given: Namespace) -> None:
        with report_progress(given) as report:
            try:
                import signal

                signal.raise_signal(signal.SIGTERM)
            except BaseException:  # noqa: S110
                pass
            report.receive(EVENTS[0])
            raise AssertionError

    monkeypatch.setattr(measure, "run_evaluate", swallows)
    assert run("evaluate", "m", "c") == (143, [], ["lipmotion: stopped; run the same command again to go on"])
