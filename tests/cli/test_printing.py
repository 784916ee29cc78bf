"""Contents and names of files, and arguments, reach a terminal as printable text only."""

import json
import logging
import os
import re
import shlex
import shutil
import sys
import warnings
import zipfile
from argparse import Namespace
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from children import LIPMOTION, environment, run_child
from cli.conftest import Done, is_one_error
from lipmotion import Corpus
from lipmotion.cli import main
from lipmotion.cli.terminal.events import Events, JsonLines, Stopper
from lipmotion.cli.terminal.printing import print_json, print_line, print_lines
from lipmotion.cli.terminal.progress import describe_outcome, report_progress
from lipmotion.errors import InputError
from lipmotion.pipeline.generate.explain import write_explanation
from lipmotion.types import ChannelValue, Explanation, Item, Progress, Span, Unit
from lipmotion_lab.evaluation.table import format_figures
from robustness.case import changed_model

EVIL = "q\x1b]52;c;aGk=\x07\x9b31m\r\nlipmotion: error: forged\n\x85\u202e\u2028\x7f"
SHOWN = r"q\x1b]52;c;aGk=\x07\x9b31m\r\nlipmotion: error: forged\n\x85\u202e\u2028\x7f"
OBEYED = re.compile(
    "[\x00-\x09\x0b-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069\ud800-\udfff]|^lipmotion: error: forged", re.M
)


@pytest.fixture
def poisoned(here: Path, toy_corpus: Corpus, toy_model_file: Path, toy_speech: Path) -> Path:
    """Inputs of every kind, with control characters in contents and names, in the current folder."""
    shutil.copy(toy_speech, here / f"{EVIL}.wav")
    shutil.copy(toy_speech, here / "a.wav")
    shutil.copy(toy_model_file, here / EVIL)
    told = {"name": EVIL, "corpus": [EVIL], "licence": EVIL, "adapted": {EVIL: EVIL}, EVIL: 1}
    changed_model(toy_model_file, here / "m.lipmotion", {}, **told)
    with zipfile.ZipFile(here / "other.lipmotion", "w") as new:
        new.writestr("header.json", json.dumps({"format": "lipmotion.model", "version": EVIL}))
    shutil.copytree(toy_corpus.path, here / "c")
    for path in (here / "c").rglob("*.json"):
        path.write_text(json.dumps(_changed(json.loads(path.read_text()))))
    damaged = here / "damaged"
    damaged.mkdir()
    (damaged / "corpus.json").write_text(json.dumps({"format": EVIL, "version": 2, "utterances": {}}))
    (here / "words.txt").write_text(f"papa {EVIL}")
    (here / "lexicon.txt").write_text(f"papa P {EVIL.replace(chr(10), '')}\n")
    (here / "r").mkdir()
    (here / "r" / f"{EVIL}.mp4").write_text("no video")
    return here


def _changed(document: dict[str, Any]) -> dict[str, Any]:
    """Return a manifest, or the description of an utterance, with control characters in its values."""
    for entry in document.get("utterances", {}).values():
        entry["speaker"] = EVIL
    if "channels" in document:
        document["speaker"] = EVIL
        document["channels"][-1]["name"] = EVIL
        document["source"] |= {"collection": EVIL, "attribution": EVIL}
    return document


@contextmanager
def logged() -> Iterator[None]:
    """Write warnings to standard error, from where pytest would take them."""
    root = logging.getLogger()
    handlers, root.handlers = root.handlers, []
    yield
    root.handlers = handlers


LINES = Path(__file__).with_name("printed_lines.txt").read_text(encoding="ascii").splitlines()
NOT_SHOWN = {
    "corpus sync c",
    "cues EVIL.wav --model m.lipmotion --recogniser own -f xml",
    "animate a.wav --model m.lipmotion -o a.json --transcript words.txt",
}
"""Commands that print the name in another form, or not at all."""


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="names that Windows does not allow")
@pytest.mark.usefixtures("poisoned")
def test_what_is_obeyed_is_shown(capsys):
    for line in LINES:
        with logged():
            main.main([word.replace("EVIL", EVIL) for word in line.split()])
        out, err = capsys.readouterr()
        assert OBEYED.search(out + err) is None, (line, out, err)
        shown = (out + err).replace("\\u001b", "\\x1b").replace("\\\\", "\\")
        assert SHOWN[:8] in shown or line in NOT_SHOWN, line


def test_warnings(run, make_info):
    def warn(_: Namespace) -> None:
        logging.getLogger("lipmotion").warning("%s is odd", EVIL)
        logging.getLogger("another.package").error(EVIL)
        with warnings.catch_warnings():
            warnings.simplefilter("always")
            warnings.warn(EVIL, stacklevel=1)

    make_info(warn)
    head = "lipmotion: warning: "
    with logged():
        done = run("info")
    assert done == (0, [], [f"{head}{SHOWN} is odd", head + SHOWN, head + SHOWN])


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Callable[[bool], None]:
    """Makes standard error a terminal, or none."""
    return lambda watched: monkeypatch.setattr(sys.stderr, "isatty", lambda: watched, raising=False)


@pytest.mark.parametrize("watched", [False, True])
def test_progress(capsys, terminal, watched):
    terminal(watched)
    with report_progress(Namespace(machine_readable=False, stopper=Stopper(), events=Events())) as report:
        report.receive(Progress(EVIL, 0, 2, 0.0))
        report.receive(Item(EVIL, "skipped", EVIL))
        report.warn(EVIL)
        report.receive(Progress(EVIL, 1, 2, 0.5))
        report.finish(f"two\nlines{EVIL[:9]}")
    out, err = capsys.readouterr()
    assert out == "two\nlines" + SHOWN[:12] + "\n"
    assert err.count(SHOWN) >= (5 if watched else 3)
    assert ("50%" in err) == ("(1/2)" in err) == watched  # a bar
    assert not any(part in err for part in ("\x1b]", "\x07", "\x9b", "\u202e", "\nlipmotion: error: forged"))


def test_tables_have_a_line_a_row():
    """A value with an end of line in it does not begin a row of its own."""
    row = dict.fromkeys(("acc", "acc_per_clip", "nrmse", "global_variance", "jerk"), 0.5)
    condition = {"channels": {EVIL: row}, "acc": 0.5, "amse": 0.5, "leading": EVIL, "lag_ms": 1.0}
    figures = {
        "closed_under": None, "still_channels": [EVIL], "split": EVIL, "clips": 1, "conditions": {EVIL: condition},
    }  # fmt: skip
    assert format_figures(figures).count(SHOWN) == 5
    assert OBEYED.search(format_figures(figures)) is None
    span = Span(0.0, 1.0, Unit(EVIL, EVIL, EVIL))
    explained = Explanation(0.0, 0, span, EVIL, {EVIL: ChannelValue(0.0, 1.0)})
    assert OBEYED.search(write_explanation(explained)) is None


def test_what_is_laid_out_stays_so(capsys):
    print_lines("one\ttwo\n\n  three é 語 👩‍👧\n")
    print_line("tab\tand\nend")
    print_json({"name": EVIL, "n": np.float64(1.5).item()})
    out, _ = capsys.readouterr()
    *lines, document = out.splitlines()
    assert lines == ["one\ttwo", "", "  three é 語 👩‍👧", "", "tab\\tand\\nend"]
    assert json.loads(document) == {"name": EVIL, "n": 1.5}
    assert document.isascii()
    assert document.isprintable()


def test_a_message_that_repeats_a_file_is_cut_in_its_middle():
    for kind in (InputError, OSError):
        code, message = describe_outcome(kind(f"a.csv: found {'x' * 100_000}; give numbers")) or (0, "")
        assert (code, len(message) < 1100) == (InputError.exit_code, True)
        assert re.fullmatch(r"a\.csv: found x+ \.\.\. x+; give numbers", message)
    for error, words in (
        (InputError("word " * 199), "word " * 199),
        (FileNotFoundError(2, os.strerror(2)), "the current folder has been deleted"),
        (FileNotFoundError(2, os.strerror(2), "a.wav"), "a.wav"),
    ):
        assert words in str(describe_outcome(error))


EVENTS = (
    Progress("first", 0, 2, 0.0), Item("a", "prepared"), Progress("first", 1, 2, 0.25, -61.5),
    Item("b", "skipped", "no face\nanywhere"), Progress("second", 2, 2, 1.0),
)  # fmt: skip


def objects(done: Done) -> list[dict[str, object]]:
    return [json.loads(line) for line in done.out]


def test_every_event_is_one_json_object_on_a_line(capsys):
    with report_progress(Namespace(machine_readable=True, stopper=Stopper(), events=JsonLines())) as report:
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


def test_a_person_is_told_what_to_expect_of_the_motion_and_a_program_is_not(run, basics, here, terminal):
    for watched, words in ((False, ()), (True, ()), (True, ("--machine-readable",))):
        terminal(watched)
        done = run(*basics, "-o", here / "a.json", "--force", *words)
        assert any(line.endswith("dB apart") or "dB apart; " in line for line in done.err) == (watched and not words)


def test_an_error_on_the_command_line_is_a_failure_too(run):
    done = run("cues", *["a.wav"] * 10_000)
    assert is_one_error(done, 2)
    assert len(done.err[0]) < 1100
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
def test_what_is_swallowed_stops_at_the_next_event(make_info, run):
    """As when the signal comes during an import that treats any exception as a missing package."""

    def swallows(given: Namespace) -> None:
        given.machine_readable = False
        with report_progress(given) as report:
            try:
                import signal

                signal.raise_signal(signal.SIGTERM)
            except BaseException:  # noqa: S110
                pass
            report.receive(EVENTS[0])
            raise AssertionError

    make_info(swallows)
    assert run("info") == (143, [], ["lipmotion: stopped; run the same command again to go on"])
