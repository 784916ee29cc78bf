import json
import zipfile
from dataclasses import replace
from pathlib import Path
from shutil import copy

import av
import numpy as np
import pytest

from cli.conftest import RunCommand, check_refused, is_one_error
from lipmotion import read_motion
from meshes.heads import head, lip_points, write_glb, write_obj


@pytest.fixture
def motion_file(run: RunCommand, toy_model_file: Path, toy_speech: Path, here: Path) -> Path:
    assert run("animate", toy_speech, "--model", toy_model_file, "-o", "said.json").code == 0
    return here / "said.json"


def pictures(path: Path) -> list[np.ndarray]:
    with av.open(str(path)) as video:
        return [frame.to_ndarray(format="rgb24").astype(int) for frame in video.decode(video=0)]


def test_edited_values_are_drawn_and_the_last_pose_stays_where_motion_is_shorter(run, motion_file, toy_speech, here):
    document = json.loads(motion_file.read_text())
    column = [channel["name"] for channel in document["channels"]].index("opening")
    for row in document["values"]:
        row[column] = 0.0
    (here / "shut.json").write_text(json.dumps(document))
    for name in ("said", "shut"):
        given = (f"{name}.json", "--sound", toy_speech, "-o", f"{name}.mp4", f"{name}.csv")
        assert run("render", *given, "--size", "96", "--fps", "12") == (0, [f"{name}.mp4", f"{name}.csv"], [])
    said, shut = pictures(here / "said.mp4"), pictures(here / "shut.mp4")
    assert len(said) == len(shut)
    assert max(int(np.abs(a - b).max()) for a, b in zip(said, shut, strict=True)) > 60
    assert read_motion(here / "shut.csv")[0]["opening"].max() == pytest.approx(0)
    with av.open(str(here / "said.mp4")) as video:
        assert video.streams.audio
    document["values"] = document["values"][:60]
    (here / "cut.json").write_text(json.dumps(document))
    done = run("render", "cut.json", "--sound", toy_speech, "-o", "cut.csv")
    assert done.code == 0
    assert "the motion lasts 0.59 s, the sound" in done.err[0]
    assert "the last pose stays" in done.err[0]
    assert len(read_motion(here / "cut.csv")[0].values) == pytest.approx(len(read_motion(motion_file)[0].values), abs=2)


def test_blendshapes_without_phones_or_sound(run, here):
    time_s = np.arange(50) / 50
    jaw = np.maximum(np.sin(2 * np.pi * time_s), 0)
    rows = "\n".join(f"{t:.2f},{w:.4f},0" for t, w in zip(time_s, jaw, strict=True))
    (here / "rig.csv").write_text(f"time_s,jawOpen,mouthPucker\n{rows}\n")
    assert run("render", "rig.csv", "-o", "a.mp4", "a.json", "--size", "96", "--curves", "arkit").code == 0
    frames = pictures(here / "a.mp4")
    assert int(np.abs(frames[6] - frames[20]).max()) > 60
    weights = read_motion(here / "a.json")[0]
    assert weights["jawOpen"] == pytest.approx(jaw, abs=1e-3)


def test_a_glb_plays_with_its_sound_wherever_its_folder_goes(run, toy_speech, toy_model_file, glb, here):
    (here / "old").mkdir()
    sound = copy(toy_speech, here / "old" / "take #1 50%.wav")
    assert run("animate", sound, "--model", toy_model_file, "--character", glb, "-o", "old/a.glb").code == 0
    (here / "old").rename(here / "new")
    done = run("render", "new/a.glb", "-o", "a.mp4", "--size", "96", "--fps", "5")
    assert done.code == 0
    with av.open(str(here / "a.mp4")) as video:
        assert max(float(np.abs(frame.to_ndarray()).max()) for frame in video.decode(audio=0)) > 0.01
    (here / "new" / "take #1 50%.wav").unlink()
    assert "is not there; give a sound" in run("render", "new/a.glb", "-o", "b.json").err[0]


def test_motion_of_more_than_a_day_is_refused(run, here):
    (here / "long.csv").write_text("time_s,opening\n" + "".join(f"{n / 4},0\n" for n in range(4 * 86_401 + 1)))
    check_refused(run("render", "long.csv", "-o", "a.json"), 3, "lasts 86401 s, required at most 86400; cut it")


def test_a_single_pose_is_written(run, here):
    (here / "pose.csv").write_text("time_s,opening\n0,0.1\n0.01,0.1\n")
    assert run("render", "pose.csv", "-o", "a.livelink.csv", "a.mp4", "a%05d.png", "--size", "64").code == 0
    assert {path.name for path in here.glob("a*")} == {"a.livelink.csv", "a.mp4", "a00000.png"}


def test_the_rate_of_motion_can_be_given(run, here):
    rows = "\n".join(f"{n / 30:.5f},{n / 100:.2f}" for n in range(60))
    (here / "a.csv").write_text(f"time,jawOpen\n{rows}\n")
    assert run("render", "a.csv", "--motion-rate", "15", "-o", "b.json", "--curves", "arkit").code == 0
    assert read_motion(here / "b.json")[0].rate_hz == pytest.approx(15)
    assert is_one_error(run("render", "a.csv", "--motion-rate", "0", "-o", "b.json"), 3)


def test_articulation_in_motion_files(run, basics, here):
    assert run(*basics, "-o", "b.csv", "--articulation").code == 0
    header = (here / "b.csv").read_text().splitlines()[0].split(",")
    assert header[-6:] == ["tongue", "lip_tuck", "protrusion", "spread", "lip_press", "teeth"]


@pytest.mark.usefixtures("here")
def test_outputs_are_checked_before_work_begins(run):
    for options, code in ((["missing/a.json"], 7), (["a.json", "--rate", "0"], 3), (["a.xyz"], 7)):
        done = run("animate", "missing.wav", "--model", "missing.lipmotion", "-o", *options)
        assert is_one_error(done, code)
        assert "no such" not in done.err[0]


def test_the_addon_is_written_or_one_line_says_why_not(run, here):
    for program, name in (("maya", "a.zip"), ("blender", "a.blend")):
        assert is_one_error(run("addon", program, "-o", name), 7)
        assert list(here.iterdir()) == []
    assert run("addon", "blender", "-o", "a.zip").code == 0
    assert zipfile.is_zipfile(here / "a.zip")


@pytest.fixture
def glb(here: Path) -> Path:
    write_glb(here / "head.glb", head())
    return here / "head.glb"


def test_what_is_in_a_file_is_printed(run, glb, monkeypatch):
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    done = run("character", glb, "--write-points", "points.csv", "--picture", "head.png")
    assert (done.code, done.out[0].split()[0], "drawing the picture" in "".join(done.err)) == (0, "vertices", True)
    assert any("moved by       arkit: jawOpen, mouthClose" in line for line in done.out)
    assert done.out[-2:] == ["points.csv", "head.png"]
    assert Path("points.csv").read_text().startswith("point,vertex\n61,")
    assert Path("head.png").read_bytes().startswith(b"\x89PNG")


def test_a_table_is_written_calibrated_and_found(run, glb, here):
    assert run("character", glb, "--write-table").out[-1].endswith("head.glb.character.csv")
    assert (here / "head.glb.character.csv").read_text(encoding="utf-8-sig").startswith("control,source,gain,offset,")
    done = run("character", glb, "--open", "jawOpen=0.3", "--closed", "jawOpen=0.02")
    assert any(line.startswith("table ") for line in done.out)
    assert "jawOpen        jawOpen: gain 0." in done.out[-2]
    (here / "rig.csv").write_text("control,source\nJaw,jawOpen\n")
    assert run("character", "rig.csv", "--open", "Jaw=-20").out[-1] == "rig.csv"
    assert "Jaw,jawOpen,-" in (here / "rig.csv").read_text(encoding="utf-8-sig")
    for arguments, message in (
        (("character", glb, "--open", "0.3"), "--open: '0.3' names no control, required NAME=X"),
        (("character", "rig.csv"), "state values of its controls"),
    ):
        check_refused(run(*arguments), 3, message)


def test_the_table_of_a_mouth_that_is_not_found_is_written_to_be_filled_in(run, here):
    named = tuple(replace(shape, name=f"no {number}") for number, shape in enumerate(head().shapes))
    write_glb(here / "odd.glb", replace(head(), shapes=named))
    done = run("character", "odd.glb", "--write-table")
    assert (done.code, done.out) == (3, ["odd.glb.character.csv"])
    assert "Say which one does in a table beside the character" in done.err[0]
    assert (here / "odd.glb.character.csv").read_text(encoding="utf-8-sig").splitlines()[1] == "no 0,,1,0,0,1"


def test_a_mesh_without_blendshapes_is_bound_once(run, here, basics):
    plain = head(shapes=False)
    write_obj(here / "head.obj", plain)
    rows = "".join(f"{point},{vertex}\n" for point, vertex in lip_points(plain).items())
    (here / "points.csv").write_text("point,vertex\n" + rows)
    assert run("character", "head.obj", "--lip-points", "points.csv", "--write-binding", "head.binding").code == 0
    assert (here / "head.binding").exists()
    character = ("--character", "head.obj", "--binding", "head.binding", "--fps", "5", "--size", "90")
    assert run(*basics, *character, "-o", "said.mp4") == (0, ["said.mp4"], [])
