from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lipmotion.corpora.store import Corpus
from lipmotion.errors import InputError
from lipmotion.experiments.noise import LONGEST_S, in_noise, talkers_in
from lipmotion.pipeline.evaluation.evaluate import Recorded, recorded
from lipmotion.pipeline.model import Model
from lipmotion.speech.mfcc import mfcc
from lipmotion.speech.noise import noisy
from lipmotion.speech.recogniser import recogniser


@pytest.fixture(scope="module")
def found(toy_corpus: Corpus, toy_model: Model) -> Recorded:
    return recorded(toy_corpus, recogniser(toy_model.phones), split="test")


def test_faces_stay_and_the_sound_is_noisy(found: Recorded) -> None:
    heard = in_noise(found, "white", 10, seed=4)
    assert list(heard.conditions) == ["audio only"]
    assert heard.reference is found.reference
    for number, (one, was) in enumerate(zip(heard.utterances, found.utterances, strict=True)):
        wanted = noisy(was.audio, "white", 10, seed=4 + number)
        assert np.array_equal(one.audio.samples, wanted.samples)
        assert np.array_equal(one.features.values, mfcc(wanted).values)
        assert one.track is was.track
        assert heard.conditions["audio only"][number] == found.phones.recognise(one.audio, one.features)


def test_every_clip_has_noise_of_its_own(found: Recorded) -> None:
    one, other = (
        heard.audio.samples - was.audio.samples
        for heard, was in zip(in_noise(found, "white", 0).utterances, found.utterances, strict=True)
    )
    shorter = min(len(one), len(other))
    assert abs(np.corrcoef(one[:shorter], other[:shorter])[0, 1]) < 0.05


def test_talkers_are_the_recordings_of_a_folder(toy_speech: Path, tmp_path: Path) -> None:
    for name in ("b.wav", "a.wav"):
        (tmp_path / name).write_bytes(toy_speech.read_bytes())
    (tmp_path / "words.txt").write_text("no sound")
    talkers = talkers_in(tmp_path)
    assert len(talkers) == 2
    assert all(0 < talker.duration_s <= LONGEST_S for talker in talkers)


def test_no_talkers(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nowhere: no such folder; give one with recordings of other people"):
        talkers_in(tmp_path / "nowhere")
    with pytest.raises(InputError, match="no recording in it"):
        talkers_in(tmp_path)
