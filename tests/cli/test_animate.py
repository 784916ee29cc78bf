from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from cli.conftest import RunCommand, is_one_error
from lipmotion import Corpus, animate, load_model, read_motion, write
from lipmotion.pipeline.request import Request


@pytest.fixture
def basics(toy_speech: Path, toy_model_file: Path) -> tuple[object, ...]:
    return ("animate", toy_speech, "--model", toy_model_file)


def test_motion_files(run, basics, here):
    done = run(*basics, "-o", "a.json", "a.csv", "-o", "a.npz", "--rate", "50")
    assert done == (0, ["a.json", "a.csv", "a.npz"], [])
    assert sorted(path.name for path in here.iterdir()) == ["a.csv", "a.json", "a.npz"]
    assert read_motion(Path("a.json"))[0].rate_hz == 50


@pytest.mark.long
def test_it_is_the_function_of_the_same_name(run, basics, here, toy_speech, toy_model_file):
    run(*basics, "-o", "command.json")
    model = load_model(toy_model_file)
    write(animate(toy_speech, model=model), ["function.json"], speech=toy_speech, model=model)
    assert (here / "command.json").read_bytes() == (here / "function.json").read_bytes()


def test_a_video(run, basics, here):
    assert run(*basics, "-o", "a.mp4", "--fps", "5", "--size", "160") == (0, ["a.mp4"], [])
    assert (here / "a.mp4").stat().st_size > 5000


def test_a_transcript(run, basics, here):
    words = "See Bob, papa — mama!"
    (here / "words.lab").write_text("\ufeff" + words, encoding="utf-8")
    for transcript in ("words.lab", words):
        done = run(*basics, "-o", "a.json", "--transcript", transcript)
        assert (done.code, done.err) == (0, [])
        units = json.loads((here / "a.json").read_text())["units"]
        assert " ".join(unit["phone"] for unit in units) == "sil s iy b aa b p aa p ax m aa m ax sil"


def test_an_unknown_word_is_a_warning(run, basics, here):
    done = run(*basics, "-o", "a.json", "--transcript", "see bimab papa mama")
    assert done.code == 0
    assert "'bimab' is not in the dictionary; read as 'b " in "".join(done.err)
    assert (here / "a.json").exists()


def test_a_lexicon_file(run, basics, here, caplog):
    (here / "lexicon.txt").write_text("bimab B AA1 B\n")
    done = run(*basics, "-o", "a.json", "--transcript", "see bimab papa mama", "--lexicon", "lexicon.txt")
    assert (done.code, caplog.text) == (0, "")


UNUSABLE = [
    (["--rate", "0"], 3, "frame rate is 0 a second, required 1 to 1000"),
    (["--fps", "1e9"], 3, "frame rate is 1e+09"),
    (["--fps", "999"], 7, "required 240 or fewer"),
    (["--workers", "-1"], 3, "required 1 or more"),
    (["--workers", "0"], 3, "required 1 or more"),
    (["--transcript", "missing.txt"], 3, "missing.txt: no such transcript file"),
    (["--transcript", "five " * 10_000], 5, "the transcript has 50000 characters"),
    (["--lexicon", "missing.txt"], 3, "missing.txt: no such lexicon file"),
    (["--model", "missing.lipmotion"], 3, "missing.lipmotion: no such model"),
    (["-o", "a.xyz"], 7, "unknown format '.xyz'; required one of: .json .csv .npz "),
    (["-o", "a.csv", "x" * 300 + ".json"], 7, "cannot be written: File name too long"),
    (["--still", "nose"], 3, "blinks, gaze, brows, head"),
    (["--size", "63"], 3, "even number"),
    (["--intensity", "7"], 3, "0 to 3"),
    (["--background", "pink"], 3, "#40a0ff"),
    (["--background", "transparent"], 7, "cannot be transparent"),
]


def test_options_that_cannot_be_used(run, basics, here):
    for options, code, words in UNUSABLE:
        done = run(*basics, "-o", "a.json", "a.mp4", *options)
        assert is_one_error(done, code), done
        assert words in done.err[0]
        assert list(here.iterdir()) == []


@pytest.mark.usefixtures("here")
def test_outputs_are_checked_before_work_begins(run: RunCommand) -> None:
    for options, code in ((["missing/a.json"], 7), (["a.json", "--rate", "0"], 3), (["a.xyz"], 7)):
        done = run("animate", "missing.wav", "--model", "missing.lipmotion", "-o", *options)
        assert is_one_error(done, code)
        assert "no such" not in done.err[0]


def test_a_wrong_command_line(run, basics, here):
    for options in ([], ["-o"], ["-o", "a.json", "--rate", "fast"], ["-o", "a.json", "--bogus"]):
        done = run(*basics, *options)
        assert done.code == 2
        assert done.err[-1].startswith("lipmotion")
        assert list(here.iterdir()) == []


def test_edited_units_are_used(run, basics, here):
    run(*basics, "-o", "a.json")
    text = (here / "a.json").read_text(encoding="utf-8")
    document = json.loads(text)
    document["units"][1]["phone"] = "aa"
    (here / "edited.json").write_text(json.dumps(document), encoding="utf-8")
    assert run(*basics, "-o", "b.json", "--units", "edited.json", "--channels", "opening").code == 0
    after = json.loads((here / "b.json").read_text(encoding="utf-8"))
    assert [unit["phone"] for unit in after["units"]] == [unit["phone"] for unit in document["units"]]
    assert [channel["name"] for channel in after["channels"]] == ["opening"]


def test_a_textgrid_goes_out_and_comes_back(run, basics, here):
    assert run(*basics, "-o", "a.json", "a.TextGrid").out == ["a.json", "a.TextGrid"]
    assert run(*basics, "-o", "b.json", "--units", "a.TextGrid").code == 0
    first, again = (json.loads((here / name).read_text(encoding="utf-8")) for name in ("a.json", "b.json"))
    assert first["values"] == again["values"]


def test_units_with_a_gap_are_silent_there(run, basics, here):
    run(*basics, "-o", "a.json")
    units = json.loads((here / "a.json").read_text(encoding="utf-8"))["units"]
    rows = [{key: row[key] for key in ("start_s", "end_s", "phone")} for row in units]
    (here / "cut.json").write_text(json.dumps({"units": rows[:3] + rows[5:]}), encoding="utf-8")
    assert run(*basics, "-o", "b.json", "--units", "cut.json").code == 0
    after = json.loads((here / "b.json").read_text(encoding="utf-8"))["units"]
    assert [row["phone"] for row in after[2:5]] == [rows[2]["phone"], "sil", rows[5]["phone"]]
    assert after[3]["end_s"] == rows[5]["start_s"]


def test_a_picture_of_the_posteriors(run, coupled_model_file, toy_speech, here):
    basics = ("animate", toy_speech, "--model", coupled_model_file, "-o")
    assert run(*basics, "a.json", "--posteriors", "a.png") == (0, ["a.json", "a.png"], [])
    with Image.open(here / "a.png") as picture:
        assert picture.format == "PNG"
        assert 600 < picture.width <= 2200
    run(*basics, "b.json")
    assert (here / "a.json").read_bytes() == (here / "b.json").read_bytes()
    assert sorted(path.name for path in here.iterdir()) == ["a.json", "a.png", "b.json"]


@pytest.mark.long
def test_one_of_several_people(run, here, toy_speech, toy_corpus, tmp_path):
    people = Corpus.create(tmp_path / "people")
    for number, name in enumerate(toy_corpus.names("train")):
        people.add(replace(toy_corpus.utterance(name), speaker=("anna", "ben")[number % 2]))
    assert run("train", people.path, "-o", "m", "--from", "none").code == 0
    assert any("anna; ben" in line for line in run("info", "m").out)
    done = run("animate", toy_speech, "--model", "m", "--recogniser", "own", "--speaker", "ben", "-o", "ben.json")
    assert (done.code, done.out) == (0, ["ben.json"])
    request = Request(toy_speech, recogniser="own", speaker="ben")
    written, expected = read_motion(here / "ben.json")[0], animate(request, model="m").motion
    assert written["opening"].tolist() == pytest.approx(expected["opening"].tolist(), abs=1e-5)
    done = run("animate", toy_speech, "--model", "m", "--speaker", "cleo", "-o", "cleo.json")
    assert is_one_error(done, 3)
    assert "no speaker 'cleo', only: anna, ben" in done.err[0]


def test_onto_another_person(run, here, toy_model_file, toy_speech, toy_corpus):
    given = ["animate", toy_speech, "--model", toy_model_file, "-o", "one.npz"]
    assert run(*given, "--onto", toy_corpus.path).code == 0
    assert (here / "one.npz").is_file()
    for options, code, words in (
        (["--onto", "missing.mp4"], 3, "missing.mp4: no such file"),
        (["--onto", toy_speech.parent], 4, "not a corpus"),
        (["--onto-speaker", "ben"], 3, "onto the speaker 'ben', but of what?"),
        (["--onto", toy_corpus.path, "--onto-speaker", "ben"], 3, "no speaker 'ben'"),
        (["--onto", toy_corpus.path, "-o", toy_corpus.path / "one.json"], 7, "lies in"),
    ):
        done = run(*given, *options)
        assert is_one_error(done, code)
        assert words in done.err[0]
    assert not (toy_corpus.path / "one.json").exists()


def test_a_staged_face(run, basics, here):
    staging = "--face cartoon --size 64 --background #102030 --intensity 1.5 --still gaze,head --face-seed 3 --fps 5"
    assert run(*basics, "-o", "a%02d.png", *staging.split()) == (0, ["a%02d.png"], [])
    picture = Image.open(here / "a00.png")
    assert picture.size == (64, 64)
    assert picture.getpixel((0, 0)) == (16, 32, 48)


def test_articulation_in_motion_files(run, basics, here):
    assert run(*basics, "-o", "a.csv", "--articulation")[0] == 0
    header = (here / "a.csv").read_text().splitlines()[0].split(",")
    assert header[-6:] == ["tongue", "lip_tuck", "protrusion", "spread", "lip_press", "teeth"]
