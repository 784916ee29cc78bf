import shutil
from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from lipmotion import Corpus, prepare
from lipmotion.errors import CorpusError
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.types import Channel, Motion, Progress, Track
from lipmotion_faces.corpus import long_videos
from lipmotion_faces.tracking.frames import WHOLE, VideoSpan
from lipmotion_faces.tracking.track import track
from lipmotion_faces.tracking.video_scan import VideoScan
from pipeline.made import replace_tracking

RATE = 16_000
SENTENCES = [(1.0 + 4.5 * n, 4.0 + 4.5 * n) for n in range(10)]
"""Three seconds of sound, and a pause of 1.5 s."""
DURATION_S = 46.0


def write_video(path: Path, images: Iterable, size: tuple[int, int], samples: np.ndarray, **how) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    with av.open(str(path), "w") as container:
        pictures = container.add_stream("libx264", rate=25, options=how)
        pictures.width, pictures.height, pictures.pix_fmt = *size, "yuv420p"
        sound = container.add_stream("flac", rate=RATE)
        sound.layout = "mono"
        for n, image in enumerate(images):
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="rgb24")
            frame.pts, frame.time_base = n, Fraction(1, 25)
            container.mux(pictures.encode(frame))
        whole = np.round(samples * 32767).astype(np.int16)
        for at in range(0, len(whole), 4096):
            block = av.AudioFrame.from_ndarray(whole[None, at : at + 4096], format="s16", layout="mono")
            block.sample_rate, block.pts, block.time_base = RATE, at, Fraction(1, RATE)
            container.mux(sound.encode(block))
        container.mux(pictures.encode())
        container.mux(sound.encode())
    return path


def write_talk(path: Path, sentences: list[tuple[float, float]] | None = None) -> Path:
    """Write a video with bursts of noise for sentences, in pictures of one grey."""
    draw = np.random.default_rng(0)
    samples = 1e-3 * draw.normal(size=round(DURATION_S * RATE))
    for start_s, end_s in SENTENCES if sentences is None else sentences:
        part = slice(round(start_s * RATE), round(end_s * RATE))
        samples[part] += 0.1 * draw.normal(size=len(samples[part]))
    grey = (np.full((48, 64, 3), 90, np.uint8) for _ in range(round(DURATION_S * 25)))
    return write_video(path, grey, (64, 48), samples, g="50")


@pytest.fixture(scope="module")
def talk_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_talk(tmp_path_factory.mktemp("talk") / "talk.mkv")


@pytest.fixture
def talk(talk_file: Path, tmp_path: Path) -> Path:
    """A folder with one long video."""
    (tmp_path / "talks").mkdir()
    return Path(shutil.copy(talk_file, tmp_path / "talks" / "talk.mkv"))


@pytest.fixture
def scanned(monkeypatch) -> dict[str, tuple[float, ...]]:
    """Replaces the tracker and the scan of the pictures; the cuts and the face to be found may be set."""
    told: dict[str, tuple[float, ...]] = {"cuts_s": (), "person": ()}

    def scan(_path: Path, reached, tracker: str) -> VideoScan:
        assert tracker == "mediapipe"
        reached(0.5)
        person = tuple(np.full((24, 36, 3), value) for value in told["person"])
        return VideoScan(np.arange(round(DURATION_S * 25)) / 25, np.array(told["cuts_s"]), 25.0, person)

    def track(_path: Path, *, crops: bool, span: VideoSpan = WHOLE, person=(), tracker: str) -> Track:
        assert tracker == "mediapipe"
        count = round((min(span.end_s, DURATION_S) - span.start_s) * 25)
        told["followed"] = tuple(float(face.mean()) for face in person)
        images = np.zeros((count, 56, 72, 3), np.uint8) if crops else None
        return Track(Motion(np.ones((count, 1)), 25.0, (Channel("opening"),)), np.ones(count, bool), images)

    monkeypatch.setattr(long_videos, "scan_video", scan)
    replace_tracking(monkeypatch, track)
    return told


@pytest.mark.usefixtures("scanned")
def test_a_long_video_is_divided_at_its_pauses(talk, tmp_path):
    report = prepare(talk.parent, tmp_path / "corpus", workers=1)
    assert len(report.prepared) == len(SENTENCES)
    assert report.prepared[0] == "talk-00h00m00.68s"
    assert report.kind.endswith(", divided into utterances")
    corpus = Corpus.open(tmp_path / "corpus")
    samples = read_audio(talk).samples
    for name, (start_s, end_s) in zip(report.prepared, SENTENCES, strict=True):
        found = corpus.utterance(name)
        first_s, last_s = float(found.source["start_s"]), float(found.source["end_s"])
        assert (first_s, last_s) == pytest.approx((start_s - 0.3, end_s + 0.3), abs=0.06)
        assert first_s * 25 == pytest.approx(round(first_s * 25), abs=1e-6)  # at a picture
        first = round(first_s * RATE)
        np.testing.assert_allclose(found.audio.samples, samples[first : first + len(found.audio.samples)], atol=1e-4)
        assert found.audio.duration_s == pytest.approx(last_s - first_s, abs=1e-3)
        assert len(found.track.seen) == round((last_s - first_s) * 25)
        assert found.words is None
        assert found.source["file"] == "talk.mkv"
    assert [corpus.utterance(name).split for name in report.prepared] == ["train"] * 8 + ["val", "test"]


@pytest.mark.usefixtures("scanned")
def test_it_is_kept_when_it_is_prepared_again(talk, tmp_path):
    prepare(talk, tmp_path / "corpus", workers=1)
    again = prepare(talk, tmp_path / "corpus", workers=1)
    assert again.counts == {"prepared": 0, "kept": 10, "skipped": 0}


@pytest.mark.usefixtures("scanned")
def test_words_come_from_the_lines_in_time(talk, tmp_path):
    lines = [f"{start_s}\t{end_s}\tSentence {n}." for n, (start_s, end_s) in enumerate(SENTENCES[:5])]
    talk.with_suffix(".txt").write_text("\n".join(lines))
    corpus = Corpus.open(prepare(talk, tmp_path / "corpus", workers=1).corpus)
    words = [corpus.utterance(name).words for name in corpus.names()]
    assert words == [("sentence", number) for number in ("zero", "one", "two", "three", "four")]


@pytest.mark.usefixtures("scanned")
def test_words_without_times_are_told_to_be_of_no_use(talk, tmp_path, caplog):
    talk.with_suffix(".txt").write_text("all that is said")
    corpus = Corpus.open(prepare(talk, tmp_path / "corpus", workers=1).corpus)
    assert {corpus.utterance(name).words for name in corpus.names()} == {None}
    assert "its transcript has no times" in caplog.text


def test_cuts_divide_and_the_person_is_followed(talk, tmp_path, scanned):
    scanned |= {"cuts_s": (2.4,), "person": (3.0,)}
    report = prepare(talk, tmp_path / "corpus", workers=1)
    assert report.prepared[:3] == ("talk-00h00m00.68s", "talk-00h00m02.40s", "talk-00h00m05.16s")
    assert scanned["followed"] == (3.0,)


@pytest.mark.usefixtures("scanned")
def test_lists_and_other_recordings_decide_the_splits(talk, talk_file, tmp_path):
    (talk.parent / "test.txt").write_text("talk\n")
    corpus = Corpus.open(prepare(talk.parent, tmp_path / "listed", workers=1).corpus)
    assert {corpus.utterance(name).split for name in corpus.names()} == {"test"}
    (talk.parent / "test.txt").unlink()
    shutil.copy(talk_file, talk.parent / "second.mkv")
    corpus = Corpus.open(prepare(talk.parent, tmp_path / "two", workers=1).corpus)
    assert len(corpus) == 20
    assert {corpus.utterance(name).split for name in corpus.names()} == {"train"}


@pytest.mark.usefixtures("scanned")
def test_silence_is_refused(tmp_path):
    silent = write_talk(tmp_path / "talks" / "talk.mkv", [])
    silent.with_suffix(".txt").write_text("100.0\t101.0\tafter the end\n")
    with pytest.raises(CorpusError, match=r"the first, talk: .*talk\.mkv: no speech in it"):
        prepare(silent, tmp_path / "other", workers=1)
    assert not (tmp_path / "other").exists()


@pytest.mark.usefixtures("scanned")
def test_progress_is_reported(talk, tmp_path):
    seen: list[Progress] = []
    prepare(
        talk, tmp_path / "corpus", workers=1, monitor=lambda event: isinstance(event, Progress) and seen.append(event)
    )
    assert [event.stage for event in seen[:3]] == ["dividing long videos"] * 2 + ["preparing recordings"]
    shares = [event.share for event in seen]
    assert shares == sorted(shares)
    assert (shares[0], shares[-1]) == pytest.approx((0.0, 1.0))


def test_a_short_video_is_one_utterance(monkeypatch, tmp_path, talk, scanned):
    del scanned
    monkeypatch.setattr(long_videos, "LONG_S", 100.0)
    report = prepare(talk, tmp_path / "corpus", workers=1)
    assert report.prepared == ("talk",)
    assert report.kind == "one video"


@pytest.mark.video
@pytest.mark.recordings
def test_clips_one_after_the_other(recordings, tmp_path):
    """Eleven sentences of one speaker and one of another in one file: the other is left out, motion is as it was."""
    pytest.importorskip("mediapipe")
    names = (recordings / "grid-s1" / "val.txt").read_text().split()[:11]
    clips = [recordings / "grid-s1" / "clips" / f"{name}.mkv" for name in names]
    clips.insert(5, sorted((recordings / "grid-others").glob("*.mpg"))[0])
    clips.insert(6, clips[5])
    joined(clips, tmp_path / "talk.mkv")
    report = prepare(tmp_path / "talk.mkv", tmp_path / "corpus", workers=1, crops=False)
    corpus = Corpus.open(report.corpus)
    usual = [track(clip, crops=False).motion["opening"] for clip in clips]
    likenesses = []
    for name in report.prepared:
        found = corpus.utterance(name)
        start = round(float(found.source["start_s"]) * 25)
        clip, first = divmod(start, 75)
        count = min(len(found.track.seen), 75 - first)
        assert clip not in (5, 6)
        likenesses.append(np.corrcoef(found.track.motion["opening"][:count], usual[clip][first : first + count])[0, 1])
    assert len(likenesses) >= 8
    assert min(likenesses) > 0.97
    assert [name for name in report.failed if "another face" in report.failed[name]]


def joined(clips: list[Path], path: Path) -> None:
    """Write clips of 75 frames one after the other, with their sound."""
    from vision.variants import frames_of

    images, samples = [], np.zeros(3 * RATE * len(clips))
    for number, clip in enumerate(clips):
        frames, sound = frames_of(clip)[:75], read_audio(clip).samples[: 3 * RATE]
        images += frames + frames[-1:] * (75 - len(frames))
        samples[3 * RATE * number :][: len(sound)] = sound
    write_video(path, images, (360, 288), samples, crf="8")
