from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion_faces.tracking import video_scan
from lipmotion_faces.tracking.video_scan import scan_video
from vision.variants import write_frames


class Follower:
    """Stands for the follower of faces: counts what it is shown."""

    share = 1.0
    last: Follower

    def __init__(self, tracker: str) -> None:
        assert tracker == "mediapipe"
        self.shown: list[int] = []

    def __enter__(self) -> Follower:
        Follower.last = self
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def points(self, image: np.ndarray) -> None:
        self.shown.append(int(image.mean()))

    def share_of_person(self) -> float:
        return Follower.share

    def thumbnails(self) -> list[np.ndarray]:
        return [np.ones((24, 36, 3))]


@pytest.fixture
def followed(monkeypatch):
    pytest.importorskip("cv2")
    monkeypatch.setattr(video_scan, "FaceFollower", Follower)
    monkeypatch.setattr(Follower, "share", 1.0)


def scenes(path: Path, cuts: list[int], count: int = 120) -> Path:
    """Write a video of patterns that change at some frames."""
    draw = np.random.default_rng(0)
    pictures, picture = [], None
    for n in range(count):
        if picture is None or n in cuts:
            picture = np.kron(draw.integers(0, 255, (6, 8, 3)), np.ones((16, 16, 1))).astype(np.uint8)
        pictures.append(np.clip(picture.astype(int) + n % 3, 0, 255).astype(np.uint8))
    return write_frames(path, pictures)


@pytest.mark.usefixtures("followed")
def test_times_and_cuts(tmp_path):
    shares: list[float] = []
    found = scan_video(scenes(tmp_path / "a.mp4", [30, 77], 260), shares.append)
    np.testing.assert_allclose(found.times_s, np.arange(260) / 25, atol=1e-6)
    np.testing.assert_allclose(found.cuts_s, [1.2, 77 / 25], atol=1e-6)
    assert found.rate_hz == 25
    assert found.end_s == pytest.approx(10.4)
    assert shares == [pytest.approx(0.96, abs=0.01)]


@pytest.mark.usefixtures("followed")
def test_faces_are_looked_for_every_two_seconds(tmp_path):
    scan_video(write_frames(tmp_path / "a.mp4", [np.full((48, 64, 3), n, np.uint8) for n in range(120)]))
    assert Follower.last.shown == pytest.approx([0, 50, 100], abs=2)


@pytest.mark.usefixtures("followed")
def test_the_person_matters_only_where_there_are_others(tmp_path, monkeypatch):
    path = scenes(tmp_path / "a.mp4", [])
    assert scan_video(path).person == ()
    monkeypatch.setattr(Follower, "share", 0.6)
    assert len(scan_video(path).person) == 1


@pytest.mark.usefixtures("followed")
def test_wrong_time_stamps_are_refused(write_video):
    with pytest.raises(InputError, match=r"0\.025 pictures a second, required 1 to 1000"):
        scan_video(write_video(ticks=range(0, 20_000, 1000)))


@pytest.mark.usefixtures("followed")
def test_a_video_that_is_cut_short_is_told(tmp_path):
    content = write_frames(tmp_path / "a.mkv", [np.full((48, 64, 3), n, np.uint8) for n in range(120)]).read_bytes()
    assert scan_video(tmp_path / "a.mkv").damage == ()
    (tmp_path / "a.mkv").write_bytes(content[: round(0.6 * len(content))])
    assert scan_video(tmp_path / "a.mkv").damage[-1].startswith("cut short: pictures up to ")
