import argparse
import ast
import json
import os
import re
import shutil
import sys
import threading
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from children import LIPMOTION, child
from cli.conftest import check_refused, is_one_error
from lipmotion import Job, Outputs, Request, read_motion
from lipmotion.cli import command_line
from lipmotion.cli.arguments.declared import pick_part
from lipmotion.pipeline.job import DETAILS
from lipmotion.storage.sources import read_shipped_table
from lipmotion.types import Delivery, Staging
from meshes.heads import head, write_glb

LINE = """animate a.wav --transcript t.txt --model m.lipmotion --pauses natural -o a.json b.mp4 -o c.vtt --channels
opening,width --fps 30 --face man --jaw none --control-points --to csv,mp4 --still blinks,head --face-seed 3 --stepped
--offset-ms -4e1 --background #102030"""
SAME = Job(
    Request(Path("a.wav"), "t.txt", pauses="natural", model=Path("m.lipmotion")),
    Outputs(
        ("a.json", "b.mp4", "c.vtt"),
        channels=("opening", "width"),
        fps=30.0,
        face="man",
        background="#102030",
        jaw="none",
        control_points=True,
        kinds=("csv", "mp4"),
    ),
    Delivery(offset_ms=-40.0, stepped=True),
    Staging(blinks=False, head=False, seed=3),
)
FILE = Path(__file__).with_name("scene.toml").read_text(encoding="ascii")
OTHERS = {
    *("corpus motion --channels", "hofer2008 --channels", "cues --fps", "corpus prepare --offset-ms", "train --units"),
    *("evaluate --speaker", "train --speaker", "face build --speaker"),
    *("studio --model", "studio --character", "studio --face"),
    *("live --model", "live --pauses", "live --rate", "live --to", "live --character"),
}
"""Options of other verbs that have such a name, and another meaning or another default."""
needs_toml = pytest.mark.skipif(sys.version_info < (3, 11), reason="Python 3.10 reads no TOML")


def parsed(*words: str) -> Job:
    options = command_line.parse_words(words, argparse.Namespace())
    speech = options.speech[0] if isinstance(options.speech, list) else options.speech
    request = pick_part(options, options.start.request, recording=speech)
    return pick_part(options, options.start, request=request)


def test_the_command_line_makes_the_same_job():
    assert parsed(*LINE.split()) == SAME
    assert parsed("animate", "a.wav", "-o", "a.json") == Job(Request(Path("a.wav")), Outputs(("a.json",)))


@needs_toml
def test_a_file_is_behind_the_command_line(here):
    (here / "scene.toml").write_text(FILE)
    assert parsed("animate", "--job", "scene.toml") == Job.from_file("scene.toml") == SAME
    line = "animate b.wav --job scene.toml --face portrait -o d.json --face-seed 0 --still gaze -o e.json --offset-ms 0"
    job = parsed(*line.split())
    assert (job.request.recording, job.request.transcript) == (Path("b.wav"), "t.txt")
    assert (job.outputs.files, job.outputs.face, job.outputs.fps) == (("d.json", "e.json"), "portrait", 30)
    assert job.staging == Staging(gaze=False)
    assert job.delivery == Delivery(stepped=True)


def test_a_level_of_detail_is_behind_the_command_line():
    job = parsed("animate", "a.wav", "-o", "a.json", "--detail", "mobile")
    mobile = DETAILS["mobile"]
    assert (job.outputs.rate_hz, job.delivery, job.staging) == (30, mobile.delivery, mobile.staging)
    job = parsed("animate", "a.wav", "--rate", "60", "--detail", "game", "-o", "a.json", "--still", " head")
    assert (job.outputs.rate_hz, job.delivery, job.staging.head) == (60, DETAILS["game"].delivery, False)
    assert parsed("animate", "a.wav", "-o", "a.json", "--detail", "film") == parsed("animate", "a.wav", "-o", "a.json")


def test_each_option_is_declared_once():
    """No flag stands twice in the parts of a job, and none of them in a module or a table of the command line."""
    parts = (Request, Outputs, Delivery, Staging)
    told = [each for part in parts for each in fields(part) if "help" in each.metadata and "still" not in each.metadata]
    flags = [flag for each in told for flag in each.metadata.get("flags", ("--" + each.name.replace("_", "-"),))]
    assert len(set(flags)) == len(flags) > 30
    known, found = {*flags} - {"-o", "--output", "speech"}, set()
    source = Path(command_line.__file__).parents[2]
    for path in [*(source / "lipmotion" / "cli").rglob("*.py"), *source.glob("lipmotion_*/verbs/*.py")]:
        calls = [node for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, ast.Call)]
        words = {str(word.value) for node in calls for word in node.args if isinstance(word, ast.Constant)}
        found |= {f"{path.stem} {flag}" for flag in words & known}
    for package in ("lipmotion.cli.verbs", "lipmotion_faces.verbs", "lipmotion_lab.verbs", "lipmotion_studio.verbs"):
        rows = read_shipped_table(package, "arguments.csv")
        found |= {f"{row['verb']} {flag}" for row in rows for flag in {*row["name"].split()} & known}
    assert found == OTHERS


@pytest.mark.usefixtures("here")
def test_only_files_that_are_read_are_declared_as_inputs():
    options = command_line.parse_words(LINE.split(), argparse.Namespace())
    read = {one.name for one in options.reads}
    assert {"speech", "transcript", "lexicon", "units", "model", "onto", "face", "background", "job"} <= read
    assert {one.name for one in options.writes} == {"output"}


@needs_toml
def test_a_job_is_done(run, here, toy_speech, toy_model_file):
    (here / "scene.toml").write_text(
        f"[request]\nrecording = {str(toy_speech)!r}\nmodel = {str(toy_model_file)!r}\nrecogniser = 'own'\n"
        "[outputs]\nfiles = ['a.json']\nrate_hz = 25\n"
    )
    assert run("animate", "--job", "scene.toml") == (0, ["a.json"], [])
    basics = (toy_speech, "--model", toy_model_file, "--recogniser", "own", "--rate", "25")
    assert run("animate", *basics, "-o", "b.json").code == 0
    assert (here / "a.json").read_bytes() == (here / "b.json").read_bytes()
    assert run("animate", "--job", "scene.toml", "-o", "-", "--format", "csv").code == 0
    before = (here / "scene.toml").read_bytes()
    assert is_one_error(run("animate", "--job", "scene.toml", "-o", "scene.toml"), 7)
    assert (here / "scene.toml").read_bytes() == before


@needs_toml
def test_a_batch_takes_a_job(run, here, toy_speech, toy_model_file):
    (here / "sounds").mkdir()
    (here / "sounds" / "a.wav").write_bytes(toy_speech.read_bytes())
    (here / "scene.toml").write_text(
        f"[request]\nmodel = {str(toy_model_file)!r}\nrecogniser = 'own'\n"
        "[outputs]\nkinds = ['csv']\nrate_hz = 25\nchannels = ['opening']\n"
    )
    line = ("batch", "sounds", "-o", "out", "--job", "scene.toml", "--jobs", "1", "--channels", "width")
    assert run(*line).code == 0
    rows = (here / "out" / "a.csv").read_text().splitlines()
    assert (rows[0], re.split(",", rows[2])[0]) == ("time_s,width", "0.04")
    (here / "scene.toml").write_text("[request]\nrecording = 'a.wav'\n")
    check_refused(run(*line), 3, "the job of a batch has 'recording'")


@needs_toml
def test_what_is_wrong_with_a_file(run, here):
    (here / "half.toml").write_text("[request]\nrecording = 'a.wav'\n")
    (here / "wrong.toml").write_text("[staging]\nface-seed = 3\n")
    for file, code, message in (
        ("half.toml", 2, "the following arguments are required: -o/--output; see"),
        ("wrong.toml", 3, "wrong.toml: in [staging]: no option 'face-seed'; here it is called 'seed'"),
        ("missing.toml", 3, "missing.toml: no such job file"),
    ):
        check_refused(run("animate", "--job", file), code, message)


@pytest.fixture
def speech(toy_speech: Path, tmp_path: Path) -> Path:
    shutil.copy(toy_speech, tmp_path / "speech.wav")
    return tmp_path / "speech.wav"


@pytest.mark.long
def test_what_is_edited_is_replayed_by_all_verbs(run, speech, toy_model_file, tmp_path):
    """The same bytes, from the recording and from the file alone."""
    file = tmp_path / "a.edits.json"
    of = ("--of", speech, "--model", toy_model_file, "--recogniser", "own")
    done = run("edit", file, *of, "phone 3 is p", "--list")
    assert done.code == 0
    assert any(line.startswith("   3 ") and line.split()[3:4] == ["p"] for line in done.out)
    assert run("edit", file, "--machine-readable").code == 0
    assert run("edit", file, "pin jawOpen 0.7 at 1.2", "set intensity 1.2", "remove phone 99").code == 3
    assert json.loads(file.read_text())["steps"] == ["phone 3 is p"]  # none of them, for one is not possible
    assert run("edit", file, "pin jawOpen 0.7 at 1.2", "set intensity 1.2").code == 0
    assert run("edit", "--undo", 1, file, "pin opening 0.1 at 1").code == 0
    assert json.loads(file.read_text())["steps"] == ["phone 3 is p", "pin jawOpen 0.7 at 1.2", "pin opening 0.1 at 1.0"]
    assert run("edit", file, "set intensity 1.2").code == 0
    kinds = ("json", "livelink.csv", "TextGrid")
    outputs = [["-o", *(tmp_path / f"{name}.{kind}" for kind in kinds)] for name in ("one", "two")]
    how = ("--model", toy_model_file, "--recogniser", "own")
    assert run("animate", speech, *how, "--edits", file, *outputs[0]).code == 0
    assert run("render", file, *outputs[1]).code == 0
    for kind in kinds:
        assert (tmp_path / f"one.{kind}").read_bytes() == (tmp_path / f"two.{kind}").read_bytes(), kind
    assert run("animate", speech, *how, "-o", tmp_path / "plain.json").code == 0
    assert (tmp_path / "plain.json").read_bytes() != (tmp_path / "one.json").read_bytes()
    assert run("cues", speech, *how, "--edits", file, "-o", tmp_path / "a.tsv").code == 0


def test_what_edit_refuses(run, speech, toy_model_file, tmp_path):
    file, of = tmp_path / "a.edits.json", ("--of", speech, "--model", toy_model_file, "--recogniser", "own")
    for words, message in (
        (["edit", file, "phone 3 is p"], "no such file; begin one: lipmotion edit"),
        (["render", file, "-o", tmp_path / "a.csv"], "a.edits.json: cannot be read"),
        (["animate", speech, "--edits", file, "-o", tmp_path / "a.csv"], "a.edits.json: no such edits file"),
        (["edit", tmp_path / "a.csv", *of], "no file of edits, as FILE.json"),
        (["edit", file, *of, "set intensity 1.2"], ""),
        (["edit", file, "--of", speech], "exists; add edits without --of"),
        (["edit", "--und", 2, file], "2 edits to take back, required 0 to 1"),
        (["render", file, "--sound", speech, "-o", tmp_path / "a.csv"], "leave --sound and --units out"),
        (["animate", speech, "--edits", file, "-o", file], "a.edits.json"),
    ):
        done = run(*words)
        assert (done.code != 0) == bool(message)
        assert message in "\n".join(done.err)
    assert json.loads(file.read_text())["steps"] == ["set intensity 1.2"]


def test_a_folder_of_recordings(run, takes, toy_model_file, here):
    done = run("animate", takes, "--model", toy_model_file, "-o", "out/", "{name}.TextGrid", "--to", "json,csv")
    assert done == (0, ["out/a.json", "out/a.csv", "a.TextGrid", "out/b.json", "out/b.csv", "b.TextGrid"], [])
    assert (here / "out" / "a.csv").read_bytes() == (here / "out" / "b.csv").read_bytes()


def test_a_folder_and_a_file_for_one_recording(run, takes, toy_model_file, here):
    (here / "made").mkdir()
    recording = next(takes.glob("a.*"))
    done = run("animate", recording, "--model", toy_model_file, "-o", "new/", "made", "b.csv")
    assert done == (0, ["new/a.json", "made/a.json", "b.csv"], [])


def test_words_beside_recordings_are_used(run, takes, toy_model_file, toy_sentence, here):
    (takes / "a.txt").write_text(" ".join(toy_sentence.words))
    assert run("animate", takes, "--model", toy_model_file, "-o", "out/").code == 0
    documents = [json.loads((here / "out" / f"{name}.json").read_text()) for name in ("a", "b")]
    assert [document["outlook"]["words"] == "transcript" for document in documents] == [True, False]


def test_what_fails_does_not_stop_the_others(run, takes, toy_model_file):
    """The exit code is the highest of those that failed."""
    (takes / "0.wav").write_text("no sound")
    (takes / "a.txt").write_text("five " * 10_000)
    done = run("animate", takes, "--model", toy_model_file, "-o", "out/")
    assert (done.code, done.out) == (5, ["out/b.json"])
    assert len(done.err) == 3
    assert all("skipped" in line for line in done.err[:2])
    assert "2 of 3 recordings were not animated" in done.err[2]
    done = run("animate", takes, "--model", toy_model_file, "-o", "out/", "--machine-readable")
    lines = [json.loads(line) for line in done.out]
    outcomes = [line["outcome"] for line in lines if line["type"] == "item"]
    assert outcomes == ["skipped", "skipped", "animated"]
    assert lines[-1]["type"] == "failure"
    shares = [line["value"] for line in lines if line["type"] == "progress"]
    assert shares == sorted(shares)


def test_what_belongs_to_one_recording(run, takes, toy_model_file):
    done = run("animate", takes, "--model", toy_model_file, "-o", "out/", "--transcript", "bin blue")
    check_refused(done, 3, "--transcript belongs to one recording, and there are 2")
    assert not (takes.parent / "out").exists()


def test_places_that_cannot_be(run, takes, toy_model_file):
    for words, code, message in (
        (["-", "-o", "out/"], 3, "comes through a pipe has no name"),
        (["takes/a.wav", "-", "-o", "out/"], 3, "comes through a pipe has no name"),
        (["takes", "-o", "out/", "b.json"], 7, "b.json: is one file, and there are 2 recordings"),
        (["takes/a.wav", "-o", "out/", "-"], 7, "-: is one file, and no folder"),
        (["takes", "-o", "out/in/", "--to", "jsn"], 7, "unknown format '.jsn'"),
    ):
        check_refused(run("animate", *words, "--model", toy_model_file), code, message)
        assert not (takes.parent / "out").exists()


@pytest.mark.long
def test_a_character_of_several(run, takes, toy_model_file, here):
    write_glb(here / "head.glb", head())
    done = run("animate", takes, "--model", toy_model_file, "-o", "out/", "--character", "head.glb")
    assert done == (0, ["out/a.json", "out/b.json"], [])
    assert read_motion(here / "out" / "b.json")[0].names[0] == "jawOpen"


@pytest.mark.long
def test_standard_input_and_output(toy_model_file, toy_speech, here):
    words = ["animate", "-", "--model", toy_model_file, "-o", "-", "a.csv", "a.json", "--format", "csv"]
    with (
        toy_speech.open("rb") as sound,
        (here / "out").open("wb") as out,
        child([*LIPMOTION, *words], stdin=sound, stdout=out) as process,
    ):
        assert process.wait() == 0
    assert (here / "out").read_bytes() == (here / "a.csv").read_bytes()
    assert json.loads((here / "a.json").read_text())["source"] == {}


@pytest.mark.long
def test_events_go_to_standard_error_beside_motion(run_outside, toy_model_file, toy_speech):
    done = run_outside("animate", toy_speech, "--model", toy_model_file, "-o", "-", "--machine-readable")
    assert [json.loads(line)["type"] for line in done.err][0 :: len(done.err) - 1] == ["start", "success"]
    assert json.loads("\n".join(done.out))["format"] == "lipmotion.motion"


@pytest.mark.skipif(not Path("/dev/fd").is_dir(), reason="no files of open pipes")
@pytest.mark.parametrize("content", ["speech", ""])
@pytest.mark.usefixtures("here")
def test_a_pipe_that_the_shell_has_opened(run, toy_model_file, toy_speech, content):
    reading, writing = os.pipe()
    given = toy_speech.read_bytes() if content else b""

    def write() -> None:
        with os.fdopen(writing, "wb") as file:
            file.write(given)

    writer = threading.Thread(target=write)
    writer.start()
    done = run("animate", f"/dev/fd/{reading}", "--model", toy_model_file, "-o", "a.json")
    writer.join()
    os.close(reading)
    if content:
        assert done == (0, ["a.json"], [])
    else:
        check_refused(done, 3, "nothing comes through the pipe")


def test_controls_of_files(run, toy_model_file, toy_speech, here):
    basics = ("animate", toy_speech, "--model", toy_model_file, "-o")
    assert run(*basics, "plain.json").code == 0
    given = "--offset-ms 200 --anticipation-ms 50 --intensity 2".split()
    assert run(*basics, "other.json", *given).code == 0
    assert run(*basics, "steps.json", "--stepped", "--fps", "24", "--channels", "opening").code == 0
    plain, other, steps = (read_motion(here / f"{name}.json") for name in ("plain", "other", "steps"))
    assert len(other[0].values) == len(plain[0].values) + 20
    assert other[1][1].start_s == pytest.approx(plain[1][1].start_s + 0.15)
    assert other[0]["opening"].max() > 1.3 * plain[0]["opening"].max()
    assert steps[0].rate_hz == 24
    changes = np.flatnonzero(np.diff(steps[0]["opening"])) + 1
    assert np.diff([0, *changes, len(steps[0].values)]).min() >= 2


def test_a_folder(run, takes, toy_model_file, here):
    words = ["batch", takes, "--out", "out", "--to", "csv,cues.tsv", "--model", toy_model_file, "--jobs", "1"]
    words += ["--channels", "opening,width", "--rate", "25"]
    done = run(*words)
    assert (done.code, done.err) == (0, [])
    assert done.out == [f"2 lines: 2 done, 0 kept, 0 failed; report: {here / 'out' / 'report.html'}"]
    assert (here / "out" / "a.csv").read_text().splitlines()[0] == "time_s,opening,width"
    assert {path.name for path in (here / "out").iterdir()} == {
        "a.csv", "a.cues.tsv", "b.csv", "b.cues.tsv", "batch.jsonl", "report.csv", "report.html",
    }  # fmt: skip
    basics = ["--model", toy_model_file, "--fps", "30", "--recogniser", "own"]  # its frame rate is that of animate
    (takes / "b.wav").unlink()
    assert run("batch", takes, "--out", "out", *basics, "--jobs", "1").code == 0
    assert run("animate", takes / "a.wav", "-o", "a.json", *basics).code == 0
    assert (here / "out" / "a.json").read_bytes() == (here / "a.json").read_bytes()


def test_a_line_that_fails_is_told_by_the_exit_code(run, takes, toy_model_file, here):
    (takes / "b.wav").write_text("no sound")
    done = run("batch", takes, "--out", "out", "--model", toy_model_file, "--jobs", "1", "--machine-readable")
    events = [json.loads(line) for line in done.out]
    assert done.code == 3
    assert [(event["name"], event["outcome"]) for event in events if event["type"] == "item"] == [
        ("a", "done"), ("b", "failed"),
    ]  # fmt: skip
    assert events[-1]["type"] == "failure"
    assert "2 lines: 1 done, 0 kept, 1 failed; the reasons are in" in events[-1]["reason"]
    assert (here / "out" / "a.json").is_file()
