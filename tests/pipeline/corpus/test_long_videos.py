import json
import shutil
from collections.abc import Iterable, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import av
import numpy as np
import pytest

from lipmotion import Corpus, prepare, types
from lipmotion.errors import CorpusError
from lipmotion_faces.corpus import long_videos
from lipmotion_faces.corpus import sync as module
from lipmotion_faces.corpus.long_videos import (
    LONGEST_S,
    MARGIN_S,
    MIN_S,
    SHORTEST_S,
    SpokenPart,
    find_transcript,
    find_utterances,
    list_spoken_lines,
)
from lipmotion_faces.corpus.sync import measure_offsets, remove_offsets
from lipmotion_faces.tracking.frames import WHOLE, VideoSpan
from lipmotion_faces.tracking.track import VideoScan
from pipeline.made import features_of, read_sound, replace_tracking

RATE = 16_000
SENTENCES = [(1.0 + 4.5 * n, 4.0 + 4.5 * n) for n in range(10)]  # three seconds of sound, and a pause of 1.5 s
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

    def track(_path: Path, *, crops: bool, span: VideoSpan = WHOLE, person=(), tracker: str) -> types.Track:
        assert tracker == "mediapipe"
        count = round((min(span.end_s, DURATION_S) - span.start_s) * 25)
        told["followed"] = tuple(float(face.mean()) for face in person)
        images = np.zeros((count, 56, 72, 3), np.uint8) if crops else None
        return types.Track(
            types.Motion(np.ones((count, 1)), 25.0, (types.Channel("opening"),)), np.ones(count, bool), images
        )

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
    samples = read_sound(talk).samples
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
def test_words_come_from_the_lines_in_time(talk, tmp_path):
    lines = [f"{start_s}\t{end_s}\tSentence {n}." for n, (start_s, end_s) in enumerate(SENTENCES[:5])]
    talk.with_suffix(".txt").write_text("\n".join(lines))
    corpus = Corpus.open(prepare(talk, tmp_path / "corpus", workers=1).corpus)
    words = [corpus.utterance(name).words for name in corpus.names()]
    assert words == [("sentence", number) for number in ("zero", "one", "two", "three", "four")]


@pytest.mark.long
def test_cuts_divide_and_the_person_is_followed_and_words_without_times_are_of_no_use(talk, tmp_path, scanned, caplog):
    talk.with_suffix(".txt").write_text("all that is said")
    scanned |= {"cuts_s": (2.4,), "person": (3.0,)}
    report = prepare(talk, tmp_path / "corpus", workers=1)
    corpus = Corpus.open(report.corpus)
    assert {corpus.utterance(name).words for name in corpus.names()} == {None}
    assert "its transcript has no times" in caplog.text
    assert report.prepared[:3] == ("talk-00h00m00.68s", "talk-00h00m02.40s", "talk-00h00m05.16s")
    assert scanned["followed"] == (3.0,)


@pytest.mark.usefixtures("scanned")
def test_silence_is_refused(tmp_path):
    silent = write_talk(tmp_path / "talks" / "talk.mkv", [])
    silent.with_suffix(".txt").write_text("100.0\t101.0\tafter the end\n")
    with pytest.raises(CorpusError, match=r"the first, talk: .*talk\.mkv: no speech in it"):
        prepare(silent, tmp_path / "other", workers=1)
    assert not (tmp_path / "other").exists()


def spans(stretches: list[SpokenPart], cuts_s: Sequence[float] = (), duration_s: float = 100.0) -> list[SpokenPart]:
    return find_utterances(stretches, cuts_s, duration_s, lambda low_s, high_s: (low_s + high_s) / 2)


def edges(found: list[SpokenPart]) -> list[tuple[float, float]]:
    return [(round(part.start_s, 6), round(part.end_s, 6)) for part in found]


@pytest.mark.parametrize(
    ("said", "cuts_s", "expected"),
    [
        ([(1, 5), (8, 12)], [], [(0.7, 5.3), (7.7, 12.3)]),  # a long pause divides, and is left out
        ([(1, 3), (3.4, 6), (6.5, 9)], [], [(0.7, 9.3)]),  # short pauses do not
        ([(1, 5), (5.3, 9), (9.8, 13), (13.3, 16)], [], [(0.7, 9.3), (9.5, 16.3)]),  # too long: at the longest pause
        ([(0, 30)], [], [(0, 7.5), (7.5, 15), (15, 22.5), (22.5, 30)]),  # or where it is quietest
        ([(1, 9)], [4.0], [(0.7, 4.0), (4.0, 9.3)]),  # a cut divides even in speech
        ([(1, 4), (4.4, 8)], [4.1], [(0.7, 4.1), (4.1, 8.3)]),  # and bounds both sides in a pause
        ([(1, 9)], [4.0, 4.0 + MIN_S / 2], [(0.7, 4.0), (4.4, 9.3)]),  # what is between two may be too short
        ([(1, 2), (2.9, 6)], [], [(0.7, 6.3)]),  # short ones join a neighbour within a second
        ([(1, 2), (3.5, 6.5)], [], [(0.7, 2.3), (3.2, 6.8)]),
        ([], [], []),
    ],
)
def test_pauses_and_cuts_divide(said, cuts_s, expected):
    duration_s = 30.0 if said == [(0, 30)] else 100.0
    assert edges(spans([SpokenPart(*part) for part in said], cuts_s, duration_s)) == expected


def test_lines_keep_their_words_and_are_never_divided():
    lines = [SpokenPart(1, 7, ("one", "two")), SpokenPart(7, 15, ("three",)), SpokenPart(15.2, 17, ("four",))]
    found = spans(lines, [4.0, 10.0])
    assert [part.words for part in found] == [("one", "two"), ("three", "four")]
    assert edges(found) == [(0.7, 7.0), (7.0, 17.3)]
    found = spans([SpokenPart(1, 8, ("a",)), SpokenPart(6, 16, ("b",))])  # those that overlap end where the next begins
    assert [part.words for part in found] == [("a",), ("b",)]
    assert edges(found) == [(0.7, 6.0), (6.0, 16.3)]


def test_a_short_pause_belongs_to_both_neighbours_up_to_where_it_is_quietest():
    parts = [SpokenPart(1, 5), SpokenPart(5.3, 9), SpokenPart(9.5, 13), SpokenPart(13.3, 16)]
    for quietest_s in (9.0, 9.5):
        found = find_utterances(parts, [], 100.0, lambda *_, at_s=quietest_s: at_s)
        assert edges(found) == [(0.7, quietest_s), (quietest_s, 16.3)]


def test_any_recording():
    for seed in range(20):
        draw = np.random.default_rng(seed)
        times_s = np.cumsum(draw.choice([0.25, 0.6, 1.5, 4.0, 9.0], size=60))
        stretches = [SpokenPart(*pair) for pair in zip(times_s[::2].tolist(), times_s[1::2].tolist(), strict=True)]
        duration_s = float(times_s[-1]) + draw.uniform(0, 1)
        cuts_s = sorted(draw.uniform(0, duration_s, 8).tolist())
        found = spans(stretches, cuts_s, duration_s)
        assert all(0 <= part.start_s < part.end_s <= duration_s for part in found)
        assert all(before.end_s <= after.start_s + 1e-9 for before, after in pairwise(found))
        assert all(part.duration_s <= LONGEST_S + 2 * MARGIN_S for part in found)
        for part in found:
            assert not [t for t in cuts_s if part.start_s + 0.06 < t < part.end_s - 0.06]
        said_s = sum(part.duration_s for part in stretches)
        shared_s = [min(a.end_s, b.end_s) - max(a.start_s, b.start_s) for a in found for b in stretches]
        kept_s = sum(max(0.0, each_s) for each_s in shared_s)
        assert kept_s > said_s - MIN_S * (len(stretches) + len(cuts_s))
        assert min(SHORTEST_S, said_s) <= max(part.duration_s for part in found)


SUBTITLES = "1\n00:00:01,000 --> 00:00:02,500\nHello there.\n\n2\n00:00:04,000 --> 00:00:05,000\n- Again!\n"
WORDS = [{"word": " Hello", "start": 1.0, "end": 1.4}, {"word": " you", "start": 1.5, "end": 2.0}]
WHISPER = {"segments": [{"start": 1.0, "end": 2.0, "text": " Hello you", "words": WORDS}]}


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("talk.srt", SUBTITLES, [(1.0, 2.5, ("hello", "there")), (4.0, 5.0, ("again",))]),
        ("talk.en.vtt", "WEBVTT\n\n00:01.000 --> 00:02.500\nHello\n", [(1.0, 2.5, ("hello",))]),
        ("talk.json", json.dumps(WHISPER), [(1.0, 1.4, ("hello",)), (1.5, 2.0, ("you",))]),
        ("talk.txt", "0.5\t1.5\tHello there.\n3.0\t4.0\tAgain\n", [(0.5, 1.5, ("hello", "there")), (3, 4, ("again",))]),
        ("talk.txt", "only words, at no time", []),
    ],
)
def test_transcripts_beside_a_video(tmp_path, name, text, expected):
    (tmp_path / name).write_text(text)
    if name.endswith(".srt"):  # subtitles come before plain text
        (tmp_path / "talk.txt").write_text("hello there again")
    transcript = find_transcript(tmp_path / "talk.mp4")
    assert [(part.start_s, part.end_s, part.words) for part in list_spoken_lines(transcript)] == expected


def test_times_that_are_missing():
    hello, you = types.TimedWord("hello", 1.0, 1.4), types.TimedWord("you")
    lines = (
        types.TranscriptLine((hello, you), 1.0, None),  # lasts to the next start
        types.TranscriptLine((you,)),  # not known when
        types.TranscriptLine((you,), 3.0, 3.5),
        types.TranscriptLine((you,), 5.0, None),  # not known how long
    )
    found = list_spoken_lines(types.TimedTranscript(lines))
    first, second = ((part.start_s, part.end_s, part.words) for part in found)
    assert (first, second) == ((1.0, 3.0, ("hello", "you")), (3.0, 3.5, ("you",)))


COUNT = 4


def voice(seed: int, late_s: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return three seconds of noise that swells, late, and a lip opening at 25 Hz that follows it in time."""
    draw = np.random.default_rng(seed)
    tones = list(zip(draw.uniform(0.7, 4, 6), draw.uniform(0, 6.3, 6), strict=True))

    def swell(time_s: np.ndarray) -> np.ndarray:
        return np.exp(0.8 * sum(np.sin(2 * np.pi * hertz * time_s + phase) for hertz, phase in tones))

    time_s = np.arange(3 * RATE) / RATE
    sound = 0.01 * swell(time_s - late_s) * draw.normal(size=len(time_s))
    return sound.astype(np.float32), 0.05 * np.log1p(swell(np.arange(75) / 25))


def utterance(seed: int, late_s: float, collection: str) -> types.Utterance:
    samples, opening = voice(seed, late_s)
    audio = types.Audio(samples, RATE)
    found = types.Track(types.Motion(opening[:, None], 25.0, (types.Channel("opening"),)), np.ones(75, bool))
    source = {"collection": collection, "sha256": "0"}
    return types.Utterance(f"{collection}{seed}", audio, features_of(audio), found, ("a",), "train", source)


@pytest.fixture
def corpus(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Corpus:
    """Two collections: one in step, one whose sound is 120 ms late; loudness is all that their lips follow."""
    energy = np.zeros((11, 13))
    energy[4, 12], energy[6, 12] = -1, 1
    monkeypatch.setattr("lipmotion_faces.corpus.sound_offset._load_weights", energy.ravel)
    made = Corpus.create(tmp_path / "corpus")
    for seed in range(COUNT):
        made.add(utterance(seed, 0.0, "here"), {"recipe": "9"})
        made.add(utterance(10 + seed, 0.12, "there"), {"recipe": "9"})
    return made


def test_each_collection_has_its_own(corpus):
    found = measure_offsets(corpus)
    assert found.collections["there"].late_s - found.collections["here"].late_s == pytest.approx(0.12, abs=0.01)
    assert found.collections["there"].known
    assert [line.split(":")[0] for line in found.list_lines()] == ["here", "there"]
    assert "ms), by 4 clips together, which corpus sync removes; 4 tell alone: median +1" in found.list_lines()[1]


@pytest.mark.long
def test_sync_moves_what_is_late_once(corpus):
    before = {name: corpus.utterance(name).audio.samples.copy() for name in corpus.names()}
    late_s = measure_offsets(corpus).collections["there"].late_s
    moved = remove_offsets(corpus)
    assert moved["there"] == late_s
    again = Corpus.open(corpus.path)
    shift = round(late_s * RATE)
    for seed in range(10, 10 + COUNT):
        name = f"there{seed}"
        one = again.utterance(name)
        np.testing.assert_allclose(one.audio.samples, before[name][shift:], atol=1e-4)
        assert float(one.source["offset_removed_ms"]) == pytest.approx(1000 * late_s, abs=0.1)
        assert one.features.values.shape[0] == len(one.audio.samples) // 160 + 1
        assert json.loads((again.folder(name) / "entry.json").read_text())["settings"] == {"recipe": "9"}
    assert abs(measure_offsets(again).collections["there"].late_s) < 0.005
    assert "there" not in remove_offsets(again)
    assert module.move_sound(one, 0.02).source["offset_removed_ms"] == f"{1000 * late_s + 20:.1f}"


def test_labels_move_with_the_sound(corpus):
    bounds = [0.0, 0.4, 1.2, 3.0]
    spans = tuple(
        types.Span(a, b, types.Unit(phone)) for (a, b), phone in zip(pairwise(bounds), ("sil", "aa", "m"), strict=True)
    )
    for late_s, expected in ((0.5, [0.0, 0.7, 2.5]), (-0.5, [0.0, 1.7, 3.5])):
        moved = module.move_sound(replace(corpus.utterance("here0"), phones=types.Timeline(spans)), late_s)
        found = list(moved.phones)
        assert [found[0].start_s, found[-1].start_s, found[-1].end_s] == pytest.approx(expected)
        assert found[-1].end_s == pytest.approx(moved.audio.duration_s)


def test_lips_that_do_not_follow_are_left_alone(corpus):
    names = [name for name in corpus.names() if name.startswith("there")]
    still = [corpus.utterance(name) for name in names]
    for name, other in zip(names, [*still[1:], still[0]], strict=True):
        corpus.add(replace(corpus.utterance(name), track=other.track), {})
    assert not measure_offsets(corpus).collections["there"].known
    line = measure_offsets(corpus).list_lines()[1]
    assert line.startswith("there: not measured: 4 clips of this voice cannot tell whether the sound is late. Training")
    assert line.endswith("give corpus prepare --offset-ms")
    before = corpus.utterance(names[0]).audio.samples.copy()
    assert "there" not in remove_offsets(corpus)
    np.testing.assert_array_equal(corpus.utterance(names[0]).audio.samples, before)
