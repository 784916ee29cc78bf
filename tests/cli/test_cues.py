"""Calls that programs make of Rhubarb Lip Sync, in their order and form, and what these programs read of the answer."""

import json
import re
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from children import LIPMOTION, child
from cli.conftest import Done, RunCommand, check_refused
from lipmotion import animate, cues, load_model, write_cues
from lipmotion.formats.cues import CUE_FORMATS


@pytest.fixture
def basics(toy_speech: Path, toy_model_file: Path) -> tuple[object, ...]:
    return ("cues", toy_speech, "--model", toy_model_file)


def events(done: Done) -> list[dict[str, object]]:
    return [json.loads(line) for line in done.err]


def test_without_a_file_it_is_printed(run, basics, here, toy_speech, toy_model_file):
    sheet = cues(animate(toy_speech, model=load_model(toy_model_file)))
    for form in ("tsv", "xml", "json", "dat"):
        done = run(*basics, *(() if form == "tsv" else ("-f", form)))
        assert done == (0, CUE_FORMATS[form].text(sheet, str(toy_speech)).splitlines(), [])
    assert list(here.iterdir()) == []


def test_it_is_the_functions_of_the_same_names(run, basics, here, toy_speech, toy_model_file):
    done = run(*basics, "-o", "a.tsv", "a.xml", "-o", "a.json", "a.dat", "--fps", "30", "--hold", "4", "--shapes", "GX")
    assert done == (0, ["a.tsv", "a.xml", "a.json", "a.dat"], [])
    sheet = cues(animate(toy_speech, model=load_model(toy_model_file)), fps=30, hold_frames=4, shapes="GX")
    write_cues(sheet, ["b.tsv", "b.xml", "b.json", "b.dat"], speech=toy_speech)
    for form in ("tsv", "xml", "json", "dat"):
        assert (here / f"a.{form}").read_bytes() == (here / f"b.{form}").read_bytes()


def test_a_format_whatever_the_suffix(run, basics, here):
    for words, begin in ((("-f", "dat"), "MohoSwitch1\n1 "), ((), "0.00\t")):  # of no known suffix, it is a table
        assert run(*basics, "-o", "mouth.txt", *words) == (0, ["mouth.txt"], [])
        assert (here / "mouth.txt").read_text().startswith(begin)


def test_words_beside_a_recording_are_kept(run, basics, here, toy_speech):
    (here / "take.wav").write_bytes(toy_speech.read_bytes())
    (here / "take.txt").write_text("see bob")
    line = ("cues", "take.wav", *basics[2:], "-o", "take.txt")
    check_refused(run(*line), 7, "is the transcript itself; give another name, or add --force")
    assert (here / "take.txt").read_text() == "see bob"
    assert run(*line, "--force") == run(*line) == (0, ["take.txt"], [])


def test_values_that_rhubarb_does_not_take_either(run, basics, here):
    for words, answer in ((["--consoleLevel", "loud"], "'loud'"), (["-d", "missing"], "no such file: 'missing'")):
        check_refused(run(*basics, *words), 2, answer)
    assert list(here.iterdir()) == []


@pytest.mark.usefixtures("here")
def test_status_lines(run, basics, toy_speech):
    done = run(*basics, "-f", "json", "--machine-readable")
    assert done.code == 0
    assert json.loads("\n".join(done.out))["mouthCues"]
    start, *progress, success = events(done)
    assert start == {
        "type": "start",
        "file": str(toy_speech),
        "log": {"level": "Info", "message": f"Application startup. Input file: {toy_speech}."},
    }
    assert success == {"type": "success", "log": {"level": "Info", "message": "Application terminating normally."}}
    values = [float(str(event["value"])) for event in progress]
    assert values == sorted(values)
    assert (values[0], values[-1]) == (0.0, 1.0)
    for event in progress:
        assert event["type"] == "progress"
        assert event["log"] == {"level": "Trace", "message": f"Progress: {event['value']:.0%}"}


@pytest.mark.long
def test_sound_from_a_pipe_is_not_named(here, toy_speech, toy_model_file):
    """Its file is temporary, and gone when the cues are opened."""
    command = [*LIPMOTION, "cues", "-", "--model", toy_model_file, "-o", "a.json", "a.xml"]
    with toy_speech.open("rb") as sound, child(command, stdin=sound) as process:
        assert process.wait() == 0
    assert json.loads((here / "a.json").read_text())["metadata"]["soundFile"] == ""
    assert "<soundFile></soundFile>" in (here / "a.xml").read_text()


def test_options_of_rhubarb(run, basics, here):
    (here / "dialog").write_text("see bob papa mama")
    ours = ("--transcript", "see bob papa mama", "--recogniser", "fast", "--shapes", "GX", "--fps", "30", "-f", "dat")
    theirs = ("-d", "dialog", "-r", "phonetic", "--extendedShapes", "GX", "--datFrameRate", "30", "--exportFormat=dat")
    without_effect = ("-q", "--datUsePrestonBlair")
    written = run(*basics, *ours)
    assert written.code == 0
    assert run(*basics, *theirs, *without_effect) == written


Rhubarb = Callable[..., Done]


@pytest.fixture
def rhubarb(run: RunCommand, here: Path, toy_speech: Path, toy_model_file: Path) -> Rhubarb:
    """Runs ``cues`` as Rhubarb; ``take.wav`` is in the folder, with a dialogue, and two without words."""
    (here / "take.wav").write_bytes(toy_speech.read_bytes())
    (here / "dialog.txt").write_text("see bob papa mama")
    (here / "empty.txt").write_text("")
    (here / "sounds.txt").write_text("\ufeff[music] ...\n", encoding="utf-8")
    return lambda *words: run("cues", "--model", toy_model_file, *words)


def shapes_of(document: str) -> list[str]:
    return [cue["value"] for cue in json.loads(document)["mouthCues"]]


@pytest.mark.parametrize("dialogue", ["dialog.txt", "empty.txt", "sounds.txt"])
def test_after_effects(rhubarb, here, dialogue):
    """It always names a dialogue, and reads the log file: what is in it is an error."""
    line: tuple[str, ...] = ("--dialogFile", dialogue, "--recognizer", "phonetic", "--extendedShapes", "GX")
    line += ("--exportFormat", "json", "--logFile", "log.txt", "--logLevel", "fatal", "--output", "output.json")
    assert rhubarb(*line, "take.wav").code == 0
    assert (here / "log.txt").read_text() == ""
    assert set(shapes_of((here / "output.json").read_text())) <= set("ABCDEFGX")
    assert rhubarb(*line, "missing.wav").code != 0
    found = re.search(r"\[Fatal\] ([\s\S]*)", (here / "log.txt").read_text())
    assert found is not None
    assert "missing.wav: no such file" in found[1]


def test_after_effects_asks_for_the_version(rhubarb):
    for option in ("--version", "-v"):
        done = rhubarb(option)
        (version,) = re.findall(r"Rhubarb Lip Sync version 1\.(\d+).\d+", "\n".join(done.out))
        assert (done.code, int(version) >= 9) == (0, True)


@pytest.mark.parametrize("shapes", ["", "GHX"])
def test_spine(rhubarb, shapes):
    """It reads standard error line by line until one is of success or failure, and cues from standard output."""
    line = ("--machineReadable", "--recognizer", "pocketSphinx", "--exportFormat", "json", "--extendedShapes", shapes)
    done = rhubarb(*line, "--dialogFile", "dialog.txt", "take.wav")
    messages = [json.loads(text) for text in done.err]
    assert {message["type"] for message in messages} <= {"start", "progress", "log", "success"}
    assert all(0 <= message["value"] <= 1 for message in messages if message["type"] == "progress")
    assert messages[-1]["type"] == "success"
    assert set(shapes_of("\n".join(done.out))) <= set("ABCDEF" + shapes)
    failure = [json.loads(text) for text in rhubarb(*line, "missing.wav").err][-1]
    assert (failure["type"], "missing.wav" in failure["reason"]) == ("failure", True)


def opentoonz(line: str) -> tuple[str, str]:
    """Return type and value of a message as OpenToonz finds them: by its spaces, commas and colons."""
    text = " ".join(line.split()).replace('"', "")
    kind, value, *_ = [*text[2:-2].split(", "), ""]
    return kind.split(": ")[1], value.split(": ")[1]


def test_opentoonz(rhubarb, here):
    line = ("-o", "temp.dat", "-f", "dat", "--datUsePrestonBlair", "-d", "dialog.txt", "--datFrameRate", "25")
    done = rhubarb(*line, "--machineReadable", "take.wav")
    messages = [opentoonz(text) for text in done.err]
    assert (messages[0][0], messages[-1][0]) == ("start", "success")
    assert [float(value) for kind, value in messages if kind == "progress"][-1] == 1
    rows = [text.split(" ") for text in (here / "temp.dat").read_text().splitlines()]
    assert all(int(frame) > 0 for frame, _ in rows[1:])
    assert {name for _, name in rows[1:]} <= {"MBP", "etc", "E", "AI", "O", "U", "FV", "L", "rest"}
    kind, reason = opentoonz(rhubarb(*line, "--machineReadable", "missing.wav").err[-1])
    assert (kind, "missing.wav" in reason) == ("failure", True)


@pytest.mark.parametrize(
    "line",
    [
        "-o|out.json|take.wav|-f|json",
        "take.wav|-o|out.json|-f|json",
        "-f|json|-o|out.json|take.wav|-r|phonetic",
        "-o out.json|take.wav|-f json|--extendedShapes GHX|-q",  # option and value as one word
        "-f|JSON|--recognizer|PHONETIC|--extendedShapes|xhg|--threads|4|-o|out.json|take.wav",
        "take.wav|-d|empty.txt|-o|out.json|-f|json|-q",
        "-o|out.json|-f|json|--machineReadable|--consoleLevel|info|--logFile|a.log|--logLevel|debug|--threads|2|take.wav",
    ],
)
def test_cues_in_a_file(rhubarb, here, line):
    assert rhubarb(*line.split("|")).code == 0
    assert shapes_of((here / "out.json").read_text())


def test_letters_of_shapes_for_moho(rhubarb, here):
    assert rhubarb("-o", "out.dat", "take.wav", "-f", "dat", "--datFrameRate", "15").code == 0
    assert {text.split()[1] for text in (here / "out.dat").read_text().splitlines()[1:]} <= set("ABCDEFGHX")


def test_the_log_file(rhubarb, here):
    line = ("take.wav", "--transcript", "see bimab papa mama", "--logFile", "a.log")
    quiet = rhubarb(*line, "--machineReadable", "--consoleLevel", "error")
    assert "log" not in {json.loads(text)["type"] for text in quiet.err}
    started, warned, ended = (here / "a.log").read_text().splitlines()
    assert all(re.match(r"\[\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\] \d+ \[", text) for text in (started, warned, ended))
    assert "[Info] Application startup. Input file: take.wav." in started
    assert "[Warning] 'bimab'" in warned
    assert "[Info] Application terminating normally." in ended
    told = rhubarb(*line, "--machineReadable", "--logLevel", "warning")
    assert "log" in {json.loads(text)["type"] for text in told.err}
    assert len((here / "a.log").read_text().splitlines()) == 1
    before = (here / "take.wav").read_bytes()
    assert rhubarb("take.wav", "--logFile", "take.wav").code == 7
    assert (here / "take.wav").read_bytes() == before


def test_a_wrong_line_is_a_message_too(rhubarb):
    (failure,) = map(json.loads, rhubarb("take.wav", "--machineReadable", "--bogus").err)
    assert (failure["type"], "--bogus" in failure["reason"]) == ("failure", True)


def test_under_its_name(run_outside):
    """As a link of that name, for programs that look for the program itself."""
    named = "import sys; sys.argv[0] = '/usr/bin/rhubarb'; from lipmotion.cli.main import main; sys.exit(main())"
    done = run_outside("--machineReadable", "missing.wav", program=(sys.executable, "-c", named))
    assert done.code == 3
    assert json.loads(done.err[-1])["type"] == "failure"


@pytest.mark.parametrize("verb", ["animate", "words", "cues"])
def test_the_recording_behind_the_outputs(run, here, verb):
    """The message is of the recording, not that there is none."""
    for words in (["-o", "out.json", "missing.wav"], ["-o", "out.json", "a.json", "missing.wav"]):
        done = run(verb, *words)
        assert done.code == 3
        assert "missing.wav: no such file" in done.err[-1]
    assert list(here.iterdir()) == []
