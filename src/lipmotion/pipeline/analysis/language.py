"""The language of a request, found by its transcript and its sound."""

from __future__ import annotations

import logging
from dataclasses import replace
from itertools import groupby
from typing import cast

from lipmotion.errors import InputError
from lipmotion.pipeline.analysis.read_request import read_lexicon, read_recording
from lipmotion.pipeline.request import Request
from lipmotion.speech.recognition.network.posteriors import WORD_BOUNDARY, find_installed_recogniser, find_stretches
from lipmotion.speech.recognition.recognised_speech import Recognition
from lipmotion.speech.sound.analysed_audio import analysed
from lipmotion.types import Audio, TimedTranscript, TimedWord, TranscriptLine
from lipmotion.types.languages import AUTO, ENGLISH, LANGUAGES
from lipmotion.units.ipa_phones import read_tokens
from lipmotion.units.lexicon import detect_language, is_english
from lipmotion.units.spoken_text import parse_tagged_text
from lipmotion.units.text_normalisation import split_written_words

LOG = logging.getLogger("lipmotion")
MIN_CONFIDENCE = 0.4
"""English words are recognised with at least this confidence in clear English (0.8 to 0.9 there), and with less in
other languages and in English played backwards (0.18 to 0.25), and in noise."""
MIN_TOLD_S = 1.0  # speech that lasts less says nothing of its language
PART_S = 28.0  # so many seconds from the beginning of a recording tell its language


def resolve_language(request: Request) -> Request:
    """Return a request, of ``read_request``, whose words are those of its language, with the lexicon that has them.

    A request in English stays as it is. ``AUTO`` stays where the speech is known not to be English, and no more.
    Raises InputError: the transcript cannot be read, or has words that nobody pronounces. Raises
    MissingDependencyError: there is neither espeak-ng nor a lexicon with the words.
    """
    if request.language == ENGLISH:
        return request
    transcript = cast("str | TimedTranscript | None", request.transcript)
    if isinstance(transcript, str):
        plain, tags = parse_tagged_text(transcript, lambda part: split_written_words(part) if part.strip() else ())
        transcript = TimedTranscript((TranscriptLine(tuple(map(TimedWord, split_written_words(plain)))),), tags)
    language = request.language if request.language != AUTO else _detect_language(request, transcript)
    if language in (ENGLISH, AUTO):
        return replace(request, language=language)
    from lipmotion.speech.voices.espeak import LanguageLexicon

    lexicon = LanguageLexicon(read_lexicon(request).user, language)
    if transcript is not None and request.units is None:
        transcript = transcript.with_words(
            lambda word: split_written_words(word) if any(map(str.isalnum, word)) else ()
        )
        lexicon = lexicon.with_words(transcript.words)
    return replace(request, language=language, transcript=transcript, lexicon=lexicon)


def _detect_language(request: Request, transcript: TimedTranscript | None) -> str:
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
    english = detect_english(read_recording(request))
    LOG.warning(
        {
            True: "the speech is taken for English; --language says otherwise",
            False: "the speech is not English, in which language it is is not known; give it with --language",
            None: "the language of the speech is not known, English is assumed; give it with --language",
        }[english]
    )
    return AUTO if english is False else ENGLISH


def detect_english(audio: Audio) -> bool | None:
    """Return whether a recording is in English; None: not known, or no phone recogniser is installed.

    audio : at 16 kHz
    The network writes every language with the phones of English: it cannot say which other one it is.
    """
    if find_installed_recogniser() is None:
        return None
    part = analysed(Audio(audio.samples[: int(PART_S * audio.rate_hz)], audio.rate_hz))
    tokens = [
        token
        for _, posteriors in find_stretches(part)
        for token in (*(each.token for each in posteriors.best_tokens), WORD_BOUNDARY)
    ]
    words = (list(group) for ends, group in groupby(tokens, WORD_BOUNDARY.__eq__) if not ends)
    return is_english(tuple(phone for phone, _ in read_tokens(word)) for word in words)


def weigh_words(recognition: Recognition) -> float:
    """Return the confidence of recognised words times their share of the speech, 0 to 1."""
    return (recognition.confidence or 0.0) * recognition.word_s / max(recognition.word_s + recognition.phone_s, 1e-9)


def warn_of_another_language(recognition: Recognition) -> None:
    """Log a warning where English words were recognised in what is hardly English."""
    confidence = weigh_words(recognition)
    if recognition.word_s >= MIN_TOLD_S and confidence < MIN_CONFIDENCE:
        LOG.warning(
            "the words are hardly understood (confidence %.2f, required %.1f): the speech may not be English, then "
            "give its language (--language es, fr, de, ...); or it is noisy, then give its words (--transcript)",
            *(confidence, MIN_CONFIDENCE),
        )
