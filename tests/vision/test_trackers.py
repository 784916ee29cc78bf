import os
import sys
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

from children import run_child
from lipmotion import errors, extensions, prepare
from lipmotion_faces.tracking import mediapipe, packages, trackers
from lipmotion_faces.tracking.track import track
from vision.scripted import Opened, StandIn


class BrightestFace(Opened):
    """Finds a face around the brightest place of a picture."""

    def __init__(self, most: int) -> None:
        assert most in (1, 4)

    def find_faces(self, image: np.ndarray) -> list[np.ndarray]:
        y, x = (int(place) for place in np.unravel_index(int(image[..., 0].argmax()), image.shape[:2]))
        points = np.random.default_rng(0).uniform(-30, 30, (len(trackers.TRACKED_POINTS), 3)) + np.array([x, y, 0])
        for side, corner in zip((-20, 20), trackers.EYE_CORNERS, strict=True):
            points[trackers.TRACKED_POINTS.index(corner)] = x + side, y, 0
        return [points]


class Brightest(StandIn):
    mesh = BrightestFace


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    points = {"brightest": f"{__name__}:Brightest", "wrong": "json:dumps"}
    entries = {name: metadata.EntryPoint(name, value, trackers.TRACKERS.group) for name, value in points.items()}
    monkeypatch.setitem(trackers.TRACKERS.__dict__, "_installed", entries)


@pytest.mark.usefixtures("installed")
def test_a_tracker_is_chosen_by_name() -> None:
    assert isinstance(trackers.make_tracker(), mediapipe.MediaPipe)
    assert isinstance(trackers.make_tracker().open_box_finder(), mediapipe.FaceFinder)
    assert type(trackers.make_tracker("brightest")).__name__ == "Brightest"
    assert trackers.TRACKERS.group in extensions.GROUPS
    with pytest.raises(errors.InputError, match="no tracker 'other'; there are: mediapipe, brightest, wrong"):
        trackers.make_tracker("other")
    with pytest.raises(errors.InputError, match="required a class of LandmarkTracker"):
        trackers.make_tracker("wrong")


@pytest.mark.usefixtures("installed")
def test_an_installed_tracker_finds_the_face_of_a_video(write_video, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("cv2")
    monkeypatch.setitem(sys.modules, "mediapipe.python.solutions", None)
    found = track(write_video(ticks=range(20)), crops=False, tracker="brightest")
    assert found.seen.all()
    assert found.motion.values.shape[0] == 20


def test_a_name_that_is_none_is_refused_before_the_work(write_video, tmp_path: Path) -> None:
    path = write_video(ticks=range(20))
    with pytest.raises(errors.InputError, match="no tracker 'other'"):
        track(path, tracker="other")
    with pytest.raises(errors.InputError, match="no tracker 'other'; there are: mediapipe"):
        prepare(path, tmp_path / "corpus", tracker="other")
    assert not (tmp_path / "corpus").exists()


def test_missing_packages_are_named_with_the_way_to_install_them(monkeypatch):
    monkeypatch.setitem(sys.modules, "cv2", None)
    monkeypatch.setitem(sys.modules, "mediapipe.python.solutions", None)
    for load, package in ((packages.import_opencv, "OpenCV"), (mediapipe.FaceMesh, "MediaPipe")):
        with pytest.raises(errors.MissingDependencyError, match=package) as caught:
            load()
        assert extensions.install_command("video") in str(caught.value)
        assert "Python < 3.13" in str(caught.value)


def test_native_messages_are_dropped_only_inside(capfd):
    with mediapipe.quiet_stderr():
        os.write(2, b"noise")
    os.write(2, b"news")
    assert capfd.readouterr().err == "news"


def test_importing_needs_no_video_packages():
    code = (
        "import sys; sys.modules['cv2'] = sys.modules['mediapipe'] = None; "
        "import lipmotion_faces.tracking.track, lipmotion.corpora, lipmotion_faces.corpus.prepare"
    )
    run_child([sys.executable, "-c", code], check=True)
