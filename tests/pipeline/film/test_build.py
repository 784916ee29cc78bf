from collections.abc import Callable
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
from scipy.io import wavfile

from lipmotion import Corpus, FilmedFace, build_face, load_face, save_face
from lipmotion.errors import CorpusError, InputError
from lipmotion.speech.sound.pauses import QUIETEST_DB
from lipmotion.types import Audio, Channel, Item, Motion, Progress, Track
from lipmotion_faces.film import build
from lipmotion_faces.film import build as takes
from lipmotion_faces.film.build import MAX_FOOTAGE_S, Take, choose_takes
from lipmotion_faces.tracking.frames import WHOLE, VideoSpan
from lipmotion_faces.tracking.track import Footage
from pipeline.film.toy_footage import ToyVideo, footage_of, install, write_video, write_videos
from speech.sounds import tone, write_sound
from testing.toy import toy_sentences, toy_utterances
from testing.toy_face import toy_chin_px

MakeVideos = Callable[..., Path]


@pytest.fixture
def make_videos(tmp_path: Path) -> MakeVideos:
    """Writes videos of a second into a folder."""

    def make(*names: str, folder: str = "filmed/anna") -> Path:
        directory = tmp_path / folder
        first: Path | None = None
        for name in names:
            path = directory / f"{name}.mkv"
            path.parent.mkdir(parents=True, exist_ok=True)
            if first is None:
                first = write_sound(path, tone(16_000), 16_000, "flac", video=True)
            else:
                path.write_bytes(first.read_bytes())
        return directory

    return make


def names(found: list[takes.Take]) -> list[str]:
    return [take.name for take in found]


def test_of_a_folder_with_lists_the_training_list(make_videos):
    folder = make_videos("a", "b", "c", "d")
    (folder / "train.txt").write_text("b\nd\n")
    (folder / "test.txt").write_text("a\n")
    (folder / "val.txt").write_text("c\n")
    assert names(choose_takes(folder)) == ["b", "d"]


def test_one_of_several_people(make_videos, tmp_path):
    make_videos("a", "b", folder="filmed/anna")
    make_videos("c", folder="filmed/ben")
    folder = tmp_path / "filmed"
    found = choose_takes(folder, speaker="anna")
    assert [take.speaker for take in found] == ["anna", "anna"]
    assert {Path(take.file).stem for take in found} == {"a", "b"}
    with pytest.raises(InputError, match=r"2 speakers, a face is that of one person; name it \(--speaker\): anna, ben"):
        choose_takes(folder)
    with pytest.raises(InputError, match=r"no speaker 'cleo', a face is that of one person; name it .*: anna, ben"):
        choose_takes(folder, speaker="cleo")


def test_no_videos(tmp_path):
    with pytest.raises(InputError, match="no such"):
        choose_takes(tmp_path / "missing.mp4")
    (tmp_path / "empty").mkdir()
    with pytest.raises(CorpusError, match="no videos in it"):
        choose_takes(tmp_path / "empty")
    (tmp_path / "empty.mp4").touch()
    with pytest.raises(InputError, match="the file is empty; give a video"):
        choose_takes(tmp_path / "empty.mp4")


def prepared(folder: Path, files: list[str], speakers: tuple[str, ...] = ("",)) -> Corpus:
    """Return a corpus that says which videos it was prepared from."""
    corpus = Corpus.create(folder)
    for number, (utterance, file) in enumerate(zip(toy_utterances(max(3, len(files))), files, strict=False)):
        source = {"file": file, "licence": "CC BY 4.0", "attribution": "anna", "collection": "filmed/anna"}
        corpus.add(replace(utterance, source=source, speaker=speakers[number % len(speakers)], split="train"))
    return corpus


def test_a_corpus_with_its_videos(tmp_path, make_videos):
    folder = make_videos("a", "b", "c")
    corpus = prepared(tmp_path / "corpus", ["a.mkv", "b.mkv", "gone.mkv"])
    found = choose_takes(corpus.path, folder)
    assert names(found) == ["toy00", "toy01"]
    assert [take.file.name for take in found] == ["a.mkv", "b.mkv"]
    assert {take.collection for take in found} == {"filmed/anna"}
    assert dict(found[0].rights) == {"licence": "CC BY 4.0", "attribution": "anna"}


@pytest.mark.parametrize(
    ("durations_s", "used_s"),
    [
        ((300.0, 3.0, 3.0, 7200.0), {"00": 117.0, "01": 3.0, "02": 3.0, "03": 117.0}),  # before short ones are left out
        ((600.0,) * 48, {f"{number:02}": takes.LONG_S for number in range(1, 48, 2)}),  # in part, and evenly
    ],
)
def test_footage_of_a_folder_is_bounded(make_videos, monkeypatch, durations_s, used_s):
    monkeypatch.setattr(takes, "read_stated_duration", lambda file: durations_s[int(file.stem)])
    found = choose_takes(make_videos(*(f"{number:02}" for number in range(len(durations_s)))))
    used = {each.name: min(each.span.end_s - each.span.start_s, durations_s[int(each.name)]) for each in found}
    assert sum(used.values()) == pytest.approx(MAX_FOOTAGE_S)
    assert used == pytest.approx(used_s)


def test_videos_of_the_same_name_are_told_apart(tmp_path, make_videos):
    """Every person of GRID says the same sentences, in files of the same names."""
    make_videos("x", folder="filmed/anna")
    ben = write_sound(make_videos("y", folder="filmed/ben") / "x.mkv", tone(16_000, 0.9), 16_000, "flac", video=True)
    for file in (ben, tmp_path / "filmed/anna/x.mkv"):
        corpus = Corpus.create(tmp_path / f"corpus-{file.parent.name}")
        source = {"file": "x.mkv", "bytes": str(file.stat().st_size), "sha256": sha256(file.read_bytes()).hexdigest()}
        for utterance in toy_utterances(3)[:1]:
            corpus.add(replace(utterance, source=source, split="train"))
        (found,) = choose_takes(corpus.path, tmp_path / "filmed")
        assert found.file == file
    (tmp_path / "other").mkdir()
    other = write_sound(tmp_path / "other" / "x.mkv", tone(16_000, 0.5), 16_000, "flac", video=True)
    with pytest.raises(InputError, match="holds none of the videos"):
        choose_takes(corpus.path, other.parent)


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
        install(monkeypatch, videos | (more or {}), seen or {}, least_s)

    start()
    return start


def folder_of(videos: Videos) -> Path:
    return next(iter(videos)).parent


@pytest.fixture(scope="module")
def built(videos: Videos) -> tuple[FilmedFace, list[Event]]:
    events: list[Event] = []
    with pytest.MonkeyPatch.context() as monkeypatch:
        install(monkeypatch, videos, {}, 7.0)
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
    seconds = len(videos[video].motion.values) / 25
    message = f"{seconds:.1f} s of footage with the face, required 7 s or more, 60 s of varied speech for good pictures"
    with pytest.raises(InputError, match=message):
        build_face(video, workers=1)


@pytest.mark.long
def test_recordings_that_cannot_be_used_are_left_out(videos, tracker):
    tracker({next(iter(videos)): np.zeros(0, bool)}, least_s=5.0)
    events: list[Event] = []
    face = build_face(folder_of(videos), workers=1, monitor=events.append)
    assert face.about["recordings"] == SENTENCES - 1
    (skipped,) = (event for event in events if isinstance(event, Item))
    assert (skipped.name, skipped.outcome) == ("toy00", "skipped")
    assert "no face in 60 of 60 frames" in skipped.reason
    with pytest.raises(InputError, match=r"none of 1 recordings can be used; the first: .*no face in 60 of 60 frames"):
        build_face(folder_of(videos) / "toy00.mp4", workers=1)


@pytest.mark.long
def test_footage_without_sound(tracker, tmp_path):
    """The face is built; its jaw cannot follow the energy, and other people's motion cannot be mapped onto it."""
    video = write_video(tmp_path / "mute.mp4", toy_sentences(3)[0], silent=True)
    tracker(more={video.path.resolve(): video}, least_s=2.0)
    face = build_face(video.path, workers=1)
    assert face.takes == ()
    codes = face.appearance.predict_codes(footage_of(video).track.motion)
    level = face.appearance.with_jaw_of_sound(codes, np.full(len(codes), QUIETEST_DB))
    assert np.isfinite(level.chin_px).all()
    assert level.chin_px == pytest.approx(np.full(len(codes), toy_chin_px(video.motion).mean()), abs=1)


def test_what_is_left_of_the_seconds_may_be_less_than_a_frame(tmp_path):
    """599 of 600 frames of 29.97 a second are 19.99 s: no take of 0 frames follows, which no file could hold."""
    rate_hz, count = 30_000 / 1001, 600
    track = Track(Motion(np.zeros((count, 1)), rate_hz, (Channel("opening"),)), np.ones(count, bool))
    places, times_s = np.zeros((count, 2, 3)), np.arange(count) / rate_hz
    footage = Footage(tmp_path / "a.mp4", WHOLE, track, places, times_s, (), (288, 224), rate_hz)
    sound = Audio(np.ones(round(16_000 * count / rate_hz), np.float32), 16_000)
    take = build._Filmed(footage, np.arange(count), np.zeros((0, 128, 128, 3), np.uint8), sound)
    (kept,) = build.select_speech([take, take])
    assert len(kept.motion.values) == 599


@pytest.mark.parametrize(
    ("count", "level", "expected_s"), [(64_000, 1, 2.0), (24_000, 1, 0.5), (8000, 1, 0.0), (64_000, 0, 0.0)]
)
def test_silence_is_no_sound(tmp_path, count, level, expected_s):
    wavfile.write(tmp_path / "a.wav", 16_000, np.full(count, 32_767 * level, np.int16))
    found = build.read_take_sound(Take("a", tmp_path / "a.wav", VideoSpan(1.0, 3.0), "", "", ()))
    assert (0 if found is None else found.duration_s) == pytest.approx(expected_s)
