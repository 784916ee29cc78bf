import json
import logging
from pathlib import Path

import pytest

from cli.conftest import Done, check_refused
from lipmotion import animate, cues, load_model, write_cues
from lipmotion.cli.command_line import parser
from lipmotion.cli.main import main
from lipmotion.pipeline.outputs.cues import cue_text


@pytest.fixture
def basics(toy_speech: Path, toy_model_file: Path) -> tuple[object, ...]:
    return ("cues", toy_speech, "--model", toy_model_file)


def events(done: Done) -> list[dict[str, object]]:
    return [json.loads(line) for line in done.err]


def test_without_a_file_it_is_printed(run, basics, here, toy_speech, toy_model_file):
    sheet = cues(animate(toy_speech, model=load_model(toy_model_file)))
    for form in ("tsv", "xml", "json", "dat"):
        done = run(*basics, *(() if form == "tsv" else ("-f", form)))
        assert done == (0, cue_text(sheet, speech=toy_speech, form=form).splitlines(), [])
    assert list(here.iterdir()) == []


def test_it_is_the_functions_of_the_same_names(run, basics, here, toy_speech, toy_model_file):
    done = run(*basics, "-o", "a.tsv", "a.xml", "-o", "a.json", "a.dat", "--fps", "30", "--hold", "4", "--shapes", "GX")
    assert done == (0, ["a.tsv", "a.xml", "a.json", "a.dat"], [])
    sheet = cues(animate(toy_speech, model=load_model(toy_model_file)), fps=30, hold_frames=4, shapes="GX")
    write_cues(sheet, ["b.tsv", "b.xml", "b.json", "b.dat"], speech=toy_speech)
    for form in ("tsv", "xml", "json", "dat"):
        assert (here / f"a.{form}").read_bytes() == (here / f"b.{form}").read_bytes()


def test_a_format_whatever_the_suffix(run, basics, here):
    assert run(*basics, "-o", "mouth.txt", "-f", "dat") == (0, ["mouth.txt"], [])
    assert (here / "mouth.txt").read_text().startswith("MohoSwitch1\n1 ")


def test_a_folder(run, basics, here, toy_speech):
    (here / "made").mkdir()
    new, made = f"new/deep/{toy_speech.stem}.dat", f"made/{toy_speech.stem}.dat"
    assert run(*basics, "-o", "new/deep/", "made", "a.json", "--format", "dat") == (0, [new, made, "a.json"], [])
    assert (here / new).read_bytes() == (here / made).read_bytes()
    assert run(*basics, "-o", "new/").out == [f"new/{toy_speech.stem}.tsv"]


def test_folders_that_cannot_be(run, basics, here, toy_speech):
    words = here / f"{toy_speech.stem}.tsv"
    words.write_text("see bob papa mama")
    for done, code, message in (
        (run("cues", "-", "-o", "out/"), 3, "comes through a pipe has no name"),
        (run(*basics, "-o", "out/", "--hold", "0"), 3, "hold is 0 frames"),
        (run(*basics, "-o", f"{here}/", "--transcript", words), 7, "is the transcript"),
    ):
        check_refused(done, code, message)
    assert list(here.iterdir()) == [words]
    assert words.read_text() == "see bob papa mama"


def test_values_that_rhubarb_does_not_take_either(run, basics, here):
    for words, answer in (
        (["--threads", "0"], "'0', required: 1 or more"),
        (["--consoleLevel", "loud"], "'loud'"),
        (["-d", "missing"], "no such file: 'missing'"),
    ):
        check_refused(run(*basics, *words), 2, answer)
    assert list(here.iterdir()) == []


@pytest.mark.long
def test_transcript_and_edited_phones(run, basics, here):
    said = run(*basics, "--transcript", "see bob papa mama")
    run("animate", *basics[1:], "--transcript", "see bob papa mama", "-o", "a.json")
    assert run(*basics, "--units", "a.json").out == said.out
    document = json.loads((here / "a.json").read_text())
    document["units"] = [unit | {"phone": "sil"} for unit in document["units"]]
    (here / "b.json").write_text(json.dumps(document))
    assert [line.split("\t")[1] for line in run(*basics, "--units", "b.json").out] == ["X", "X"]


def test_speech_that_cannot_be_used(run, toy_model_file, bad_speech):
    for path in bad_speech.values():
        done = run("cues", path, "--model", toy_model_file, "--machineReadable")
        assert (done.code, done.out) == (3, [])
        start, *_, failure = events(done)
        assert (start["type"], start["file"]) == ("start", str(path))
        assert failure["type"] == "failure"
        message = f"Application terminating with error: {failure['reason']}"
        assert failure["log"] == {"level": "Fatal", "message": message}


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


@pytest.mark.usefixtures("here")
def test_warnings_are_status_lines_too(run, basics):
    handlers = list(logging.getLogger().handlers)
    done = run(*basics, "--machine-readable", "--transcript", "see bimab papa mama")
    (said,) = [event["log"] for event in events(done) if event["type"] == "log"]
    assert isinstance(said, dict)
    assert said["level"] == "Warning"
    assert "'bimab' is not in the dictionary" in said["message"]
    assert logging.getLogger().handlers == handlers


@pytest.mark.usefixtures("_piped_speech")
def test_sound_from_a_pipe_is_not_named(here, toy_model_file):
    """Its file is temporary, and gone when the cues are opened."""
    assert main(["cues", "-", "--model", str(toy_model_file), "-o", "a.json", "a.xml"]) == 0
    assert json.loads((here / "a.json").read_text())["metadata"]["soundFile"] == ""
    assert "<soundFile></soundFile>" in (here / "a.xml").read_text()


def test_recognisers_of_rhubarb():
    understood = parser()
    for name, ours in (("pocketSphinx", "auto"), ("phonetic", "fast"), ("general", "general")):
        assert understood.parse_args(["cues", "a.wav", "--recognizer", name]).recogniser == ours
    assert understood.parse_args(["cues", "a.wav"]).recogniser == "auto"


def test_options_of_rhubarb(run, basics, here):
    (here / "dialog").write_text("see bob papa mama")
    ours = ("--transcript", "see bob papa mama", "--recogniser", "fast", "--shapes", "GX", "--fps", "30", "-f", "dat")
    theirs = ("-d", "dialog", "-r", "phonetic", "--extendedShapes", "GX", "--datFrameRate", "30", "--exportFormat=dat")
    without_effect = ("-q", "--datUsePrestonBlair")
    written = run(*basics, *ours)
    assert written.code == 0
    assert run(*basics, *theirs, *without_effect) == written
