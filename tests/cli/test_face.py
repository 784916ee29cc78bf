from dataclasses import replace
from pathlib import Path

import av
import numpy as np
import pytest

from cli.conftest import check_refused
from lipmotion import load_face, save_face
from pipeline.film.toy_footage import ToyVideo, install, write_videos
from speech import stand_in_voice

SENTENCES = 3


@pytest.fixture(scope="module")
def videos(tmp_path_factory: pytest.TempPathFactory) -> dict[Path, ToyVideo]:
    return write_videos(tmp_path_factory.mktemp("filmed") / "anna", SENTENCES)


@pytest.fixture
def tracker(videos: dict[Path, ToyVideo], monkeypatch: pytest.MonkeyPatch) -> Path:
    """Installs a tracker without errors; returns the folder of the videos."""
    install(monkeypatch, videos, {}, 5.0)
    return next(iter(videos)).parent


@pytest.fixture
def basics(toy_speech: Path, toy_model_file: Path, filmed_face_file: Path) -> tuple[object, ...]:
    return ("animate", toy_speech, "--model", toy_model_file, "--recogniser", "own", "--face", filmed_face_file)


def comment(path: Path) -> str:
    with av.open(str(path)) as container:
        return str(container.metadata.get("comment", ""))


def decoded(path: Path) -> np.ndarray:
    with av.open(str(path)) as container:
        return np.stack([frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)])


@pytest.mark.long
def test_build_and_info(run, tracker, here):
    done = run("face", "build", tracker, "-o", "anna.face", "--name", "Anna", "--workers", "1")
    assert done.code == 0, done
    lines = {line.split()[0]: line[12:].strip() for line in done.out}
    assert (lines["name"], lines["recordings"], lines["file"]) == ("Anna", str(SENTENCES), "anna.face")
    (warning,) = done.err
    assert warning.endswith("s of footage with the face; with 60 s of varied speech the mouth would be truer")
    assert [path.name for path in here.iterdir()] == ["anna.face"]
    info = run("face", "info", "anna.face")
    assert info == (0, done.out[:-1], [])
    assert load_face("anna.face").about["name"] == "Anna"


def test_info(run, filmed_face_file):
    done = run("face", "info", filmed_face_file)
    assert (done.code, done.err) == (0, [])
    assert done.out[0] == "name         toy"
    assert "background   2.0 s of 224 × 288 px at 25 frames a second" in done.out


@pytest.mark.long
@pytest.mark.usefixtures("here")
def test_frames_a_second_and_the_mark(run, basics):
    assert run(*basics, "-o", "a.mp4", "--fps", "10", "--mark", "none").code == 0
    assert run(*basics, "-o", "b.mp4", "--fps", "10", "--mark", "visible", "--jaw", "energy").code == 0
    assert [comment(Path(name))[:9] for name in ("a.mp4", "b.mp4")] == ["", "synthetic"]
    first, second = (decoded(Path(name)).astype(int) for name in ("a.mp4", "b.mp4"))
    assert first.shape == second.shape
    assert np.abs(first - second)[:, -40:].max() > 60


@pytest.mark.long
@pytest.mark.usefixtures("here")
def test_another_background(run, basics, tracker, videos):
    path = tracker / "toy01.mp4"
    done = run(*basics, "-o", "a.mp4", "--background", path)
    assert done == (0, ["a.mp4"], [])
    shown, footage = decoded(Path("a.mp4")), decoded(path)
    count = min(len(shown), len(footage))
    away = np.abs(shown[:count].astype(int) - footage[:count])[:, :100]
    assert away.mean() < 2
    assert len(videos[path.resolve()].motion.values) == len(footage)


@pytest.mark.long
@pytest.mark.parametrize("overlay", ["inset", "mouth"])
def test_an_aid_to_lip_reading(run, basics, tracker, here, overlay):
    """On the video of the speech itself."""
    video = tracker / "toy01.mp4"
    done = run(basics[0], video, *basics[2:], "-o", "a.mp4", "--overlay", overlay)
    assert done == (0, ["a.mp4"], [])
    shown, footage = decoded(here / "a.mp4").astype(int), decoded(video).astype(int)
    assert abs(len(shown) - len(footage)) <= 1
    count = min(len(shown), len(footage))
    changed = (np.abs(shown[:count] - footage[:count]) > 40).any(axis=(0, 3))
    rows, columns = np.nonzero(changed)
    if overlay == "inset":
        assert rows.min() > 288 * 0.55
        assert columns.min() > 224 * 0.6
    else:
        assert 130 < rows.min() < rows.max() < 250
        assert changed.mean() < 0.15


@pytest.mark.long
def test_speak(run, here, toy_model_file, filmed_face_file, monkeypatch):
    stand_in_voice.install(monkeypatch)
    line = ("speak", "mama", "--model", toy_model_file, "--face", filmed_face_file)
    assert run(*line, "-o", "a.mp4")[:2] == (0, ["a.mp4"])
    assert comment(here / "a.mp4").startswith("synthetic:")
    check_refused(run(*line, "-o", "b.mp4", "--overlay", "inset"), 3, "an overlay shows the video of the speech")
    assert [path.name for path in here.iterdir()] == ["a.mp4"]


@pytest.mark.long
def test_a_face_of_another_person(run, basics, here, filmed_face):
    """The motion is mapped onto that person by the speech in the file."""
    about = {**filmed_face.about, "corpus": ["someone/else"]}
    save_face(replace(filmed_face, about=about), here / "else.face")
    assert run(*basics[:-1], "else.face", "-o", "a.mp4") == (0, ["a.mp4"], [])
    save_face(replace(filmed_face, about=about, takes=()), here / "mute.face")
    done = run(*basics[:-1], "mute.face", "-o", "b.mp4")
    assert (done.code, done.out) == (0, ["b.mp4"])
    assert "the face was built from footage without sound" in done.err[0]
