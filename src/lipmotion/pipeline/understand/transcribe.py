"""Phones in time of recordings: by forced alignment of a transcript, or by recognition."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from lipmotion.corpora.labels import check_plain_text, read_transcript
from lipmotion.errors import shortened
from lipmotion.hmm.loudness import frames_above
from lipmotion.speech.features.analysed_audio import analysed
from lipmotion.speech.recognition.agreement import DOUBTFUL_SCORE, TranscriptFit, transcript_fit
from lipmotion.speech.recognition.anchors import anchors_of, fitted
from lipmotion.speech.recognition.network.posteriors import POSTERIOR_STEP, recording_posteriors
from lipmotion.speech.recognition.recogniser import Recogniser, network_of
from lipmotion.speech.recognition.transcript_evidence import DOUBTFUL_LOSS, transcript_evidence
from lipmotion.speech.voices.pronunciations import LanguageLexicon
from lipmotion.storage.files import read_text_file
from lipmotion.types import FRAME_RATE_HZ, Audio, Features, TimedTranscript, Timeline, Unit
from lipmotion.units import Lexicon, Pronunciation, check_words
from lipmotion.units.length_limits import LARGEST_TRANSCRIPT_BYTES

__all__ = [
    "Transcription",
    "guesses",
    "phones_in_time",
    "read_plain_text",
    "read_transcript",
    "transcribe",
    "warn_of_guesses",
]
LOG = logging.getLogger("lipmotion")
MOST_WARNINGS = 20
"""Largest number of guessed pronunciations that are reported one by one."""
FOREIGN_SHARE, LEAST_FOREIGN = 0.25, 3
"""A text of which so large a share, and so many different words, are not in the dictionary is not English."""
MOST_STRETCHES = 3
"""Largest number of stretches without words that are named in one warning."""


class Transcription(NamedTuple):
    """Phones in time of a recording, and how well the transcript fits.

    fit : None where there was no transcript, or it was not compared with the sound (general phone models are needed)
    """

    units: Timeline[Unit]
    fit: TranscriptFit | None


def transcribe(
    phones: Recogniser,
    audio: Audio,
    features: Features,
    words: Sequence[str] | TimedTranscript | None,
    lexicon: Lexicon,
) -> Transcription:
    """Return the phones in time of a recording, with warnings for the user.

    phones   : the recogniser
    features : of the audio, from ``mfcc``
    words    : the spoken words in lower case, also with times, within which they are aligned; or None
    Warnings are logged for guessed pronunciations and, with general phone models, for words that do not agree with the
    sound, and speech that the words leave out. Of English words, a phone recogniser judges, where one is installed.
    Raises AlignmentError: the words cannot be aligned with the recording.
    """
    if isinstance(words, TimedTranscript):
        words = fitted(words, frames_above(analysed(audio, features).log_energy), audio.duration_s)
    spoken = words.words if isinstance(words, TimedTranscript) else words or ()
    if is_other_language(spoken, lexicon):
        LOG.warning(
            "the transcript seems not to be English: its words are read by English rules, and the lips will be wrong; "
            "give its language (--language)"
        )
    else:
        warn_of_guesses(spoken, lexicon)
    units = phones_in_time(phones, audio, features, words, lexicon)
    if words is None or phones.kind == "own":
        return Transcription(units, None)
    fit = transcript_fit(audio, units)
    name = None if isinstance(lexicon, LanguageLexicon) else network_of(phones.kind)
    if name is not None:
        posteriors = recording_posteriors(name, analysed(audio)).of_phones.astype(float)
        fit = fit.with_evidence(transcript_evidence(posteriors, POSTERIOR_STEP / FRAME_RATE_HZ, units))
    warn_of_misfit(fit)
    return Transcription(units, fit)


def phones_in_time(
    phones: Recogniser,
    audio: Audio,
    features: Features,
    words: Sequence[str] | TimedTranscript | None,
    lexicon: Lexicon,
) -> Timeline[Unit]:
    """Return the phones in time of a recording as ``transcribe`` does, without warnings."""
    if words is None:
        return phones.recognise(audio, features)
    anchors = None
    if isinstance(words, TimedTranscript):
        anchors, words = anchors_of(words) if words.has_times else None, words.words
    check_words(words, audio.duration_s)
    return phones.align(audio, features, words, lexicon, anchors)


def read_plain_text(path: Path) -> str:
    """Return the text of a file of words alone.

    Raises InputError: no such file, larger than ``LARGEST_TRANSCRIPT_BYTES``, not UTF-8 text, or labels in time.
    """
    text = read_text_file(path, "transcript", LARGEST_TRANSCRIPT_BYTES)
    check_plain_text(text, str(path))
    return text


def warn_of_misfit(fit: TranscriptFit) -> None:
    """Log a warning if a transcript seems to be of something else, or to leave out speech."""
    if fit.is_doubtful:
        LOG.warning(
            "the transcript seems not to be what is said (%s)%s; check it, or leave it out",
            *(_judgement(fit), f" or to leave out words {_places(fit)}" if fit.missing else ""),
        )
    elif fit.missing:
        LOG.warning(
            "the transcript seems to leave out words %s: the lips are wrong there; add the words, or leave the whole "
            "transcript out",
            _places(fit),
        )
    elif fit.unsaid:
        named = [f"{shortened(word.word)!r} at {word.start_s:.1f} s" for word in fit.unsaid[:MOST_STRETCHES]]
        more = len(fit.unsaid) - MOST_STRETCHES
        LOG.warning(
            "the transcript seems to have words that are not said: %s%s; correct it",
            *(", ".join(named), f" and {more} more" if more > 0 else ""),
        )


def _judgement(fit: TranscriptFit) -> str:
    """Return why a transcript is doubtful: value found, value required."""
    if fit.evidence is not None:
        return f"its phones are missed by {fit.evidence.loss:.1f} nats each, required {DOUBTFUL_LOSS} or less"
    return f"its phones agree with the sound at {fit.score:.1f}, required {DOUBTFUL_SCORE} or more"


def _places(fit: TranscriptFit) -> str:
    """Return where words are missing, the longest stretches, and how much of the speech that is, for a message."""
    longest = sorted(fit.missing, key=lambda stretch: stretch[0] - stretch[1])[:MOST_STRETCHES]
    named = ", ".join(f"{start_s:.1f} to {end_s:.1f} s" for start_s, end_s in sorted(longest))
    more = len(fit.missing) - MOST_STRETCHES
    others = f" and at {more} more places" if more > 0 else ""
    return f"at {named}{others} ({fit.missing_s:.1f} of {fit.speech_s:.1f} s of speech)"


def is_other_language(words: Sequence[str], lexicon: Lexicon) -> bool:
    """Return whether words seem to be of another language than their lexicon."""
    unknown = [word for word in words if not lexicon.known(word)]
    return len({*unknown}) >= LEAST_FOREIGN and len(unknown) >= FOREIGN_SHARE * len(words)


def guesses(words: Sequence[str], lexicon: Lexicon) -> dict[str, Pronunciation]:
    """Return the first ``MOST_WARNINGS`` words whose pronunciation is a guess, with it."""
    return {word: lexicon.pronunciations(word)[0] for word in _unknown(words, lexicon)[:MOST_WARNINGS]}


def _unknown(words: Sequence[str], lexicon: Lexicon) -> list[str]:
    return [word for word in dict.fromkeys(words) if not lexicon.known(word)]


def warn_of_guesses(words: Sequence[str], lexicon: Lexicon) -> None:
    """Log a warning for every word whose pronunciation is a guess; after ``MOST_WARNINGS``, for how many more."""
    for word, guessed in guesses(words, lexicon).items():
        told = map(shortened, (word, " ".join(guessed)))
        LOG.warning("%r is not in the dictionary; read as %r; a lexicon file can say better", *told)
    more = len(_unknown(words, lexicon)) - MOST_WARNINGS
    if more > 0:
        LOG.warning("%d more words are not in the dictionary; a lexicon file can say better", more)
