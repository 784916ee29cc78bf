import argparse
import ast
import re
import sys
from dataclasses import fields
from pathlib import Path

import pytest

from cli.conftest import check_refused, is_one_error
from lipmotion import Job, Outputs, Request
from lipmotion.cli import command_line
from lipmotion.cli.arguments.declared import part_of
from lipmotion.pipeline.job import DETAILS
from lipmotion.types import Delivery, Staging

LINE = """animate a.wav --transcript t.txt --model m.lipmotion --pauses natural -o a.json b.mp4 -o c.vtt --channels
opening,width --fps 30 --face man --jaw none --control-points --to csv,mp4 --still blinks,head --face-seed 3 --stepped
--offset-ms -40 --background #102030"""
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
FILE = """[request]
recording = "a.wav"
transcript = "t.txt"
model = "m.lipmotion"
pauses = "natural"
[outputs]
files = ["a.json", "b.mp4", "c.vtt"]
channels = ["opening", "width"]
fps = 30
face = "man"
background = "#102030"
jaw = "none"
control_points = true
kinds = ["csv", "mp4"]
[delivery]
offset_ms = -40
stepped = true
[staging]
blinks = false
head = false
seed = 3
"""
OTHERS = {
    "corpus --channels",
    "experiment --channels",
    *("cues --fps", "evaluate --speaker", "train --units", "train --speaker", "face --speaker"),
    *("corpus --offset-ms", "studio --model", "studio --character", "studio --face"),
    *("live --model", "live --pauses", "live --rate", "live --to", "live --character"),
}
"""Options of other verbs that have such a name, and another meaning or another default."""
needs_toml = pytest.mark.skipif(sys.version_info < (3, 11), reason="Python 3.10 reads no TOML")


def parsed(*words: str) -> Job:
    options = command_line.parse_words(words, argparse.Namespace())
    speech = options.speech[0] if isinstance(options.speech, list) else options.speech
    request = part_of(options, options.start.request, recording=speech)
    return part_of(options, options.start, request=request)


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
    assert (job.outputs.rate_hz, job.delivery, job.staging) == (
        30,
        DETAILS["mobile"].delivery,
        DETAILS["mobile"].staging,
    )
    job = parsed("animate", "a.wav", "--rate", "60", "--detail", "game", "-o", "a.json", "--still", "head")
    assert (job.outputs.rate_hz, job.delivery, job.staging.head) == (60, DETAILS["game"].delivery, False)
    assert parsed("animate", "a.wav", "-o", "a.json", "--detail", "film") == parsed("animate", "a.wav", "-o", "a.json")


def test_each_option_is_declared_once():
    """No flag stands twice in the parts of a job, and none of them in a module of the command line."""
    parts = (Request, Outputs, Delivery, Staging)
    told = [each for part in parts for each in fields(part) if "help" in each.metadata and "still" not in each.metadata]
    flags = [flag for each in told for flag in each.metadata.get("flags", ("--" + each.name.replace("_", "-"),))]
    assert len(set(flags)) == len(flags) > 30
    found = set()
    source = Path(command_line.__file__).parents[2]
    for path in [*(source / "lipmotion" / "cli").rglob("*.py"), *source.glob("lipmotion_*/verbs/*.py")]:
        calls = [node for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, ast.Call)]
        words = {str(word.value) for node in calls for word in node.args if isinstance(word, ast.Constant)}
        found |= {f"{path.stem} {flag}" for flag in words & {*flags} - {"-o", "--output", "speech"}}
    assert found == OTHERS


@pytest.mark.usefixtures("here")
def test_only_files_that_are_read_are_declared_as_inputs():
    options = command_line.parse_words(LINE.split(), argparse.Namespace())
    read = {one.name for one in options.reads}
    assert {"speech", "transcript", "lexicon", "units", "model", "onto", "face", "background", "job"} <= read
    assert {one.name for one in options.writes} == {"output", "posteriors"}


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
    line = ("batch", "sounds", "--out", "out", "--job", "scene.toml", "--jobs", "1", "--channels", "width")
    assert run(*line).code == 0
    rows = (here / "out" / "a.csv").read_text().splitlines()
    assert (rows[0], re.split(",", rows[2])[0]) == ("time_s,width", "0.04")
    (here / "scene.toml").write_text("[request]\nrecording = 'a.wav'\n")
    check_refused(run(*line), 3, "the job of a batch has 'recording'")


@needs_toml
def test_what_is_wrong_with_a_file(run, here):
    (here / "half.toml").write_text("[request]\nrecording = 'a.wav'\n")
    (here / "wrong.toml").write_text("[staging]\nface-seed = 3\n")
    done = run("animate", "--job", "half.toml")
    assert (done.code, done.err[-1].partition("; see")[0]) == (
        2,
        "lipmotion: error: the following arguments are required: -o/--output",
    )
    for words, message in (
        ("wrong.toml", "wrong.toml: in [staging]: no option 'face-seed'; here it is called 'seed'"),
        ("missing.toml", "missing.toml: no such job file"),
    ):
        check_refused(run("animate", "--job", words), 3, message)
