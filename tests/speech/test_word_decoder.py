from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lipmotion.errors import MissingDependencyError
from lipmotion.speech.recognition import word_search
from lipmotion.speech.recognition.word_search import is_filler, words_in
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.sound.voice_activity import Stretch, stretch_samples
from lipmotion.types import Audio
from lipmotion.units import Lexicon

WELCOME = Path(__file__).parents[2] / "examples" / "welcome.flac"


def test_words_of_a_sentence() -> None:
    audio = read_audio(WELCOME)
    words = words_in(stretch_samples(audio, Stretch(0, len(audio.samples) // 160)))
    found = [word.text for word in words]
    assert all(0 <= word.posterior <= 1 for word in words)
    assert sum(word.posterior for word in words) > len(words) / 2
    assert {"please", "speak", "lips", "five", "big", "blue", "boats"} <= set(found)
    assert all(Lexicon().known(word) for word in found)
    assert not any(is_filler(word) or "(" in word for word in found)


def test_no_sound_has_no_words() -> None:
    assert [words_in(samples) for samples in (b"", bytes(2), bytes(320))] == [()] * 3


def test_one_recording_does_not_change_the_next() -> None:
    audio = read_audio(WELCOME)
    samples = stretch_samples(audio, Stretch(0, 120))
    noise = np.random.default_rng(0).normal(0, 9000, 8_000).astype("<i2").tobytes()
    first = words_in(samples)
    words_in(noise)
    assert words_in(samples) == first


def test_samples_of_a_stretch_are_clipped_integers() -> None:
    audio = Audio(np.repeat(np.array([0.0, 0.5, -2.0], np.float32), 160), 16_000)
    samples = np.frombuffer(stretch_samples(audio, Stretch(1, 3)), "<i2")
    assert len(samples) == 320
    assert samples[0] == pytest.approx(16_383, abs=1)
    assert samples[-1] == -32_768


def test_fillers() -> None:
    assert all(is_filler(entry) for entry in ("<s>", "</s>", "[NOISE]", "++UH++"))
    assert not is_filler("'bout")


def test_without_its_language_model_it_says_what_to_do(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(word_search, "find_english_data", lambda: tmp_path)
    word_search._decoder.cache_clear()
    try:
        with pytest.raises(MissingDependencyError, match="pip install pocketsphinx"):
            words_in(b"")
    finally:
        word_search._decoder.cache_clear()
