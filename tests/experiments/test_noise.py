from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lipmotion import Corpus, Model, Selection
from lipmotion.errors import InputError
from lipmotion.speech.features.analysed_audio import analysed
from lipmotion.speech.recognition.recogniser import Recogniser
from lipmotion.speech.sound.acoustic_conditions import noisy_audio
from lipmotion_lab.evaluation.held_out import LONGEST_S, HeldOutRecordings, add_noise, load_held_out, read_talkers


@pytest.fixture(scope="module")
def clean(toy_corpus: Corpus, toy_model: Model) -> HeldOutRecordings:
    return load_held_out(toy_corpus, Recogniser(toy_model.phones, "own"), selection=Selection("test"))


def test_faces_stay_and_the_sound_is_noisy(clean: HeldOutRecordings) -> None:
    noisy_recordings = add_noise(clean, "white", 10, seed=4)
    assert list(noisy_recordings.conditions) == ["audio only"]
    assert noisy_recordings.reference is clean.reference
    for number, (one, before) in enumerate(zip(noisy_recordings.utterances, clean.utterances, strict=True)):
        wanted = noisy_audio(before.audio, "white", 10, seed=4 + number)
        assert np.array_equal(one.audio.samples, wanted.samples)
        assert np.array_equal(one.features.values, analysed(wanted).mfcc().values)
        assert one.track is before.track
        assert noisy_recordings.conditions["audio only"][number] == clean.phones.recognise(one.audio, one.features)


def test_every_clip_has_noise_of_its_own(clean: HeldOutRecordings) -> None:
    noisy_utterances = add_noise(clean, "white", 0).utterances
    one, other = (
        noisy.audio.samples - before.audio.samples
        for noisy, before in zip(noisy_utterances, clean.utterances, strict=True)
    )
    shorter = min(len(one), len(other))
    assert abs(np.corrcoef(one[:shorter], other[:shorter])[0, 1]) < 0.05


def test_talkers_are_the_recordings_of_a_folder(toy_speech: Path, tmp_path: Path) -> None:
    for name in ("b.wav", "a.wav"):
        (tmp_path / name).write_bytes(toy_speech.read_bytes())
    (tmp_path / "words.txt").write_text("no sound")
    talkers = read_talkers(tmp_path)
    assert len(talkers) == 2
    assert all(0 < talker.duration_s <= LONGEST_S for talker in talkers)


def test_no_talkers(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nowhere: no such folder; give one with recordings of other people"):
        read_talkers(tmp_path / "nowhere")
    with pytest.raises(InputError, match="no recording in it"):
        read_talkers(tmp_path)
