from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion_faces.tracking import track as video_scan
from lipmotion_faces.tracking.frames import VideoSpan
from lipmotion_faces.tracking.track import footage_frames, footage_groups, read_video_frames, track, track_footage
from vision.scripted import Opened, face
from vision.variants import write_frames

OPENINGS = 0.1 + 0.05 * np.sin(np.arange(20) / 3)
MOVES = np.stack([0.5 * np.arange(20), np.sin(np.arange(20) / 4), np.zeros(20)], axis=1)
FACES = [face(opening) + move for opening, move in zip(OPENINGS, MOVES, strict=True)]
JUMP_PX = 90
"""More than a face of 60 px between the eyes moves from frame to frame."""


def levels(frames) -> list[int]:
    """Which picture of the file each frame is: picture n of ``write_video`` is a flat grey of 10 n."""
    return [round(float(frame.mean()) / 10) for frame in frames]


def eyes_in_frames(footage) -> np.ndarray:
    """Where the maps put the middle between the eyes [shape=(T, 2)]."""
    return footage.face_to_image[:, :, 2]


def test_it_tracks_as_track_does(write_video, scripted):
    path = write_video(ticks=range(20))
    scripted(FACES)
    footage = track_footage(path, crops=True)
    scripted(FACES)
    expected = track(path)
    np.testing.assert_array_equal(footage.track.motion.values, expected.motion.values)
    np.testing.assert_array_equal(footage.track.crops, expected.crops)
    assert footage.track.notes == expected.notes
    assert (footage.size, footage.rate_hz, len(footage), footage.cuts) == ((48, 64), 25.0, 20, ())


def test_maps_follow_the_face(write_video, scripted):
    scripted(FACES)
    eyes = eyes_in_frames(track_footage(write_video(ticks=range(20))))
    np.testing.assert_allclose(eyes - eyes[0], (MOVES - MOVES[0])[:, :2], atol=1e-6)


def test_maps_of_frames_without_a_face_are_interpolated(write_video, scripted):
    scripted([None if n in (0, 8, 19) else one for n, one in enumerate(FACES)])
    footage = track_footage(write_video(ticks=range(20)))
    eyes = eyes_in_frames(footage)
    assert np.flatnonzero(~footage.track.seen).tolist() == [0, 8, 19]
    np.testing.assert_allclose(eyes[8] - eyes[1], (MOVES[8] - MOVES[1])[:2], atol=0.02)
    np.testing.assert_array_equal(footage.face_to_image[[0, 19]], footage.face_to_image[[1, 18]])


def test_maps_do_not_run_over_a_cut(write_video, scripted):
    rows = np.linspace(0, 255, 96).astype(np.uint8)
    picture = np.tile(rows[:, None, None], (1, 320, 3))  # the face looks the same after the jump: the same person
    ticks = [n for n in range(20) if n not in (9, 14)]
    moved = [one + (n >= 10) * np.array([JUMP_PX, 0, 0]) for n, one in enumerate(FACES)]
    asked = sorted([*ticks, 10])  # the mesh that has lost the face, and the next one
    scripted([moved[n] + (60, 30, 0) for n in asked])
    footage = track_footage(write_video(ticks=ticks, size=(320, 96), picture=picture))
    assert footage.cuts == (10,)
    eyes = eyes_in_frames(footage)[:, 0]
    np.testing.assert_allclose(eyes[9], eyes[8], atol=1e-9)
    np.testing.assert_allclose(eyes[10:] - eyes[8], JUMP_PX + MOVES[10:, 0] - MOVES[8, 0], atol=1e-6)


@pytest.mark.parametrize("dropped", [(), (6, 13), (7, 8, 9)])
def test_frames_come_in_their_constant_order(write_video, scripted, dropped):
    ticks = [n for n in range(20) if n not in dropped]
    scripted([FACES[n] for n in ticks])
    footage = track_footage(write_video(ticks=ticks))
    shown = [ticks[index] for index in levels(footage_frames(footage))]
    assert len(shown) == len(footage) == 20
    assert [shown[n] for n in ticks] == ticks
    distance = np.abs(np.array(shown) - np.arange(20))
    assert distance.max() == {(): 0, (6, 13): 1, (7, 8, 9): 2}[dropped]


def test_a_part_is_the_same_as_in_the_whole(write_video, scripted):
    ticks = [n for n in range(20) if n not in (5, 12, 13)]
    scripted([FACES[n] for n in ticks])
    footage = track_footage(write_video(ticks=ticks))
    whole = levels(footage_frames(footage))
    for start, stop in ((0, 20), (0, 1), (7, 7), (12, 17), (19, None), (3, None)):
        assert levels(footage_frames(footage, start, stop)) == whole[start:stop]
    scripted(FACES[5:15])
    footage = track_footage(write_video(ticks=range(20)), VideoSpan(0.2, 0.6))
    assert levels(footage_frames(footage, 4, 8)) == list(range(9, 13))
    for start, stop in ((-1, 5), (6, 5), (0, 11), (11, None)):
        with pytest.raises(InputError, match=rf"frames {start} to {stop or 10} of .*, required within 0 to 10"):
            footage_frames(footage, start, stop)


def test_frames_in_any_order(write_video, scripted):
    ticks = [n for n in range(20) if n not in (5, 12, 13)]
    scripted([FACES[n] for n in ticks])
    footage = track_footage(write_video(ticks=ticks))
    order = [*range(20), *range(18, -1, -1), 3, 17]
    shown = levels(footage_frames(footage))
    for most_bytes in (0, 20 * 48 * 64 * 3):
        groups = footage_groups(footage, most_bytes)
        assert levels(groups.frame(n) for n in order) == [shown[n] for n in order]
        assert groups.nbytes <= max(most_bytes, 2 * 48 * 64 * 3)


def test_a_video_that_was_exchanged_is_noticed(write_video, scripted):
    scripted(FACES)
    footage = track_footage(write_video(ticks=range(20)))
    other = write_video("other.mp4", ticks=range(20), size=(32, 32))
    with pytest.raises(InputError, match="a picture is not 64 × 48 as when it was tracked"):
        list(footage_frames(replace(footage, path=other)))


def test_a_video_that_became_shorter_shows_its_last_picture(write_video, scripted):
    scripted(FACES)
    footage = track_footage(write_video(ticks=range(20)))
    shorter = replace(footage, path=write_video("shorter.mp4", ticks=range(15)))
    assert levels(footage_frames(shorter)) == [*range(15), *([14] * 5)]
    with pytest.raises(InputError, match=r"no picture from 0\.72 s on"):
        list(footage_frames(shorter, 18))


def test_untracked_frames_hold_the_last_picture(write_video):
    """At a constant rate; where pictures were dropped, the one before is shown again."""
    for dropped in ((), (3,), (7, 8, 9), (19,)):
        ticks = [n for n in range(20) if n not in dropped]
        frames, rate_hz = read_video_frames(write_video(ticks=ticks))
        assert rate_hz == 25.0
        wanted = [sum(tick <= n for tick in ticks) - 1 for n in range(ticks[-1] + 1)]
        assert levels(frames) == wanted


class Follower(Opened):
    """Stands for the follower of faces: counts what it is shown."""

    share = 1.0
    shown: ClassVar[list[int]] = []

    def __init__(self, tracker: str) -> None:
        assert tracker == "mediapipe"
        self.shown.clear()

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
    Follower.share = 1.0


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
    found = video_scan.scan_video(scenes(tmp_path / "a.mp4", [30, 77], 260), shares.append)
    np.testing.assert_allclose(found.times_s, np.arange(260) / 25, atol=1e-6)
    np.testing.assert_allclose(found.cuts_s, [1.2, 77 / 25], atol=1e-6)
    assert found.rate_hz == 25
    assert found.end_s == pytest.approx(10.4)
    assert shares == [pytest.approx(0.96, abs=0.01)]


@pytest.mark.usefixtures("followed")
def test_faces_are_looked_for_every_two_seconds(tmp_path):
    video_scan.scan_video(write_frames(tmp_path / "a.mp4", [np.full((48, 64, 3), n, np.uint8) for n in range(120)]))
    assert Follower.shown == pytest.approx([0, 50, 100], abs=2)


@pytest.mark.usefixtures("followed")
def test_the_person_matters_only_where_there_are_others(tmp_path):
    path = scenes(tmp_path / "a.mp4", [])
    assert video_scan.scan_video(path).person == ()
    Follower.share = 0.6
    assert len(video_scan.scan_video(path).person) == 1


@pytest.mark.usefixtures("followed")
def test_a_video_that_is_cut_short_is_told(tmp_path):
    content = write_frames(tmp_path / "a.mkv", [np.full((48, 64, 3), n, np.uint8) for n in range(120)]).read_bytes()
    assert video_scan.scan_video(tmp_path / "a.mkv").damage == ()
    (tmp_path / "a.mkv").write_bytes(content[: round(0.6 * len(content))])
    assert video_scan.scan_video(tmp_path / "a.mkv").damage[-1].startswith("cut short: pictures up to ")
