import json
from pathlib import Path
from shutil import copy

import av
import numpy as np
import pytest

from cli.conftest import RunCommand, is_one_error
from lipmotion import read_motion
from lipmotion.errors import InputError
from lipmotion.pipeline.outputs.motion_files import read_generation
from lipmotion.types import WEIGHT, Channel, Motion
from lipmotion_faces.characters.scene import Scene
from lipmotion_faces.outputs.scenes import write_scene
from meshes.heads import head


@pytest.fixture
def motion_file(run: RunCommand, toy_model_file: Path, toy_speech: Path, here: Path) -> Path:
    assert run("animate", toy_speech, "--model", toy_model_file, "-o", "said.json").code == 0
    return here / "said.json"


def pictures(path: Path) -> list[np.ndarray]:
    with av.open(str(path)) as video:
        return [frame.to_ndarray(format="rgb24").astype(int) for frame in video.decode(video=0)]


def test_edited_values_are_drawn(run, motion_file, toy_speech, here):
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


def test_a_glb_plays_with_its_sound_wherever_its_folder_goes(run, toy_speech, here):
    weights = Motion(np.zeros((26, 1)), 25.0, (Channel("jawOpen", WEIGHT),))
    (here / "old").mkdir()
    copy(toy_speech, here / "old" / "take #1 50%.wav")
    write_scene(here / "old" / "a.glb", Scene(head(), weights), here / "old" / "take #1 50%.wav")
    (here / "old").rename(here / "new")
    done = run("render", "new/a.glb", "-o", "a.mp4", "--size", "96", "--fps", "5")
    assert done.code == 0
    with av.open(str(here / "a.mp4")) as video:
        assert max(float(np.abs(frame.to_ndarray()).max()) for frame in video.decode(audio=0)) > 0.01
    (here / "new" / "take #1 50%.wav").unlink()
    assert "is not there; give a sound" in run("render", "new/a.glb", "-o", "b.json").err[0]


def test_sound_and_motion_of_other_lengths(run, motion_file, toy_speech, here):
    document = json.loads(motion_file.read_text())
    document["values"] = document["values"][:60]
    (here / "cut.json").write_text(json.dumps(document))
    done = run("render", "cut.json", "--sound", toy_speech, "-o", "cut.csv")
    assert done.code == 0
    assert "the motion lasts 0.59 s, the sound" in done.err[0]
    assert "the last pose stays" in done.err[0]
    assert len(read_motion(here / "cut.csv")[0].values) == pytest.approx(len(read_motion(motion_file)[0].values), abs=2)


def test_motion_of_more_than_a_day_is_refused(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lipmotion.pipeline.outputs.motion_files.LONGEST_S", 4.0)
    (here / "long.csv").write_text("time_s,opening\n0,0.1\n1,0\n2,0\n3,0\n4,0\n5,0\n")
    with pytest.raises(InputError, match="lasts 5 s, required at most 4; cut it"):
        read_generation(here / "long.csv")


def test_files_without_sound_get_no_silence(run, here, monkeypatch):
    sounds = []
    monkeypatch.setattr("lipmotion.cli.verbs.render.write_outputs", lambda *given, **_: sounds.append(given[3]))
    (here / "rig.csv").write_text("time_s,opening\n0,0\n0.1,0.1\n")
    for name in ("a.json", "a.mp4"):
        assert run("render", "rig.csv", "-o", name).code == 0
    assert sounds[0] is None
    assert len(sounds[1].samples) == 1600


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
