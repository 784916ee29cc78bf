"""A synthesiser for machines without any: the project's own, saying words as the dictionary has them."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

from lipmotion import types, units
from lipmotion.speech.voices import installed
from lipmotion.speech.voices.synthesiser import ARPABET_PHONES, SynthesisedSentence, Synthesiser, SyntheticVoice
from pipeline.made import read_sound
from speech.sounds import write_wave
from testing.formant_synthesiser import synthesise

RATE_HZ, EACH_S = 22_050, 0.09
VOICES = (SyntheticVoice("one", "stand-in", "nobody"), SyntheticVoice("two", "stand-in", "nobody"))


def say(voice: str, texts: Sequence[str], folder: Path) -> Iterator[SynthesisedSentence]:
    """Yield texts, every phone of the same length, between short pauses."""
    path = folder / "said.wav"
    for text in texts:
        lexicon = units.Lexicon()
        words = [phone for word in units.split_words(text) for phone in lexicon.pronunciations(word)[0]]
        labels = ["sil", *words, "sil"]
        audio, timeline = synthesise([(label, EACH_S) for label in labels], rate_hz=RATE_HZ, seed=len(voice))
        write_wave(path, np.round(np.clip(audio.samples, -1, 1) * 32_767).astype(np.int16), RATE_HZ)
        spans = tuple(types.Span(span.start_s, span.end_s, span.label.phone) for span in timeline)
        yield SynthesisedSentence(read_sound(path), types.Timeline(spans), path)


def install(monkeypatch: pytest.MonkeyPatch, voices: tuple[SyntheticVoice, ...] = VOICES) -> None:
    """Make it the only synthesiser, with some voices."""
    only = Synthesiser("stand-in", "stand-in", lambda: voices, say, ARPABET_PHONES)
    monkeypatch.setattr(installed, "SYNTHESISERS", {"stand-in": only})
    monkeypatch.setattr(installed, "DEFAULT_VOICES", (("stand-in", "two"),))
