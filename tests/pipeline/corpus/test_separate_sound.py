from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from formats.examples import of_motion, written
from lipmotion import Corpus, prepare
from lipmotion.corpora.source_recordings import SourceRecording
from lipmotion.errors import CorpusError
from lipmotion.formats.sound import write_sound
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.types import Audio, Channel, Motion, Track
from lipmotion_faces.corpus.supplied import SeparateSound, align_sound, separate_sound, trim_to_shared
from speech.recorded_twice import RATE_HZ, clap, recorded_twice, speech_like

RATE = 60.0
CUT, BEFORE = 4_800, 12_345


def write_ramp(path: Path, seconds: float) -> None:
    """Write a curve that says its own time."""
    motion = Motion(np.arange(int(seconds * RATE))[:, None] / RATE, RATE, (Channel("jaw", "weight"),))
    written(path, of_motion(motion))


@pytest.fixture
def studio(tmp_path: Path) -> Path:
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


def test_the_recorders_sound_is_used_from_the_right_moment(studio, tmp_path):
    (studio / "take.lab").write_text("10000000 20000000 aa\n")
    report = prepare(studio, tmp_path / "corpus", workers=1)
    assert (report.prepared, report.failed) == (("take",), {})
    assert report.notes["take"] == ("sound 1071.6 ms late, found by the clap",)
    found = Corpus.open(tmp_path / "corpus").utterance("take")
    assert (found.source["recorder_file"], found.source["sound_found_by"]) == ("take.recorder.wav", "clap")
    assert float(found.source["sound_late_ms"]) == pytest.approx(1000 * (CUT + BEFORE) / RATE_HZ, abs=0.1)
    assert found.track.motion.values[0, 0] == pytest.approx(0)
    assert found.audio.duration_s == pytest.approx(len(found.track.seen) / RATE, abs=0.02)
    at = int(np.abs(found.audio.samples).argmax())
    assert at == pytest.approx(RATE_HZ - CUT, abs=40)
    assert prepare(studio, tmp_path / "corpus", workers=1).kept == ("take",)
    (studio / "take.recorder.wav").write_bytes((studio / "take.wav").read_bytes())
    assert prepare(studio, tmp_path / "corpus", workers=1).prepared == ("take",)


def test_a_long_video_gets_the_recorders_sound_in_its_own_time(studio):
    recording = SourceRecording("take", studio / "take.wav", None, recorder=studio / "take.recorder.wav")
    own, sound = read_audio(studio / "take.wav"), separate_sound(recording)
    assert sound is not None
    placed = align_sound(sound, own.duration_s)
    assert len(placed.samples) == len(own.samples)
    assert np.abs(placed.samples).argmax() == pytest.approx(np.abs(own.samples).argmax(), abs=40)
    assert separate_sound(replace(recording, recorder=None)) is None


def test_a_given_offset_is_used(studio, tmp_path):
    (studio / "take.recorder.wav").unlink()
    (studio / "take.lab").write_text("0 10000000 aa\n10000000 30000000 m\n")
    report = prepare(studio, tmp_path / "late", offset_ms=250, workers=1)
    assert report.notes["take"] == ("sound 250.0 ms late, as given",)
    late = Corpus.open(tmp_path / "late").utterance("take")
    assert late.track.motion.values[0, 0] == pytest.approx(0)
    assert late.phones[0].end_s == pytest.approx(0.75)
    (studio / "offsets.csv").write_text("name,offset_ms\ntake,-500\n")
    prepare(studio, tmp_path / "early", offset_ms=250, workers=1)
    early = Corpus.open(tmp_path / "early").utterance("take")
    assert early.track.motion.values[0, 0] == pytest.approx(0.5)
    whole = Corpus.open(tmp_path / "late").utterance("take").audio.duration_s + 0.25
    assert early.audio.duration_s == pytest.approx(whole - 0.5, abs=0.03)
    assert early.phones[0].end_s == pytest.approx(1.0)


def test_motion_of_another_length_needs_an_offset(studio, tmp_path):
    (studio / "take.recorder.wav").unlink()
    write_ramp(studio / "take.npz", 3.0)
    with pytest.raises(CorpusError, match="required: the same time from the same start"):
        prepare(studio, tmp_path / "corpus", workers=1)
    prepare(studio, tmp_path / "corpus", offset_ms=1000, workers=1)
    assert Corpus.open(tmp_path / "corpus").utterance("take").audio.duration_s == pytest.approx(3.0, abs=0.02)


def test_what_is_not_clear_is_listed(studio, tmp_path):
    chance = np.random.default_rng(9)
    other = Audio(speech_like(chance, 5.0).astype(np.float32), RATE_HZ)
    write_sound(studio / "take.recorder.wav", other)
    with pytest.raises(CorpusError, match=r"take\.recorder\.wav: the offset of the two sounds is not clear"):
        prepare(studio, tmp_path / "corpus", workers=1)


def track(frames: int) -> Track:
    return Track(Motion(np.arange(frames)[:, None] / RATE, RATE, (Channel("jaw"),)), np.ones(frames, bool))


@pytest.mark.parametrize("late_s", [-1.234, -0.01, 0.0, 0.777, 2.0])
def test_sound_and_motion_begin_together(late_s):
    """The sound is a ramp of its own time, as the motion is."""
    ramp = Audio((np.arange(4 * RATE_HZ) / RATE_HZ).astype(np.float32), RATE_HZ)
    audio, found, start_s = trim_to_shared(SeparateSound(ramp, late_s, "x"), track(300))
    assert found.motion.values[0, 0] == pytest.approx(start_s)
    assert audio.samples[0] == pytest.approx(start_s + late_s, abs=1 / RATE_HZ)
    assert audio.duration_s == pytest.approx(len(found.seen) / RATE, abs=1 / RATE)
    placed = align_sound(SeparateSound(ramp, late_s, "x"), 5.0)
    assert len(placed.samples) == 5 * RATE_HZ
    middle = int(1.5 * RATE_HZ)
    assert placed.samples[middle] == pytest.approx(1.5 + late_s, abs=1 / RATE_HZ)


def test_sounds_that_share_nothing_are_refused():
    ramp = Audio(np.zeros(RATE_HZ, np.float32), RATE_HZ)
    for late_s in (-20.0, 20.0, 0.9):
        with pytest.raises(ValueError, match=r"share 0\.\d\d s, required 0.5"):
            trim_to_shared(SeparateSound(ramp, late_s, "clap"), track(300))
