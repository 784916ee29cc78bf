import json
import shutil
from pathlib import Path

import pytest


@pytest.fixture
def speech(toy_speech: Path, tmp_path: Path) -> Path:
    shutil.copy(toy_speech, tmp_path / "speech.wav")
    return tmp_path / "speech.wav"


def test_what_is_edited_is_replayed_by_all_verbs(run, speech, toy_model_file, tmp_path):
    """The same bytes, from the recording and from the file alone."""
    file = tmp_path / "a.edits.json"
    of = ("--of", speech, "--model", toy_model_file, "--recogniser", "own")
    done = run("edit", file, "phone 3 is p", *of, "--list")
    assert done.code == 0
    assert any(line.startswith("   3 ") and line.split()[3:4] == ["p"] for line in done.out)
    assert run("edit", file, "--machine-readable").code == 0
    assert run("edit", file, "pin jawOpen 0.7 at 1.2", "set intensity 1.2", "remove phone 99").code == 3
    assert json.loads(file.read_text())["steps"] == ["phone 3 is p"]  # none of them, for one is not possible
    assert run("edit", file, "pin jawOpen 0.7 at 1.2", "set intensity 1.2").code == 0
    assert run("edit", file, "pin opening 0.1 at 1", "--undo", 1).code == 0
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
    file = tmp_path / "a.edits.json"
    for words, message in (
        (["edit", file, "phone 3 is p"], "no such file; begin one: lipmotion edit"),
        (["render", file, "-o", tmp_path / "a.csv"], "a.edits.json: cannot be read"),
        (["animate", speech, "--edits", file, "-o", tmp_path / "a.csv"], "a.edits.json: no such edits file"),
        (["edit", tmp_path / "a.csv", "--of", speech, "--model", toy_model_file], "ends in one of: .json, .toml"),
    ):
        done = run(*words)
        assert done.code != 0
        assert message in "\n".join(done.err)
    assert run("edit", file, "--of", speech, "--model", toy_model_file, "--recogniser", "own").code == 0
    for words, message in (
        (["edit", file, "--of", speech], "exists; add edits without --of"),
        (["edit", file, "--undo", 2], "2 edits to take back, required 0 to 0"),
        (["render", file, "--sound", speech, "-o", tmp_path / "a.csv"], "leave --sound and --units out"),
        (["animate", speech, "--edits", file, "-o", file], "a.edits.json"),
    ):
        done = run(*words)
        assert done.code != 0
        assert message in "\n".join(done.err)
    assert json.loads(file.read_text())["steps"] == []
