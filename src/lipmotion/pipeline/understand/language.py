"""The language of a request: its transcript in the words of that language, and what pronounces them."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import cast

from lipmotion.errors import InputError
from lipmotion.pipeline.request import Request
from lipmotion.pipeline.understand.read_request import lexicon_of
from lipmotion.pipeline.understand.spoken_language import english_spoken
from lipmotion.pipeline.understand.understood_speech import audio_of
from lipmotion.speech.voices.pronunciations import LanguageLexicon
from lipmotion.types import TimedTranscript, TimedWord, TranscriptLine
from lipmotion.types.languages import AUTO, ENGLISH, LANGUAGES
from lipmotion.units.language_detection import detect_language
from lipmotion.units.mood_tags import parse_tagged_text
from lipmotion.units.text_normalisation import split_written_words

LOG = logging.getLogger("lipmotion")


def in_language(request: Request) -> Request:
    """Return a request, of ``read_request``, whose words are those of its language, with the lexicon that has them.

    A request in English stays as it is. ``AUTO`` stays where the speech is known not to be English, and no more.
    Raises InputError: the transcript cannot be read, or has words that nobody pronounces. Raises
    MissingDependencyError: there is neither espeak-ng nor a lexicon with the words.
    """
    if request.language == ENGLISH:
        return request
    transcript = cast("str | TimedTranscript | None", request.transcript)
    if isinstance(transcript, str):
        transcript = _plain_transcript(transcript)
    language = request.language if request.language != AUTO else _told(request, transcript)
    if language in (ENGLISH, AUTO):
        return replace(request, language=language)
    lexicon = LanguageLexicon(lexicon_of(request).user, language)
    if transcript is not None and request.units is None:
        transcript = transcript.with_words(
            lambda word: split_written_words(word) if any(map(str.isalnum, word)) else ()
        )
        lexicon = lexicon.with_words(transcript.words)
    return replace(request, language=language, transcript=transcript, lexicon=lexicon)


def _told(request: Request, transcript: TimedTranscript | None) -> str:
    """Return the language of a request that names none; a warning says which.

    Without a transcript: ``AUTO``, where it is not English; English also where it is not known, as without the option.
    Raises InputError: that of a transcript is not known.
    """
    if transcript is not None and request.units is None:
        language = detect_language(transcript.words)
        if not language:
            raise InputError(f"the language of the transcript is not known; give it, one of: {', '.join(LANGUAGES)}")
        LOG.warning("the transcript is taken for %s; --language says otherwise", LANGUAGES[language].name)
        return language
    english = english_spoken(audio_of(request))
    LOG.warning(
        {
            True: "the speech is taken for English; --language says otherwise",
            False: "the speech is not English, in which language it is is not known; give it with --language",
            None: "the language of the speech is not known, English is assumed; give it with --language",
        }[english]
    )
    return AUTO if english is False else ENGLISH


def _plain_transcript(text: str) -> TimedTranscript:
    """Return the words of a text, without times, as a transcript. Raises InputError: there is no word in it."""
    plain, tags = parse_tagged_text(text, lambda part: split_written_words(part) if part.strip() else ())
    return TimedTranscript((TranscriptLine(tuple(map(TimedWord, split_written_words(plain)))),), tags)
