from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from lipmotion import FilmedFace, build_face, load_face, save_face
from lipmotion.errors import InputError
from lipmotion.speech.sound.pauses import QUIETEST_DB
from lipmotion.types import Audio, Channel, Item, Motion, Progress, Track
from lipmotion_faces.film import build
from lipmotion_faces.film.build import Take
from lipmotion_faces.tracking.footage import Footage
from lipmotion_faces.tracking.frames import WHOLE, VideoSpan
from pipeline.film.toy_footage import ToyVideo, footage_of, install, write_video, write_videos
from testing.toy import toy_sentences
from testing.toy_face import toy_chin_px

SENTENCES = 3
Videos = dict[Path, ToyVideo]
Event = Progress | Item


@pytest.fixture(scope="module")
def videos(tmp_path_factory: pytest.TempPathFactory) -> Videos:
    return write_videos(tmp_path_factory.mktemp("filmed") / "anna", SENTENCES)


@pytest.fixture
def tracker(videos: Videos, monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Installs a tracker without errors; in some videos it sees only some frames."""

    def start(seen: dict[Path, np.ndarray] | None = None, more: Videos | None = None, least_s: float = 7.0) -> None:
        monkeypatch.setattr(build, "LEAST_FOOTAGE_S", least_s)
        install(monkeypatch, videos | (more or {}), seen or {})

    start()
    return start


def folder_of(videos: Videos) -> Path:
    return next(iter(videos)).parent


@pytest.fixture(scope="module")
def built(videos: Videos) -> tuple[FilmedFace, list[Event]]:
    events: list[Event] = []
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr(build, "LEAST_FOOTAGE_S", 7.0)
        install(monkeypatch, videos, {})
        face = build_face(folder_of(videos), name="Anna", workers=1, monitor=events.append)
    return face, events


def test_what_was_built(built, videos, tmp_path):
    face, _ = built
    frames = sum(len(video.motion.values) for video in videos.values())
    assert face.about == {
        "name": "Anna", "corpus": ["/".join(folder_of(videos).parts[-2:])], "speaker": "",
        "footage_s": round(frames / 25, 1), "recordings": SENTENCES,
    }  # fmt: skip
    assert face.appearance.scale == 1
    assert set(face.appearance.from_motion.names) == {"opening", "width", "outer", "y_152"}  # no depth
    assert face.background.video.size == (288, 224)
    assert len(face.takes) == SENTENCES
    save_face(face, tmp_path / "a.face")
    assert load_face(tmp_path / "a.face").summary == face.summary


def test_motion_becomes_the_person(built):
    face, _ = built
    take = face.takes[2]
    codes = face.appearance.predict_codes(take.motion)
    mouths = face.appearance.mouth.restore(codes.mouth)
    dark = (mouths < 90).all(axis=3).sum(axis=(1, 2))
    assert np.corrcoef(dark, take.motion["opening"])[0, 1] > 0.8
    lips = Motion(take.motion.values[:, :3], 25.0, take.motion.channels[:3])
    assert codes.chin_px == pytest.approx(toy_chin_px(lips), abs=3)


def test_progress_rises_to_the_end(built):
    _, events = built
    progress = [event for event in events if isinstance(event, Progress)]
    assert len(progress) == len(events) == SENTENCES + 3
    values = [event.share for event in progress]
    assert values == sorted(values)
    assert values[-1] == pytest.approx(1.0)
    stages = list(dict.fromkeys(event.stage for event in progress))
    assert stages == ["tracking the face", "learning the face", "choosing the background"]
    assert [event.step for event in progress[:SENTENCES]] == list(range(1, SENTENCES + 1))


def test_the_speech_is_kept_with_its_motion(built):
    face, _ = built
    for take, sentence in zip(face.takes, toy_sentences(SENTENCES), strict=True):
        assert take.sound.duration_s == pytest.approx(sentence.audio.duration_s, abs=0.1)
        assert len(take.motion.values) / 25 == pytest.approx(take.sound.duration_s, abs=0.1)
        assert take.motion.names[:3] == ("opening", "width", "outer")
    assert sum(take.sound.duration_s for take in face.takes) < build.SPOKEN_TAKES_S + 1


@pytest.mark.usefixtures("tracker")
def test_short_footage_is_refused(videos):
    video = next(iter(videos))
    with pytest.raises(InputError) as caught:
        build_face(video, workers=1)
    seconds = len(videos[video].motion.values) / 25
    assert str(caught.value) == (
        f"{video}: {seconds:.1f} s of footage with the face, required 7 s or more, 60 s of varied speech for good "
        "pictures; give a longer video, or a folder of several"
    )


@pytest.mark.long
def test_what_is_not_enough_is_said(videos, tracker, caplog):
    """Frames in which the face is not seen do not count."""
    half = {path: np.arange(200) % 2 == 0 for path in list(videos)[:1]}
    tracker(half, least_s=5.0)
    face = build_face(folder_of(videos), workers=1)
    frames = sum(len(video.motion.values) for video in videos.values())
    first = len(next(iter(videos.values())).motion.values)
    assert face.about["footage_s"] == pytest.approx((frames - first / 2) / 25, abs=0.1)
    assert "s of footage with the face; with 60 s of varied speech the mouth would be truer" in caplog.text
    assert face.about["name"] == "anna"
    tracker({path: np.arange(200) % 5 == 0 for path in videos}, least_s=5.0)
    with pytest.raises(InputError, match=r"1\.\d s of footage with the face, required 5 s or more"):
        build_face(folder_of(videos), workers=1)


@pytest.mark.long
def test_recordings_that_cannot_be_used_are_left_out(videos, tracker, monkeypatch):
    def film(path: Path, *more: object) -> object:
        if path.name == "toy00.mp4":
            raise InputError(f"{path}: no face in 60 of 60 frames")
        return whole(path, *more)

    tracker(least_s=5.0)
    whole: Callable[..., Footage] = vars(build)["track_footage"]  # that of the drawn person
    monkeypatch.setattr(build, "track_footage", film)
    events: list[Event] = []
    face = build_face(folder_of(videos), workers=1, monitor=events.append)
    assert face.about["recordings"] == SENTENCES - 1
    (skipped,) = (event for event in events if isinstance(event, Item))
    assert (skipped.name, skipped.outcome) == ("toy00", "skipped")
    assert "no face in 60 of 60 frames" in skipped.reason
    with pytest.raises(InputError, match=r"none of 1 recordings can be used; the first: .*no face in 60 of 60 frames"):
        build_face(folder_of(videos) / "toy00.mp4", workers=1)


@pytest.mark.long
def test_footage_without_sound(tracker, tmp_path, monkeypatch):
    """The face is built; its jaw cannot follow the energy, and other people's motion cannot be mapped onto it."""
    monkeypatch.setattr(build, "read_sound", lambda _: None)
    video = write_video(tmp_path / "mute.mp4", toy_sentences(3)[0])
    tracker(more={video.path.resolve(): video}, least_s=2.0)
    face = build_face(video.path, workers=1)
    assert face.takes == ()
    codes = face.appearance.predict_codes(footage_of(video).track.motion)
    level = face.appearance.with_jaw_of_sound(codes, np.full(len(codes), QUIETEST_DB))
    assert np.isfinite(level.chin_px).all()
    assert level.chin_px == pytest.approx(np.full(len(codes), toy_chin_px(video.motion).mean()), abs=1)


@pytest.mark.long
def test_fast_video_is_learned_from_in_part(tracker, tmp_path):
    """Of 60 frames a second every second is enough; seconds are counted, not frames."""
    video = write_video(tmp_path / "fast.mp4", toy_sentences(3)[0], 60.0)
    tracker(more={video.path.resolve(): video}, least_s=2.0)
    face = build_face(video.path, workers=1)
    seconds = len(video.motion.values) / 60
    assert face.about["footage_s"] == pytest.approx(seconds, abs=0.1)
    assert len(face.appearance.mouths) <= round(seconds * 30) + 1
    assert face.background.video.rate_hz == pytest.approx(60.0)
    assert len(face.background.video) == len(video.motion.values)


def test_what_is_left_of_the_seconds_may_be_less_than_a_frame(tmp_path):
    """599 of 600 frames of 29.97 a second are 19.99 s: no take of 0 frames follows, which no file could hold."""
    rate_hz, count = 30_000 / 1001, 600
    channels = (Channel("opening"),)
    footage = Footage(
        tmp_path / "a.mp4",
        WHOLE,
        Track(Motion(np.zeros((count, 1)), rate_hz, channels), np.ones(count, bool)),
        np.zeros((count, 2, 3)),
        np.arange(count) / rate_hz,
        (),
        (288, 224),
        rate_hz,
    )
    sound = Audio(np.ones(round(16_000 * count / rate_hz), np.float32), 16_000)
    take = build._Filmed(footage, np.arange(count), np.zeros((0, 128, 128, 3), np.uint8), sound)
    (kept,) = build.select_speech([take, take])
    assert len(kept.motion.values) == 599


def test_silence_is_no_sound(monkeypatch, tmp_path):
    take = Take("a", tmp_path / "a.mp4", VideoSpan(1.0, 3.0), "", "", ())
    for count, level, expected_s in ((64_000, 1.0, 2.0), (24_000, 1.0, 0.5), (8000, 1.0, 0.0), (64_000, 0.0, 0.0)):
        audio = Audio(np.full(count, level, np.float32), 16_000)
        monkeypatch.setattr(build, "read_audio", lambda *_, audio=audio, **__: audio)
        found = build.read_sound(take)
        assert (0 if found is None else found.duration_s) == pytest.approx(expected_s)
