from __future__ import annotations

import os
import sys

import pytest

from children import run_child
from lipmotion.errors import MissingDependencyError
from lipmotion.extensions import install_command
from lipmotion_faces.tracking.mediapipe import FaceMesh, quiet_stderr
from lipmotion_faces.tracking.packages import import_face_mesh, import_opencv
from lipmotion_faces.tracking.trackers import tracker_named


def test_missing_packages_are_named_with_the_way_to_install_them(monkeypatch):
    monkeypatch.setitem(sys.modules, "cv2", None)
    monkeypatch.setitem(sys.modules, "mediapipe.python.solutions", None)
    for load, package in ((import_opencv, "OpenCV"), (import_face_mesh, "MediaPipe")):
        with pytest.raises(MissingDependencyError, match=package) as caught:
            load()
        assert install_command("video") in str(caught.value)
        assert "Python < 3.13" in str(caught.value)
    with pytest.raises(MissingDependencyError, match="MediaPipe"):
        FaceMesh()


def test_versions_need_the_packages(monkeypatch):
    from importlib import metadata

    def missing(name: str) -> str:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "version", missing)
    with pytest.raises(MissingDependencyError, match="mediapipe"):
        tracker_named().versions()


def test_native_messages_are_dropped_only_inside(capfd):
    with quiet_stderr():
        os.write(2, b"noise")
    os.write(2, b"news")
    assert capfd.readouterr().err == "news"


def test_importing_needs_no_video_packages():
    code = (
        "import sys; sys.modules['cv2'] = sys.modules['mediapipe'] = None; "
        "import lipmotion_faces.tracking.track, lipmotion.corpora.store, lipmotion_faces.corpus.prepare"
    )
    run_child([sys.executable, "-c", code], check=True)
