from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from lipmotion import errors, types
from lipmotion_faces.tracking import mediapipe, trackers
from lipmotion_faces.tracking.track import track
from vision.variants import Image, covered, frames_of, write_frames

pytestmark = [pytest.mark.video, pytest.mark.recordings]

MIDDLE = range(30, 40)


@pytest.fixture(scope="module")
def source(recordings: Path) -> Path:
    pytest.importorskip("mediapipe")
    return recordings / "grid-s1" / "clips" / "brwa3s.mkv"


@pytest.fixture(scope="module")
def frames(source: Path) -> list[Image]:
    return frames_of(source)


@pytest.fixture(scope="module")
def usual(source: Path) -> types.Track:
    return track(source, crops=False)


@pytest.fixture(scope="module")
def stranger(recordings: Path) -> tuple[list[Image], types.Track]:
    pytest.importorskip("mediapipe")
    path = recordings / "grid-others" / "swwp2s.mpg"
    return frames_of(path), track(path, crops=False)


@pytest.fixture(scope="module")
def mouths(frames: list[Image]) -> list[tuple[NDArray[np.float64], float]]:
    """Where the mouth is in every frame, and the distance between the eyes."""
    column = {index: n for n, index in enumerate(trackers.TRACKED_POINTS)}
    with mediapipe.FaceMesh() as mesh:
        faces = [mesh.find_faces(image)[0] for image in frames]
    right, left = (column[index] for index in trackers.EYE_CORNERS)
    return [(face[column[13], :2], float(np.linalg.norm(face[right, :2] - face[left, :2]))) for face in faces]


def alike(found: types.Track, usual: types.Track, at: NDArray[np.intp] | slice = slice(None)) -> float:
    """Return the correlation of the two openings, at frames of the usual one that are seen in the other."""
    time_s = usual.motion.time_s[at]
    opening = np.interp(time_s, found.motion.time_s, found.motion["opening"])
    seen = np.interp(time_s, found.motion.time_s, found.seen.astype(float)) > 0.99
    return float(np.corrcoef(opening[seen], usual.motion["opening"][at][seen])[0, 1])


def unseen(found: types.Track) -> list[int]:
    return np.flatnonzero(~found.seen).tolist()


@pytest.mark.long
def test_something_before_the_mouth(
    tmp_path: Path, frames: list[Image], usual: types.Track, mouths: list[tuple[NDArray[np.float64], float]]
) -> None:
    hidden = range(30, 45)
    shown = [
        covered(frame, place, 0.45 * unit) if n in hidden else frame
        for n, (frame, (place, unit)) in enumerate(zip(frames, mouths, strict=True))
    ]
    found = track(write_frames(tmp_path / "a.mp4", shown), crops=False)
    assert unseen(found) == list(hidden)
    assert alike(found, usual) > 0.99
    assert any("15 frames" in note for note in found.notes)


def test_somebody_else_between(
    tmp_path: Path, frames: list[Image], usual: types.Track, stranger: tuple[list[Image], types.Track]
) -> None:
    shown = [stranger[0][n] if n in MIDDLE else frame for n, frame in enumerate(frames)]
    found = track(write_frames(tmp_path / "a.mp4", shown), crops=False)
    assert unseen(found) == list(MIDDLE)
    assert alike(found, usual) > 0.99
    assert found.notes[:2] == ("cut at 1.20 s", "cut at 1.60 s")


def test_damage_is_told(tmp_path: Path, frames: list[Image], usual: types.Track) -> None:
    content = write_frames(tmp_path / "a.mkv", frames).read_bytes()
    (tmp_path / "a.mkv").write_bytes(content[: round(0.7 * len(content))])
    found = track(tmp_path / "a.mkv", crops=False)
    assert found.notes[0].startswith("cut short: pictures up to ")
    assert alike(found, usual, slice(len(found.seen) - 4)) > 0.99
    (tmp_path / "a.mkv").write_bytes(content[: round(0.3 * len(content))])
    with pytest.raises(errors.InputError, match=r"pictures for 0\.\d of 3\.0 s; required at least half"):
        track(tmp_path / "a.mkv", crops=False)


def test_a_clip_of_the_corpus_with_ruined_pictures(recordings: Path) -> None:
    """Grey pictures of the decoder's before the first whole one, some of which look like a face."""
    pytest.importorskip("mediapipe")
    found = track(recordings / "grid-s1" / "clips" / "bwwuzn.mkv", crops=False)
    assert unseen(found) == list(range(12))
    assert found.notes[0] == "cut at 0.48 s"
