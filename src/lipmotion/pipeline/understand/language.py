"""The language of a request: its transcript in the words of that language, and what pronounces them."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from lipmotion.corpora.labels import read_transcript
from lipmotion.pipeline.understand.request import SpeechRequest
from lipmotion.speech.voices.pronunciations import LanguageLexicon
from lipmotion.types import TimedTranscript, TimedWord, TranscriptLine
from lipmotion.types.languages import ENGLISH
from lipmotion.units.text_normalisation import written_words

LOG = logging.getLogger("lipmotion")


def in_language(request: SpeechRequest) -> SpeechRequest:
    """Return a request whose words are those of its language, with the lexicon that pronounces them.

    A request in English stays as it is.
    Raises InputError: the transcript cannot be read, or has words that nobody pronounces. Raises
    MissingDependencyError: there is neither espeak-ng nor a lexicon with the words.
    """
    if request.language == ENGLISH:
        return request
    lexicon = LanguageLexicon(request.lexicon.user if request.lexicon else {}, request.language)
    given = request.transcript
    text = read_transcript(given) if isinstance(given, Path) else given
    transcript = _plain_transcript(written_words(text)) if isinstance(text, str) else text
    if transcript is not None and request.units is None:
        lexicon = lexicon.with_words(transcript.words)
    return replace(request, transcript=transcript, lexicon=lexicon)


def _plain_transcript(words: Sequence[str]) -> TimedTranscript:
    """Return words without times as a transcript."""
    return TimedTranscript((TranscriptLine(tuple(map(TimedWord, words))),))
