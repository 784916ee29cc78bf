from pathlib import Path

import numpy as np
import pytest

from cli.conftest import here, run
from lipmotion import Request, animate, load_face
from lipmotion_faces.film.filmed_video import make_film, write_film
from lipmotion_faces.tracking.track import track
from pipeline.made import read_sound

__all__ = ["here", "run"]
pytestmark = [pytest.mark.recordings, pytest.mark.video, pytest.mark.long]
CLIPS = 6


@pytest.fixture(scope="module")
def clips(recordings: Path) -> list[Path]:
    pytest.importorskip("mediapipe")
    folder = recordings / "grid-s1"
    if not folder.is_dir():
        pytest.skip("no GRID recordings")
    return [folder / "clips" / f"{name}.mkv" for name in (folder / "order.txt").read_text().split()[: CLIPS + 1]]


@pytest.fixture(scope="module")
def some_clips(clips: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("filmed") / "someone"
    folder.mkdir()
    for clip in clips[:CLIPS]:
        (folder / clip.name).symlink_to(clip.resolve())
    return folder


@pytest.fixture(scope="module")
def built(some_clips: Path) -> Path:
    from lipmotion import build_face, save_face

    path = some_clips.parent / "someone.face"
    save_face(build_face(some_clips, workers=1), path)
    return path


def opening_in(video: Path, rate_hz: float = 25.0) -> np.ndarray:
    """Return the opening that a tracker finds, a value a frame."""
    tracked = track(video, crops=False)
    assert tracked.seen.mean() > 0.95
    return np.asarray(tracked.motion.resampled(rate_hz)["opening"])


def likeness(first: np.ndarray, second: np.ndarray) -> float:
    count = min(len(first), len(second))
    return float(np.corrcoef(first[:count], second[:count])[0, 1])


def test_what_was_built(built):
    face = load_face(built)
    assert face.about["recordings"] == CLIPS
    assert face.about["footage_s"] == pytest.approx(3.0 * CLIPS, abs=1)
    assert built.stat().st_size < 20_000_000
    assert face.background.video.size == (288, 360)
    assert (face.appearance.mouth.explained > 0.85).all()
    assert sum(take.sound.duration_s for take in face.takes) > 10


def test_tracked_motion_of_unseen_speech_is_tracked_again(built, clips, tmp_path):
    clip = clips[CLIPS]
    original = track(clip, crops=False).motion
    write_film(tmp_path / "a.mp4", make_film(load_face(built), original), read_sound(clip))
    assert likeness(opening_in(tmp_path / "a.mp4"), np.asarray(original["opening"])) > 0.85


def test_from_sound_to_video(built, clips, here, run):
    done = run("animate", clips[CLIPS], "--face", built, "-o", "a.mp4", "--mark", "visible")
    assert (done.code, done.out) == (0, ["a.mp4"]), done
    generated = animate(Request(clips[CLIPS], onto=load_face(built))).motion
    assert likeness(opening_in(here / "a.mp4"), np.asarray(generated.resampled(25.0)["opening"])) > 0.8
