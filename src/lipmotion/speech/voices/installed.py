"""The installed synthetic voices, and sentences spoken by them."""

from __future__ import annotations

import tempfile
from collections.abc import Generator, Sequence
from contextlib import closing
from pathlib import Path

from lipmotion.errors import InputError, MissingDependencyError
from lipmotion.speech.voices.espeak import ESPEAK_NG
from lipmotion.speech.voices.festival import FESTIVAL
from lipmotion.speech.voices.flite import FLITE
from lipmotion.speech.voices.inventory_phones import inventory_timeline
from lipmotion.speech.voices.synthesiser import Synthesiser, SyntheticVoice
from lipmotion.types import Audio, Timeline, Unit
from lipmotion.units import Lexicon, words_of

SYNTHESISERS: dict[str, Synthesiser] = {synthesiser.name: synthesiser for synthesiser in (FLITE, FESTIVAL, ESPEAK_NG)}


def installed_voices() -> tuple[SyntheticVoice, ...]:
    """Return the English voices of the synthesisers that are installed; none where none is."""
    return tuple(voice for synthesiser in SYNTHESISERS.values() for voice in synthesiser.voices())


def speak_sentence(text: str, voice: SyntheticVoice, lexicon: Lexicon | None = None) -> tuple[Audio, Timeline[Unit]]:
    """Return a sentence in a voice: the sound at 16 kHz, and its phones in time, from 0 s to its end.

    lexicon : its pronunciations tell which vowels are unstressed; the built-in one by default
    Raises the errors of ``speak_sentences``.
    """
    with closing(speak_sentences([text], voice, lexicon)) as sentences:
        return next(sentences)


def speak_sentences(
    texts: Sequence[str], voice: SyntheticVoice, lexicon: Lexicon | None = None
) -> Generator[tuple[Audio, Timeline[Unit]], None, None]:
    """Yield several sentences in a voice, as of ``speak_sentence``; where possible, one run of the program makes all.

    Raises MissingDependencyError: the synthesiser is not installed (the message names the package).
    Raises InputError: no such synthesiser or voice, a text without a word, or one that the synthesiser cannot say.
    """
    lexicon = lexicon or Lexicon()
    synthesiser = _synthesiser(voice)
    words = [words_of(text) for text in texts]
    with tempfile.TemporaryDirectory(prefix="lipmotion-voices-") as folder:
        plain = [" ".join(text.split()) for text in texts]
        sentences = synthesiser.synthesise(voice.name, plain, Path(folder)) if plain else iter(())
        for sentence, its_words in zip(sentences, words, strict=True):
            audio, phone_map = sentence.audio, synthesiser.phone_map
            yield audio, inventory_timeline(sentence.phones, phone_map, its_words, lexicon, audio.duration_s)


def _synthesiser(voice: SyntheticVoice) -> Synthesiser:
    synthesiser = SYNTHESISERS.get(voice.synthesiser)
    if synthesiser is None:
        raise InputError(f"unknown synthesiser {voice.synthesiser!r}; required one of: {', '.join(SYNTHESISERS)}")
    names = [known.name for known in synthesiser.voices()]
    if not names:
        raise MissingDependencyError(
            f"{synthesiser.name} is not installed, or has no English voice: apt install {synthesiser.package}"
        )
    if voice.name not in names:
        raise InputError(f"{synthesiser.name} has no voice {voice.name!r} here; it has: {', '.join(names)}")
    return synthesiser
