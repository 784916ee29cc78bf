import json
import shutil
from pathlib import Path

import pytest


@pytest.fixture
def sounds(here: Path, toy_speech: Path) -> Path:
    folder = here / "sounds"
    folder.mkdir()
    for name in ("a.wav", "b.wav"):
        shutil.copy(toy_speech, folder / name)
    return folder


def test_a_folder(run, sounds, toy_model_file, here):
    words = ["batch", sounds, "--out", "out", "--to", "csv,cues.tsv", "--model", toy_model_file, "--jobs", "1"]
    words += ["--channels", "opening,width", "--rate", "25"]
    done = run(*words)
    assert (done.code, done.err) == (0, [])
    assert done.out == [f"2 lines: 2 done, 0 kept, 0 failed; report: {here / 'out' / 'report.html'}"]
    assert (here / "out" / "a.csv").read_text().splitlines()[0] == "time_s,opening,width"
    assert {path.name for path in (here / "out").iterdir()} == {
        "a.csv", "a.cues.tsv", "b.csv", "b.cues.tsv", "batch.jsonl", "report.csv", "report.html",
    }  # fmt: skip


def test_the_frame_rate_is_that_of_animate(run, sounds, toy_model_file, here):
    (sounds / "b.wav").unlink()
    basics = ["--model", toy_model_file, "--fps", "30", "--recogniser", "own"]
    assert run("batch", sounds, "--out", "out", *basics, "--jobs", "1").code == 0
    assert run("animate", sounds / "a.wav", "-o", "a.json", *basics).code == 0
    assert (here / "out" / "a.json").read_bytes() == (here / "a.json").read_bytes()


def test_a_line_that_fails_is_told_by_the_exit_code(run, sounds, toy_model_file, here):
    (sounds / "b.wav").write_text("no sound")
    done = run("batch", sounds, "--out", "out", "--model", toy_model_file, "--jobs", "1", "--machine-readable")
    events = [json.loads(line) for line in done.out]
    assert done.code == 3
    assert [(event["name"], event["outcome"]) for event in events if event["type"] == "item"] == [
        ("a", "done"), ("b", "failed"),
    ]  # fmt: skip
    assert events[-1]["type"] == "failure"
    assert "2 lines: 1 done, 0 kept, 1 failed; the reasons are in" in events[-1]["reason"]
    assert (here / "out" / "a.json").is_file()


def test_what_it_refuses(run, sounds, toy_model_file, here):
    for words, code in [
        ((sounds, "--out", sounds / "out"), 7),
        ((sounds, "--out", "out", "--to", "wav"), 7),
        ((here / "missing", "--out", "out"), 3),
        ((sounds, "--out", "out", "--still", "ears"), 3),
    ]:
        done = run("batch", *words, "--model", toy_model_file, "--jobs", "1")
        assert (done.code, len(done.err)) == (code, 1), done


def test_a_check_writes_nothing(run, sounds, here):
    done = run("batch", "--check", sounds, "--jobs", "1")
    assert done.code == 3
    assert done.out == ["problem\tline\tfound", "same sound\tb\tas of a"]
    assert done.err == ["lipmotion: error: 2 lines: 1 same sound"]
    (sounds / "b.wav").unlink()
    done = run("batch", "--check", sounds, "--jobs", "1")
    assert (done.code, done.out) == (0, ["1 lines: nothing found"])
    (sounds / "b.wav").touch()
    done = run("batch", "--check", sounds, "--jobs", "1", "--machine-readable")
    events = [json.loads(line) for line in done.out]
    assert [(each["name"], each["outcome"]) for each in events if each["type"] == "item"] == [("b", "unreadable")]
    assert events[-1]["exit_code"] == done.code == 3
    assert {path.name for path in here.iterdir()} == {"sounds"}
    assert "add --out DIR" in run("batch", sounds).err[0]
