from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from formats.examples import of_motion, written
from lipmotion import Corpus, prepare
from lipmotion.corpora.source_recordings import MotionFile, SourceRecording
from lipmotion.errors import InputError
from lipmotion.formats.c3d import C3dFile, write_c3d
from lipmotion.formats.tables import SPEECH_CURVES
from lipmotion.types import Channel, Motion, Timeline, Unit
from lipmotion.units import is_silent
from lipmotion_faces.corpus.supplied import read_supplied_phones, read_supplied_track, source_digests
from meshes.live_link_app import write_take
from meshes.speech import said
from pipeline.made import replace_tracking, write_noise

CHANNELS = (Channel("jaw", "weight"), Channel("brow", "weight"))


def write_curves(path: Path, seconds: float = 2.0, rate_hz: float = 60.0, seed: int = 0) -> Motion:
    count = int(seconds * rate_hz)
    motion = Motion(np.random.default_rng(seed).uniform(size=(count, 2)), rate_hz, CHANNELS)
    written(path, of_motion(motion))
    return motion


@pytest.fixture
def studio(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Three sounds with motion, and no packages for video."""
    replace_tracking(monkeypatch, None)
    folder = tmp_path / "studio"
    (folder / "anna").mkdir(parents=True)
    for seed, (name, suffix) in enumerate((("a", ".npz"), ("b", ".json"), ("anna/c", ".csv"))):
        write_noise(folder / f"{name}.wav", 2.0, seed)
        write_curves(folder / f"{name}{suffix}", seed=seed)
    return folder


def test_curves_become_a_corpus_without_the_packages_for_video(studio, tmp_path):
    (studio / "a.lab").write_text("0 10000000 AH0\n10000000 18000000 M\n")
    report = prepare(studio, tmp_path / "corpus", workers=1)
    assert (report.prepared, report.failed, report.unseen) == (("a", "anna-c", "b"), {}, {})
    corpus = Corpus.open(tmp_path / "corpus")
    for name, path, seed in (("a", "a.npz", 0), ("b", "b.json", 1), ("anna-c", "anna/c.csv", 2)):
        found, original = corpus.utterance(name), write_curves(tmp_path / Path(path).name, seed=seed)
        assert found.track.motion.rate_hz == pytest.approx(60)
        assert found.track.motion.names == ("jaw", "brow")
        np.testing.assert_allclose(found.track.motion.values, original.values, atol=1e-5)
        assert found.track.seen.all()
        assert found.track.crops is None
        assert found.features.values.shape == (201, 39)
        assert found.source["motion_file"] == Path(path).name
        assert "mediapipe" not in found.source
    assert corpus.utterance("anna-c").speaker == "anna"
    phones = corpus.utterance("a").phones
    assert phones is not None
    assert [(s.start_s, s.end_s, s.label.phone) for s in phones] == [(0, 1, "ax"), (1, 1.8, "m"), (1.8, 2, "sil")]
    assert corpus.summary()["labelled"] == "1 with phones in time"


def test_another_content_is_prepared_again(studio, tmp_path):
    prepare(studio, tmp_path / "corpus", workers=1)
    assert prepare(studio, tmp_path / "corpus", workers=1).prepared == ()
    write_curves(studio / "b.json", seed=9)
    assert prepare(studio, tmp_path / "corpus", workers=1).prepared == ("b",)
    (studio / "a.lab").write_text("0 10000000 AH0\n10000000 18000000 M\n")
    assert prepare(studio, tmp_path / "corpus", workers=1).prepared == ("a",)
    (studio / "a.lab").write_text("0 11000000 AH0\n11000000 18000000 M\n")
    assert prepare(studio, tmp_path / "corpus", workers=1).prepared == ("a",)
    assert prepare(studio, tmp_path / "corpus", workers=1).prepared == ()


def test_what_does_not_fit_is_listed_and_the_rest_goes_on(studio, tmp_path):
    write_curves(studio / "b.json", rate_hz=60, seconds=1.2)
    (studio / "anna" / "c.csv").write_text("frame,jaw\n1,2\n")
    write_noise(studio / "d.wav", 2.0)
    write_curves(studio / "d.npz")
    (studio / "d.lab").write_text("0 10000000 t\n10000000 90000000 uw\n")
    report = prepare(studio, tmp_path / "corpus", workers=1)
    assert report.prepared == ("a",)
    assert "72 frames at 60 Hz last 1.20 s, the sound lasts 2.00 s" in report.failed["b"]
    assert "required 'time_s,opening,...'" in report.failed["anna-c"]
    assert "its phones are labelled to 9.00 s, the sound lasts 2.00 s" in report.failed["d"]


def test_a_bare_array_at_another_rate_is_noticed(tmp_path):
    np.save(tmp_path / "a.npy", np.zeros((50, 2)))
    curves = MotionFile(tmp_path / "a.npy", 30.0, CHANNELS)
    assert read_supplied_track(curves, 1.7).motion.rate_hz == 30
    with pytest.raises(InputError, match=r"50 frames at 30 Hz last 1\.67 s, the sound lasts 5\.00 s"):
        read_supplied_track(curves, 5.0)


def recording(phones: Timeline[Unit] | None) -> SourceRecording:
    return SourceRecording("a", Path("a.wav"), None, phones=phones)


def test_silence_is_named_as_recognition_names_it():
    labelled = said(
        *[(0.1, 0.2, "sp"), (0.2, 0.4, "aa"), (0.4, 0.5, "sil"), (0.5, 0.7, "m"), (0.7, 0.8, "sp")],
        *[(0.8, 1.0, "sil"), (1.0, 1.2, "b"), (1.2, float("inf"), "sil")],
    )
    found = read_supplied_phones(recording(labelled), 1.3)
    assert found == said(
        *[(0.0, 0.2, "sil"), (0.2, 0.4, "aa"), (0.4, 0.5, "sp"), (0.5, 0.7, "m"), (0.7, 1.0, "sil")],
        *[(1.0, 1.2, "b"), (1.2, 1.3, "sil")],
    )
    assert read_supplied_phones(recording(None), 1.3) is None
    assert "phones_sha256" not in source_digests(recording(None))


@given(
    st.lists(st.tuples(st.sampled_from(["aa", "m", "sil", "sp"]), st.floats(0.01, 0.5)), min_size=1, max_size=20),
    st.floats(0, 0.5),
    st.floats(-0.09, 1),
)
def test_phones_tile_the_sound(phones, begin_s, longer_s):
    edges = begin_s + np.cumsum([0, *(length for _, length in phones)])
    labelled = said(*((a, b, p) for a, b, (p, _) in zip(edges, edges[1:], phones, strict=False)))
    duration_s = max(float(edges[-1]) + longer_s, 0.1)
    found = read_supplied_phones(recording(labelled), duration_s)
    assert found[0].start_s == 0
    assert found[-1].end_s == pytest.approx(duration_s)
    assert all(a.end_s == b.start_s for a, b in zip(found, found.spans[1:], strict=False))
    assert not any(
        is_silent(a.label.phone) and is_silent(b.label.phone) for a, b in zip(found, found.spans[1:], strict=False)
    )
    spoken = [s.label.phone for s in labelled if not is_silent(s.label.phone) and s.start_s < duration_s]
    assert [s.label.phone for s in found if not is_silent(s.label.phone)] == spoken


def test_labels_that_go_on_after_the_sound():
    with pytest.raises(InputError, match="are they those of another recording"):
        read_supplied_phones(recording(said((0, 2, "aa"))), 1.8)
    assert read_supplied_phones(recording(said((0, 2, "aa"))), 1.95) == said((0, 1.95, "aa"))


def test_a_source_is_not_touched(studio):
    item = replace(recording(said((0, 1, "aa"))), motion_file=MotionFile(studio / "a.npz"))
    assert set(source_digests(item)) == {"motion_file", "motion_sha256", "phones_sha256"}
    assert source_digests(item) == source_digests(item)
    assert source_digests(item) != source_digests(replace(item, phones=said((0, 1.001, "aa"))))


def test_a_take_of_the_app_and_markers_become_a_corpus(tmp_path):
    takes = tmp_path / "takes"
    takes.mkdir()
    values = np.random.default_rng(3).uniform(size=(120, 3))
    names = ("JawOpen", "MouthPucker", "EyeBlinkLeft")
    write_take(takes / "a.csv", Motion(values, 60.0, tuple(Channel(name, "weight") for name in names)))
    write_noise(takes / "a.wav", 2.0)
    places = np.random.default_rng(4).normal(0, 5, (240, 4, 3)) * [0, 0, 0]
    places[:, 0, 0], places[:, 1, 0] = 44, -44
    places[:, 2:] = np.random.default_rng(5).normal(0, 3, (240, 2, 3)) - [0, 70, -20]
    write_c3d(takes / "b.c3d", C3dFile(("EYE_L", "EYE_R", "LIP_13", "LIP_14"), places, 120.0))
    write_noise(takes / "b.wav", 2.0)
    assert prepare(takes, tmp_path / "corpus", workers=1).prepared == ("a", "b")
    corpus = Corpus.open(tmp_path / "corpus")
    taken, marked = (corpus.utterance(name).track.motion for name in "ab")
    assert set(taken.names) == SPEECH_CURVES
    np.testing.assert_allclose(taken["jawOpen"], values[:, 0], atol=1e-6)
    assert marked.rate_hz == 120.0
    expected = np.linalg.norm(places[:, 2] - places[:, 3], axis=1) / 88
    np.testing.assert_allclose(marked["opening"], expected, atol=1e-6)


def test_frames_without_a_face_are_not_seen(tmp_path):
    rows = [f"10:00:{n // 60:02d}:{n % 60:02d}.000,{'1,0.5' if 30 <= n < 90 else 0}" for n in range(120)]
    (tmp_path / "a.csv").write_text("\n".join(["Timecode,BlendshapeCount,JawOpen", *rows]))
    track = read_supplied_track(MotionFile(tmp_path / "a.csv"), 2.0)
    assert np.flatnonzero(track.seen).tolist() == list(range(30, 90))
    assert track.motion["jawOpen"] == pytest.approx(np.where(track.seen, 0.5, 0.0))
