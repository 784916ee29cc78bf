from pathlib import Path

import av
import pytest

from cli.conftest import check_refused
from lipmotion import load_face
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


def comment(path: Path) -> str:
    with av.open(str(path)) as container:
        return str(container.metadata.get("comment", ""))


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
def test_speak(run, here, toy_model_file, filmed_face_file, monkeypatch):
    stand_in_voice.install(monkeypatch)
    line = ("speak", "mama", "--model", toy_model_file, "--face", filmed_face_file)
    assert run(*line, "-o", "a.mp4")[:2] == (0, ["a.mp4"])
    assert comment(here / "a.mp4").startswith("synthetic:")
    check_refused(run(*line, "-o", "b.mp4", "--overlay", "inset"), 3, "an overlay shows the video of the speech")
    assert [path.name for path in here.iterdir()] == ["a.mp4"]
