"""docs/your-face.md, done: a video of a drawn person becomes a model and a face that say another sentence."""

import shlex
from itertools import chain
from pathlib import Path

import av
import numpy as np
import pytest

from docs.site_pages import blocks
from lipmotion.types import Audio, Timeline
from lipmotion_faces import Staging, stage_face
from pipeline.made import write_sound
from testing.toy import CAMERA_HZ, toy_motion, toy_sentences, write_film

SENTENCES = 6


def write_clip(path: Path) -> None:
    """Write a drawn person who says toy sentences, in one take."""
    spoken = toy_sentences(SENTENCES)
    face = stage_face("woman", Staging(size=360, blinks=False, gaze=False, brows=False, head=False))
    frames = chain.from_iterable(
        face.render(toy_motion(each.units, CAMERA_HZ), Timeline(()), fps=CAMERA_HZ) for each in spoken
    )
    samples = np.concatenate([each.audio.samples for each in spoken])
    write_film(path, frames, Audio(samples, spoken[0].audio.rate_hz))


@pytest.mark.long
@pytest.mark.video
def test_a_clip_becomes_a_face_that_speaks(tmp_path, monkeypatch, run):
    pytest.importorskip("mediapipe")
    monkeypatch.chdir(tmp_path)
    write_clip(tmp_path / "me.mp4")
    write_sound(tmp_path / "speech.wav", toy_sentences(3)[0].audio)
    commands = [shlex.split(line) for block in blocks("docs/your-face") for line in block.text.splitlines()]
    assert [words[1] for words in commands] == ["corpus", "train", "face", "speak", "animate"]
    for words in commands:
        assert run(*words[1:]).code == 0
    for name in ("morning.mp4", "said.mp4"):
        with av.open(tmp_path / name) as film:
            assert film.streams.video[0].frames > CAMERA_HZ
            assert "synthetic" in film.metadata["comment"]
