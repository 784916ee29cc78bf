from __future__ import annotations

import wave
from pathlib import Path

import numpy as np
import pytest

from cli.conftest import RunCommand, is_one_error
from lipmotion import adapt, load_model, save_model


def sound(path: Path, samples: np.ndarray) -> Path:
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(16_000)
        file.writeframes(np.round(samples * 32767).astype("<i2").tobytes())
    return path


@pytest.mark.long
def test_it_is_the_function_of_the_same_name(
    run: RunCommand, here: Path, toy_speech: Path, toy_model_file: Path
) -> None:
    done = run("adapt", toy_speech, "--model", toy_model_file, "-o", "voice.lipmotion")
    assert (done.code, done.err) == (0, [])
    assert done.out[0].startswith("voice.lipmotion: 1 recordings, ")
    assert done.out[0].endswith("s of speech; use it: lipmotion animate SPEECH -o FILE --model voice.lipmotion")
    save_model(adapt(load_model(toy_model_file), [toy_speech]), here / "same")
    assert (here / "same").read_bytes() == (here / "voice.lipmotion").read_bytes()
    said = dict(line.split(maxsplit=1) for line in run("info", "voice.lipmotion").out if len(line.split()) > 1)
    assert said["adapted"].startswith("recordings=1, speech_s=")
    assert run("animate", toy_speech, "--model", "voice.lipmotion", "-o", "m.json").code == 0


@pytest.mark.long
def test_what_cannot_be_adapted_to(run: RunCommand, here: Path, toy_model_file: Path, tmp_path: Path) -> None:
    silent = sound(tmp_path / "silent.wav", np.zeros(32_000))
    (tmp_path / "text.wav").write_bytes(b"words")
    for path, words in (
        (tmp_path / "missing.wav", "no such file"),
        (tmp_path / "text.wav", "is text, required a recording"),
        (silent, "no speech found in the recordings"),
    ):
        done = run("adapt", path, "--model", toy_model_file, "-o", "voice.lipmotion")
        assert is_one_error(done, 3)
        assert words in done.err[0]
        assert list(here.iterdir()) == []
