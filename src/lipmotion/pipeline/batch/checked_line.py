"""What is found in the recording of one line, and what is to be said in it: for the check, without any motion."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from lipmotion.errors import LipMotionError
from lipmotion.pipeline.batch.lines import BatchLine
from lipmotion.pipeline.job import Request
from lipmotion.pipeline.understand.read_request import read_request
from lipmotion.pipeline.understand.spoken_language import english_spoken
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.sound.pauses import levels_db, spoken_spans
from lipmotion.types import Audio, TimedTranscript
from lipmotion.types.audio import sixteen_bits
from lipmotion.types.languages import AUTO, ENGLISH, script_of
from lipmotion.units.languages_told import COMMON_WORDS, language_of_text
from lipmotion.units.mood_tags import tagged_text
from lipmotion.units.text_normalisation import words_in, written_words

SILENT_DB = -60.0
"""A recording that is nowhere louder, in dB of full scale, is silent."""
LEAST_SPOKEN_S = 0.1
"""A recording with less sound above its quiet level has nothing said in it."""
SHORTEST_TOLD_S, FEWEST_TOLD_WORDS = 8.0, 5
"""The language of shorter speech, or of fewer words, is not told: it takes a dozen long words to be sure."""
LETTERS_OF = {"CJK": 4.0, "HANGUL": 3.0, "HIRAGANA": 2.0, "KATAKANA": 2.0}
"""How many Latin letters take as long to say as one of a script."""


@dataclass(frozen=True)
class LineToCheck:
    """A line, and how it would be understood."""

    line: BatchLine
    request: Request


@dataclass(frozen=True)
class CheckedLine:
    """What was found in the recording and the words of a line.

    problem  : kind of what makes the recording of no use: ``missing``, ``unreadable``, ``silent``; empty: it is of use
    reason   : what is wrong with it, or with the language of words or speech; empty: nothing
    digest   : of the samples, the same for a sound under two names
    spoken_s : seconds from pause to pause, without the pauses
    letters  : of the words, as many as Latin letters would take as long
    words    : that are to be said; empty: not known
    """

    name: str
    problem: str = ""
    reason: str = ""
    digest: str = ""
    spoken_s: float = 0.0
    letters: float = 0.0
    words: tuple[str, ...] = ()


def checked_line(work: LineToCheck) -> CheckedLine:
    """Return what is found in the recording of a line, and what is to be said in it."""
    line, path = work.line, Path(work.line.recording)
    if not path.exists():
        return CheckedLine(line.name, "missing", f"{path}: no such file")
    try:
        audio = read_audio(path, warn=False)
        words = _words(work)
    except (LipMotionError, OSError) as error:
        return CheckedLine(line.name, "unreadable", str(error))
    levels = levels_db(audio)
    loudest_db = float(levels.max())
    if loudest_db < SILENT_DB:
        return CheckedLine(line.name, "silent", f"nowhere louder than {loudest_db:.0f} dB of full scale")
    spoken_s = sum(end_s - start_s for start_s, end_s in spoken_spans(levels))
    if spoken_s < LEAST_SPOKEN_S:
        return CheckedLine(line.name, "silent", "no sound longer than a click")
    return CheckedLine(
        line.name,
        reason=_wrong_language(work.request.language, words, audio, spoken_s),
        digest=hashlib.sha256(sixteen_bits(audio.samples).tobytes()).hexdigest(),
        spoken_s=spoken_s,
        letters=letters_of(words),
        words=words,
    )


def letters_of(words: Sequence[str]) -> float:
    """Return how many letters words have, those of other scripts as many as take as long to say.

    >>> letters_of(["ab", "c"]), letters_of(["你"])
    (3.0, 4.0)
    """
    return sum((LETTERS_OF.get(script_of(letter), 1.0) for word in words for letter in word), 0.0)


def _words(work: LineToCheck) -> tuple[str, ...]:
    """Return the words of a line without tags, numbers spelled out where they are English; none: they are not known."""
    line, request = work.line, work.request
    named = replace(request, recording=Path(line.recording), lexicon=None)
    given = line.transcript or read_request(named, words_beside=True).transcript
    if given is None or isinstance(given, TimedTranscript):
        return given.words if given else ()
    text = tagged_text(str(given)).text
    if request.language == ENGLISH:
        return words_in(text)
    return written_words(text) if text.strip() else ()


def _wrong_language(language: str, words: Sequence[str], audio: Audio, spoken_s: float) -> str:
    """Return what is wrong with the language of words and speech; empty: nothing that is known.

    language : that they should be in; ``AUTO``: both in the same one
    """
    told = language_of_text(words) if len(words) >= FEWEST_TOLD_WORDS else ""
    wanted = language if language != AUTO else told
    if told and wanted in COMMON_WORDS and told != wanted:
        return f"the words are in {told}, required {wanted}"
    if not wanted or spoken_s < SHORTEST_TOLD_S:
        return ""
    english = english_spoken(audio)
    if english is None or english == (wanted == ENGLISH):
        return ""
    return f"the speech is {'' if english else 'not '}English, required {wanted}"
