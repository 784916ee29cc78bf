from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from formats.examples import of_motion, written
from lipmotion import Corpus, prepare
from lipmotion.errors import CorpusError, InputError
from lipmotion.formats.c3d import C3dFile, write_c3d
from lipmotion.types import Audio, Channel, Motion, Timeline, Track, Unit
from lipmotion.units import is_silent
from lipmotion_faces.corpus import supplied
from lipmotion_faces.corpus.captured_faces import FLAME_MARKERS, FLAME_VERTICES, read_mesh_motion, read_vertices
from lipmotion_faces.corpus.folder import discover
from lipmotion_faces.corpus.source_recordings import MotionFile, SourceRecording
from meshes.flame import head
from meshes.live_link_app import write_take
from meshes.speech import said
from pipeline.made import replace_tracking, write_noise, write_sound
from speech.made_voices import RATE_HZ, clap, recorded_twice, speech_like

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
    assert supplied.read_supplied_track(curves, 1.7).motion.rate_hz == 30
    with pytest.raises(InputError, match=r"50 frames at 30 Hz last 1\.67 s, the sound lasts 5\.00 s"):
        supplied.read_supplied_track(curves, 5.0)


def recording(phones: Timeline[Unit] | None) -> SourceRecording:
    return SourceRecording("a", Path("a.wav"), None, phones=phones)


@pytest.mark.parametrize(
    ("swing", "seconds", "loud", "noted"),
    [(0.03, 3, 1, ""), (0.004, 3, 1, "hardly move"), (0.03, 1, 1, "1.0 of 3.0 s"), (0.03, 3, 0, "nothing is said")],
)
def test_sound_and_motion_of_which_nothing_is_learned(swing, seconds, loud, noted):
    audio = Audio((loud * speech_like(np.random.default_rng(0), 3)).astype(np.float32), RATE_HZ)
    motion = Motion(swing * np.sin(np.arange(25.0 * seconds))[:, None], 25.0, (Channel("opening"),))
    notes = supplied.doubt_recording(audio, Track(motion, np.ones(25 * seconds, bool)))
    assert [noted in note for note in notes] == [True] * bool(noted)


def test_silence_is_named_as_recognition_names_it():
    labelled = said(
        *[(0.1, 0.2, "sp"), (0.2, 0.4, "aa"), (0.4, 0.5, "sil"), (0.5, 0.7, "m"), (0.7, 0.8, "sp")],
        *[(0.8, 1.0, "sil"), (1.0, 1.2, "b"), (1.2, float("inf"), "sil")],
    )
    found = supplied.read_supplied_phones(recording(labelled), 1.3)
    assert found == said(
        *[(0.0, 0.2, "sil"), (0.2, 0.4, "aa"), (0.4, 0.5, "sp"), (0.5, 0.7, "m"), (0.7, 1.0, "sil")],
        *[(1.0, 1.2, "b"), (1.2, 1.3, "sil")],
    )
    assert supplied.read_supplied_phones(recording(None), 1.3) is None
    with pytest.raises(InputError, match="are they those of another recording"):  # that go on after the sound
        supplied.read_supplied_phones(recording(said((0, 2, "aa"))), 1.8)
    assert supplied.read_supplied_phones(recording(said((0, 2, "aa"))), 1.95) == said((0, 1.95, "aa"))
    assert "phones_sha256" not in supplied.digest_sources(recording(None))


@given(
    st.lists(st.tuples(st.sampled_from(["aa", "m", "sil", "sp"]), st.floats(0.01, 0.5)), min_size=1, max_size=20),
    st.floats(0, 0.5),
    st.floats(-0.09, 1),
)
def test_phones_tile_the_sound(phones, begin_s, longer_s):
    edges = begin_s + np.cumsum([0, *(length for _, length in phones)])
    labelled = said(*((a, b, p) for a, b, (p, _) in zip(edges, edges[1:], phones, strict=False)))
    duration_s = max(float(edges[-1]) + longer_s, 0.1)
    found = supplied.read_supplied_phones(recording(labelled), duration_s)
    assert found[0].start_s == 0
    assert found[-1].end_s == pytest.approx(duration_s)
    assert all(a.end_s == b.start_s for a, b in pairwise(found))
    assert not any(is_silent(a.label.phone) and is_silent(b.label.phone) for a, b in pairwise(found))
    spoken = [s.label.phone for s in labelled if not is_silent(s.label.phone) and s.start_s < duration_s]
    assert [s.label.phone for s in found if not is_silent(s.label.phone)] == spoken


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
    assert set(taken.names) == supplied.SPEECH_CURVES
    np.testing.assert_allclose(taken["jawOpen"], values[:, 0], atol=1e-6)
    assert marked.rate_hz == 120.0
    expected = np.linalg.norm(places[:, 2] - places[:, 3], axis=1) / 88
    np.testing.assert_allclose(marked["opening"], expected, atol=1e-6)


def test_frames_without_a_face_are_not_seen(tmp_path):
    rows = [f"10:00:{n // 60:02d}:{n % 60:02d}.000,{'1,0.5' if 30 <= n < 90 else 0}" for n in range(120)]
    (tmp_path / "a.csv").write_text("\n".join(["Timecode,BlendshapeCount,JawOpen", *rows]))
    track = supplied.read_supplied_track(MotionFile(tmp_path / "a.csv"), 2.0)
    assert np.flatnonzero(track.seen).tolist() == list(range(30, 90))
    assert track.motion["jawOpen"] == pytest.approx(np.where(track.seen, 0.5, 0.0))


RATE = 60.0
CUT, BEFORE = 4_800, 12_345


def write_ramp(path: Path, seconds: float) -> None:
    """Write a curve that says its own time."""
    motion = Motion(np.arange(int(seconds * RATE))[:, None] / RATE, RATE, (Channel("jaw", "weight"),))
    written(path, of_motion(motion))


@pytest.fixture
def recorded_twice_folder(tmp_path: Path) -> Path:
    """A take of a camera with motion, and the same take as a recorder has it, from earlier on."""
    chance = np.random.default_rng(5)
    scene = np.concatenate([np.zeros(2 * RATE_HZ), speech_like(chance, 4.0)])
    made = clap(chance)
    scene[RATE_HZ : RATE_HZ + len(made)] += made
    camera, recorder, late_s = recorded_twice(scene, chance, CUT, BEFORE)
    assert late_s == pytest.approx((CUT + BEFORE) / RATE_HZ)
    folder = tmp_path / "studio"
    folder.mkdir()
    write_sound(folder / "take.wav", camera)
    write_sound(folder / "take.recorder.wav", recorder)
    write_ramp(folder / "take.npz", camera.duration_s)
    return folder


def test_the_recorders_sound_is_used_from_the_right_moment(recorded_twice_folder, tmp_path):
    (recorded_twice_folder / "take.lab").write_text("10000000 20000000 aa\n")
    report = prepare(recorded_twice_folder, tmp_path / "corpus", workers=1)
    assert (report.prepared, report.failed) == (("take",), {})
    assert report.notes["take"] == ("sound 1071.6 ms late, found by the sound of both",)
    found = Corpus.open(tmp_path / "corpus").utterance("take")
    assert (found.source["recorder_file"], found.source["sound_found_by"]) == ("take.recorder.wav", supplied.ALIKE)
    assert float(found.source["sound_late_ms"]) == pytest.approx(1000 * (CUT + BEFORE) / RATE_HZ, abs=0.1)
    assert found.track.motion.values[0, 0] == pytest.approx(0)
    assert found.audio.duration_s == pytest.approx(len(found.track.seen) / RATE, abs=0.02)
    at = int(np.abs(found.audio.samples).argmax())
    assert at == pytest.approx(RATE_HZ - CUT, abs=40)
    assert prepare(recorded_twice_folder, tmp_path / "corpus", workers=1).kept == ("take",)
    (recorded_twice_folder / "take.recorder.wav").write_bytes((recorded_twice_folder / "take.wav").read_bytes())
    assert prepare(recorded_twice_folder, tmp_path / "corpus", workers=1).prepared == ("take",)


def test_a_given_offset_is_used(recorded_twice_folder, tmp_path):
    (recorded_twice_folder / "take.recorder.wav").unlink()
    (recorded_twice_folder / "take.lab").write_text("0 10000000 aa\n10000000 30000000 m\n")
    report = prepare(recorded_twice_folder, tmp_path / "late", offset_ms=250, workers=1)
    assert report.notes["take"] == ("sound 250.0 ms late, as given",)
    late = Corpus.open(tmp_path / "late").utterance("take")
    assert late.track.motion.values[0, 0] == pytest.approx(0)
    assert late.phones[0].end_s == pytest.approx(0.75)
    (recorded_twice_folder / "offsets.csv").write_text("name,offset_ms\ntake,-500\n")
    prepare(recorded_twice_folder, tmp_path / "early", offset_ms=250, workers=1)
    early = Corpus.open(tmp_path / "early").utterance("take")
    assert early.track.motion.values[0, 0] == pytest.approx(0.5)
    whole = Corpus.open(tmp_path / "late").utterance("take").audio.duration_s + 0.25
    assert early.audio.duration_s == pytest.approx(whole - 0.5, abs=0.03)
    assert early.phones[0].end_s == pytest.approx(1.0)


def test_what_is_not_clear_is_listed(recorded_twice_folder, tmp_path):
    other = Audio(speech_like(np.random.default_rng(9), 5.0).astype(np.float32), RATE_HZ)
    write_sound(recorded_twice_folder / "take.recorder.wav", other)
    with pytest.raises(CorpusError, match=r"take\.recorder\.wav: the offset of the two sounds is not clear"):
        prepare(recorded_twice_folder, tmp_path / "corpus", workers=1)


def test_motion_of_another_length_needs_an_offset(recorded_twice_folder, tmp_path):
    (recorded_twice_folder / "take.recorder.wav").unlink()
    write_ramp(recorded_twice_folder / "take.npz", 3.0)
    with pytest.raises(CorpusError, match="required: the same time from the same start"):
        prepare(recorded_twice_folder, tmp_path / "corpus", workers=1)
    prepare(recorded_twice_folder, tmp_path / "corpus", offset_ms=1000, workers=1)
    assert Corpus.open(tmp_path / "corpus").utterance("take").audio.duration_s == pytest.approx(3.0, abs=0.02)


def ramp_track(frames: int) -> Track:
    return Track(Motion(np.arange(frames)[:, None] / RATE, RATE, (Channel("jaw"),)), np.ones(frames, bool))


@pytest.mark.parametrize("late_s", [-1.234, -0.01, 0.0, 0.777, 2.0])
def test_sound_and_motion_begin_together(late_s):
    """The sound is a ramp of its own time, as the motion is."""
    ramp = Audio((np.arange(4 * RATE_HZ) / RATE_HZ).astype(np.float32), RATE_HZ)
    audio, found, start_s = supplied.trim_to_shared(supplied.SeparateSound(ramp, late_s, "x"), ramp_track(300))
    assert found.motion.values[0, 0] == pytest.approx(start_s)
    assert audio.samples[0] == pytest.approx(start_s + late_s, abs=1 / RATE_HZ)
    assert audio.duration_s == pytest.approx(len(found.seen) / RATE, abs=1 / RATE)
    placed = supplied.align_sound(supplied.SeparateSound(ramp, late_s, "x"), 5.0)
    assert len(placed.samples) == 5 * RATE_HZ
    middle = int(1.5 * RATE_HZ)
    assert placed.samples[middle] == pytest.approx(1.5 + late_s, abs=1 / RATE_HZ)


def test_sounds_that_share_nothing_are_refused():
    ramp = Audio(np.zeros(RATE_HZ, np.float32), RATE_HZ)
    for late_s in (-20.0, 20.0, 0.9):
        with pytest.raises(ValueError, match=r"share 0\.\d\d s, required 0.5"):
            supplied.trim_to_shared(supplied.SeparateSound(ramp, late_s, supplied.GIVEN), ramp_track(300))


MESH_HZ, MESHES = 60.0, 30


def write_sentence(folder: Path, person: str, sentence: str) -> np.ndarray:
    """Write a sentence as VOCASET has it; return by how much the jaw is lowered, in millimetres [shape=(T,)]."""
    jaw = 8 * np.sin(np.linspace(0, np.pi, MESHES)) ** 2
    meshes, sound = folder / "unposedcleaneddata" / person / sentence, folder / "audio" / person / f"{sentence}.wav"
    for each in (meshes, sound.parent):
        each.mkdir(parents=True, exist_ok=True)
    for number, lowered in enumerate(jaw, 1):
        (meshes / f"{sentence}.{number:06}.ply").write_bytes(head(lowered, "<"))
    write_noise(sound, 0.5, 1, 22_000)
    return jaw


def test_vocaset_becomes_a_corpus_of_lip_distances(tmp_path):
    (tmp_path / "audio" / "anna").mkdir(parents=True)
    for name in ("a.wav", "a.csv"):
        (tmp_path / "audio" / "anna" / name).touch()
    assert discover(tmp_path).kind == "folder of sounds with motion"  # only the two folders are VOCASET
    for person in ("FaceTalk_170725_00137_TA", "FaceTalk_170728_03272_TA"):
        jaw = write_sentence(tmp_path / "voca", person, "sentence01")
    (tmp_path / "voca/audio/FaceTalk_170725_00137_TA/sentence01.txt").write_text("Hello there.")
    (tmp_path / "voca/audio/FaceTalk_170728_03272_TA/sentence02.wav").touch()
    report = prepare(tmp_path / "voca", tmp_path / "corpus", workers=1)
    assert report.prepared == ("FaceTalk_170725_00137_TA-sentence01", "FaceTalk_170728_03272_TA-sentence01")
    assert "no meshes (.ply)" in report.failed["FaceTalk_170728_03272_TA-sentence02"]
    corpus = Corpus.open(tmp_path / "corpus")
    assert list(corpus.speakers) == ["FaceTalk_170725_00137_TA", "FaceTalk_170728_03272_TA"]
    said = corpus.utterance(report.prepared[0])
    motion = said.track.motion
    assert (said.words, motion.rate_hz, said.source["licence"][:8]) == (("hello", "there"), MESH_HZ, "research")
    np.testing.assert_allclose(motion["opening"], (1 + jaw) / 90, atol=1e-6)
    np.testing.assert_allclose(motion["outer"], (16 + jaw) / 90, atol=1e-6)
    np.testing.assert_allclose(motion["width"], 46 / 90, atol=1e-6)
    np.testing.assert_allclose(np.ptp(motion["y_152"]), np.ptp(jaw) / 90, atol=1e-6)


def test_a_changed_mesh_prepares_again_and_a_missing_one_is_bridged(tmp_path):
    jaw = write_sentence(tmp_path / "voca", "anna", "s01")
    prepare(tmp_path / "voca", tmp_path / "corpus", workers=1)
    assert prepare(tmp_path / "voca", tmp_path / "corpus", workers=1).kept == ("anna-s01",)
    meshes = tmp_path / "voca/unposedcleaneddata/anna/s01"
    (meshes / "s01.000001.ply").unlink()
    (meshes / "s01.000011.ply").unlink()
    assert prepare(tmp_path / "voca", tmp_path / "corpus", workers=1).prepared == ("anna-s01",)
    opening = Corpus.open(tmp_path / "corpus").utterance("anna-s01").track.motion["opening"]
    jaw[[0, 10]] = jaw[1], (jaw[9] + jaw[11]) / 2
    np.testing.assert_allclose(opening, (1 + jaw) / 90, atol=1e-6)


def test_bytes_in_either_order_and_text(tmp_path):
    for order in ("<", ">", ""):
        (tmp_path / "a.ply").write_bytes(head(4, order))
        places = read_vertices(tmp_path / "a.ply", [FLAME_MARKERS["LIP_14"]])
        np.testing.assert_allclose(places, [[0, -0.065, 0.03]], atol=1e-6)


def test_other_meshes_are_refused(tmp_path):
    good = head(0, "<")
    nan = np.float32(np.nan).tobytes() * 3 * FLAME_VERTICES
    for content, message in (
        (good.replace(b"vertex 5023", b"vertex 5000"), "5000 of 'vertex', required 5023 vertices: of others, no lip"),
        (good[:20_000], "not a mesh of FLAME in .ply"),
        (good.replace(b"float x", b"list uchar int x"), "not a mesh of FLAME in .ply"),
        (good.replace(b"float x", b"real x"), "not a mesh of FLAME in .ply"),
        (good.replace(b"property float x\n", b""), "not a mesh of FLAME in .ply"),
        (good.replace(b"format binary_little_endian 1.0\n", b""), "not a mesh of FLAME in .ply"),
        (good.replace(b"end_header", b"the_header"), "its header has no end"),
        (good[: good.index(b"end_header") + 11] + nan, "not finite"),
        (b"", "not a mesh of FLAME in .ply"),
    ):
        (tmp_path / "a.1.ply").write_bytes(content)
        with pytest.raises(InputError, match=message):
            read_mesh_motion(tmp_path / "a.1.ply", MESH_HZ)
