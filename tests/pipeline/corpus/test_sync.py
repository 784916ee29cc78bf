import json
import shutil
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from lipmotion import Corpus
from lipmotion.measures.curves import best_offset
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.types import Audio, Channel, Motion, Span, Timeline, Track, Unit, Utterance
from lipmotion_faces.corpus import sync as module
from lipmotion_faces.corpus.sync import clip_scores, offsets, sync
from lipmotion_faces.tracking.track import track
from pipeline.made import features_of

RATE_HZ = 16_000
COUNT = 4


def voice(seed: int, late_s: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return three seconds of noise that swells, late, and a lip opening at 25 Hz that follows it in time."""
    draw = np.random.default_rng(seed)
    tones = list(zip(draw.uniform(0.7, 4, 6), draw.uniform(0, 6.3, 6), strict=True))

    def swell(time_s: np.ndarray) -> np.ndarray:
        return np.exp(0.8 * sum(np.sin(2 * np.pi * hertz * time_s + phase) for hertz, phase in tones))

    time_s = np.arange(3 * RATE_HZ) / RATE_HZ
    sound = 0.01 * swell(time_s - late_s) * draw.normal(size=len(time_s))
    return sound.astype(np.float32), 0.05 * np.log1p(swell(np.arange(75) / 25))


def utterance(seed: int, late_s: float, collection: str) -> Utterance:
    samples, opening = voice(seed, late_s)
    audio = Audio(samples, RATE_HZ)
    found = Track(Motion(opening[:, None], 25.0, (Channel("opening"),)), np.ones(75, bool))
    return Utterance(
        f"{collection}{seed}",
        audio,
        features_of(audio),
        found,
        ("a",),
        "train",
        {"collection": collection, "sha256": "0"},
    )


@pytest.fixture
def corpus(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Corpus:
    """Two collections: one in step, one whose sound is 120 ms late; loudness is all that their lips follow."""
    energy = np.zeros((11, 13))
    energy[4, 12], energy[6, 12] = -1, 1
    monkeypatch.setattr("lipmotion_faces.corpus.sound_offset._weights", energy.ravel)
    made = Corpus.create(tmp_path / "corpus")
    for seed in range(COUNT):
        made.add(utterance(seed, 0.0, "here"), {"recipe": "9"})
        made.add(utterance(10 + seed, 0.12, "there"), {"recipe": "9"})
    return made


def test_each_collection_has_its_own(corpus):
    found = offsets(corpus)
    assert set(found.clips) == set(corpus.names())
    assert found.collections["there"].late_s - found.collections["here"].late_s == pytest.approx(0.12, abs=0.01)
    assert found.collections["there"].known
    assert [line.split(":")[0] for line in found.lines()] == ["here", "there"]
    assert "ms), by 4 clips together, which corpus sync removes; 4 tell alone: median +1" in found.lines()[1]


def test_sync_moves_what_is_late_once(corpus):
    before = {name: corpus.utterance(name).audio.samples.copy() for name in corpus.names()}
    late_s = offsets(corpus).collections["there"].late_s
    moved = sync(corpus)
    assert moved["there"] == late_s
    again = Corpus.open(corpus.path)
    shift = round(late_s * RATE_HZ)
    for seed in range(10, 10 + COUNT):
        name = f"there{seed}"
        one = again.utterance(name)
        np.testing.assert_allclose(one.audio.samples, before[name][shift:], atol=1e-4)
        assert float(one.source["offset_removed_ms"]) == pytest.approx(1000 * late_s, abs=0.1)
        assert one.features.values.shape[0] == len(one.audio.samples) // 160 + 1
        assert json.loads((again.folder(name) / "entry.json").read_text())["settings"] == {"recipe": "9"}
    assert abs(offsets(again).collections["there"].late_s) < 0.005
    assert "there" not in sync(again)
    assert module.move_sound(one, 0.02).source["offset_removed_ms"] == f"{1000 * late_s + 20:.1f}"


def test_early_sound_gets_a_beginning(corpus):
    late = corpus.utterance("here0")
    moved = module.move_sound(late, -0.1)
    assert moved.audio.duration_s == pytest.approx(late.audio.duration_s + 0.1)
    np.testing.assert_array_equal(moved.audio.samples[1600:], late.audio.samples)
    assert float(moved.source["offset_removed_ms"]) == -100


def test_labels_move_with_the_sound(corpus):
    bounds = [0.0, 0.4, 1.2, 3.0]
    spans = tuple(Span(a, b, Unit(phone)) for (a, b), phone in zip(pairwise(bounds), ("sil", "aa", "m"), strict=True))
    for late_s, expected in ((0.5, [0.0, 0.7, 2.5]), (-0.5, [0.0, 1.7, 3.5])):
        moved = module.move_sound(replace(corpus.utterance("here0"), phones=Timeline(spans)), late_s)
        found = list(moved.phones)
        assert [found[0].start_s, found[-1].start_s, found[-1].end_s] == pytest.approx(expected)
        assert found[-1].end_s == pytest.approx(moved.audio.duration_s)


def test_curves_without_lips_are_passed_over(corpus):
    one = corpus.utterance("here0")
    jaw = Track(Motion(np.zeros((75, 1)), 25.0, (Channel("jaw"),)), np.ones(75, bool))
    corpus.add(replace(one, name="jaw", track=jaw))
    assert set(offsets(corpus).clips) == set(corpus.names()) - {"jaw"}


def test_lips_that_do_not_follow_are_left_alone(corpus):
    names = [name for name in corpus.names() if name.startswith("there")]
    still = [corpus.utterance(name) for name in names]
    for name, other in zip(names, [*still[1:], still[0]], strict=True):
        corpus.add(replace(corpus.utterance(name), track=other.track), {})
    assert not offsets(corpus).collections["there"].known
    line = offsets(corpus).lines()[1]
    assert line.startswith("there: not measured: 4 clips of this voice cannot tell whether the sound is late. Training")
    assert line.endswith("give corpus prepare --offset-ms")
    before = corpus.utterance(names[0]).audio.samples.copy()
    assert "there" not in sync(corpus)
    np.testing.assert_array_equal(corpus.utterance(names[0]).audio.samples, before)


@pytest.mark.long
@pytest.mark.video
@pytest.mark.recordings
@pytest.mark.parametrize("late_s", [-0.06, 0.13])
def test_other_speakers_on_video(recordings, tmp_path, late_s):
    pytest.importorskip("mediapipe")
    corpus = Corpus.create(tmp_path / "corpus")
    for path in sorted((recordings / "grid-others").glob("*.mpg")):
        sound = read_audio(path).samples
        shift = round(late_s * RATE_HZ)
        sound = np.pad(sound, (shift, 0), mode="reflect") if shift > 0 else sound[-shift:]
        audio = Audio(np.ascontiguousarray(sound), RATE_HZ)
        one = Utterance(
            path.stem, audio, features_of(audio), track(path, crops=False), None, "test", {"collection": "others"}
        )
        corpus.add(one)
        found = best_offset(clip_scores(one), 100.0)
        assert not found.known or found.late_s == pytest.approx(late_s, abs=0.05)
    assert sum(clip.known for clip in offsets(corpus).clips.values()) >= 4
    assert offsets(corpus).collections["others"].late_s == pytest.approx(late_s, abs=0.02)
    shutil.rmtree(corpus.path)
