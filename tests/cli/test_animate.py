import json
import zipfile
from pathlib import Path

import pytest
from PIL import Image

from cli.conftest import is_one_error
from lipmotion import animate, load_model, read_motion, write


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


@pytest.mark.usefixtures("here")
def test_outputs_are_checked_before_work_begins(run):
    for options, code in ((["missing/a.json"], 7), (["a.json", "--rate", "0"], 3), (["a.xyz"], 7)):
        done = run("animate", "missing.wav", "--model", "missing.lipmotion", "-o", *options)
        assert is_one_error(done, code)
        assert "no such" not in done.err[0]


def test_a_picture_of_the_posteriors(run, coupled_model_file, toy_speech, here):
    basics = ("animate", toy_speech, "--model", coupled_model_file, "-o")
    assert run(*basics, "a.json", "--posteriors", "a.png") == (0, ["a.json", "a.png"], [])
    with Image.open(here / "a.png") as picture:
        assert picture.format == "PNG"
        assert 600 < picture.width <= 2200
    run(*basics, "b.json")
    assert (here / "a.json").read_bytes() == (here / "b.json").read_bytes()
    assert sorted(path.name for path in here.iterdir()) == ["a.json", "a.png", "b.json"]


def test_onto_another_person(run, here, toy_model_file, toy_speech, toy_corpus):
    given = ["animate", toy_speech, "--model", toy_model_file, "-o", "one.npz"]
    assert run(*given, "--onto", toy_corpus.path).code == 0
    assert (here / "one.npz").is_file()


def test_articulation_in_motion_files(run, basics, here):
    assert run(*basics, "-o", "a.csv", "--articulation")[0] == 0
    header = (here / "a.csv").read_text().splitlines()[0].split(",")
    assert header[-6:] == ["tongue", "lip_tuck", "protrusion", "spread", "lip_press", "teeth"]


def test_the_addon_is_written_or_one_line_says_why_not(run, here):
    for program, name in (("maya", "a.zip"), ("blender", "a.blend")):
        assert is_one_error(run("addon", program, "-o", name), 7)
        assert list(here.iterdir()) == []
    assert run("addon", "blender", "-o", "a.zip").code == 0
    assert zipfile.is_zipfile(here / "a.zip")


@pytest.mark.long
def test_scenes_takes_and_scripts_are_written_without_a_character(run, here, basics):
    names = ["a.glb", "a.usda", "a.livelink.csv", "a.blender.py"]
    assert run(*basics, "-o", *names, "--rate", "30").code == 0
    assert sorted(path.name for path in here.iterdir()) == sorted(names)
    assert (here / "a.usda").read_text().startswith("#usda 1.0")
    assert "SpatialAudio" in (here / "a.usda").read_text()
