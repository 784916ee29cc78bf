import io
import json
import os
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from cli.conftest import check_refused, is_one_error
from lipmotion import read_motion
from lipmotion.cli.main import main
from lipmotion.meshes.fitting.driven import DrivenCharacter
from lipmotion_faces.characters.character_files import load_character
from meshes.heads import head, write_glb


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


def test_what_belongs_to_one_recording(run, takes, toy_model_file, here):
    check_refused(
        run("animate", takes, "--model", toy_model_file, "-o", "out/", "--transcript", "bin blue"),
        3,
        "--transcript belongs to one recording, and there are 2",
    )
    assert is_one_error(run("animate", takes, "--model", toy_model_file, "-o", "one.json"), 7)
    assert not (here / "out").exists()


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


def test_a_character_is_opened_once(run, takes, toy_model_file, here, monkeypatch):
    write_glb(here / "head.glb", head())
    opened: list[Path] = []

    def counted(path: Path, **how: object) -> DrivenCharacter:
        opened.append(path)
        return load_character(path, **how)  # type: ignore[arg-type]

    monkeypatch.setattr("lipmotion_faces.characters.character_files.load_character", counted)
    done = run("animate", takes, "--model", toy_model_file, "-o", "out/", "--character", "head.glb")
    assert done == (0, ["out/a.json", "out/b.json"], [])
    assert opened == [Path("head.glb")]
    assert read_motion(here / "out" / "b.json")[0].names[0] == "jawOpen"


@pytest.mark.usefixtures("_piped_speech")
def test_standard_input_and_output(toy_model_file, here, monkeypatch):
    written = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(written))
    words = ["animate", "-", "--model", str(toy_model_file), "-o", "-", "a.csv", "a.json", "--format", "csv"]
    assert main(words) == 0
    assert written.getvalue() == (here / "a.csv").read_bytes()
    assert json.loads((here / "a.json").read_text())["source"] == {}


@pytest.mark.usefixtures("here")
def test_events_go_to_standard_error_beside_motion(run, toy_model_file, toy_speech, monkeypatch):
    kept = io.BytesIO()
    monkeypatch.setattr("lipmotion.cli.arguments.paths.write_bytes", lambda path: kept.write(path.read_bytes()))
    done = run("animate", toy_speech, "--model", toy_model_file, "-o", "-", "--machine-readable")
    assert (done.code, done.out) == (0, [])
    assert [json.loads(line)["type"] for line in done.err][0 :: len(done.err) - 1] == ["start", "success"]
    assert json.loads(kept.getvalue())["format"] == "lipmotion.motion"


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


@pytest.mark.usefixtures("here")
def test_controls_of_cues(run, toy_model_file, toy_speech):
    basics = ("cues", toy_speech, "--model", toy_model_file)
    plain, late, long = run(*basics), run(*basics, "--offset-ms", "500"), run(*basics, "--min-hold-ms", "250")
    times = [float(line.split("\t")[0]) for line in plain.out]
    assert float(late.out[1].split("\t")[0]) == pytest.approx(times[1] + 0.5, abs=0.05)
    assert len(long.out) < len(plain.out)
    assert np.diff([float(line.split("\t")[0]) for line in long.out])[:-1].min() >= 0.24
