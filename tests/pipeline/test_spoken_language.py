"""Whether a recording is in English: said only where it is known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lipmotion.pipeline.analysis import spoken_language
from lipmotion.pipeline.analysis.spoken_language import detect_english, warn_of_another_language
from lipmotion.speech.recognition.recognised_speech import RecognisedWord, Recognition
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.types import Audio, Span, Timeline

EXAMPLES = Path(__file__).parents[2] / "examples"


def test_nothing_is_said_without_the_network_or_speech(monkeypatch: pytest.MonkeyPatch) -> None:
    silence = Audio(np.zeros(16_000, np.float32), 16_000)
    assert detect_english(silence) is None
    monkeypatch.setattr(spoken_language, "installed_phone_recogniser", lambda: None)
    assert detect_english(silence) is None


@pytest.mark.long
def test_the_words_of_english_are_known() -> None:
    pytest.importorskip("hama.asr")
    welcome = read_audio(EXAMPLES / "welcome.flac").samples
    assert detect_english(Audio(np.tile(welcome, 4), 16_000)) is True
    assert detect_english(Audio(np.tile(welcome[::-1], 4), 16_000)) is not True


@pytest.mark.parametrize(("confidence", "lasts_s", "warns"), [(0.2, 2.0, True), (0.85, 2.0, False), (0.2, 0.5, False)])
def test_words_that_are_hardly_understood_are_told(
    confidence: float, lasts_s: float, warns: bool, caplog: pytest.LogCaptureFixture
) -> None:
    words = Timeline((Span(0.0, lasts_s, RecognisedWord("hola", confidence)),))
    warn_of_another_language(Recognition(Timeline(()), words, lasts_s, 0.0, None))
    assert ("--language" in caplog.text) == warns
    assert (f"confidence {confidence:.2f}" in caplog.text) == warns
