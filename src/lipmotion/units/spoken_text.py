"""What is a word, a sound or markup in labels, subtitles and recognised text: the one place that decides."""

from __future__ import annotations

import html
import re
from collections import Counter
from collections.abc import Iterable
from enum import Enum

from lipmotion.errors import InputError
from lipmotion.types import TimedWord
from lipmotion.units.text_normalisation import words_in

TAG = re.compile(r"</?[a-zA-Z!][^<>]{0,200}>|<[\d:.]{1,20}>|\{[^{}]{0,200}\}")
"""Tags of SubRip and WebVTT (``<i>``, ``<v Anna>``, ``<00:01.500>``), of SubStation (``{\\an8}``), and ``<unk>``."""
SOUND = re.compile(r"\[[^\[\]]{0,200}\]|\([^()]{0,200}\)|（[^（）]{0,200}）")
"""Descriptions of sounds, as subtitles for the deaf and recognisers write them: ``[music]``, ``(laughs)``."""
SPEAKER = re.compile(
    r"^[ \t>\-–—]{0,8}(?:[A-Z][A-Z0-9.'_#& -]{0,30}|[Ss]peaker[ _]?\w{1,3})[ \t]*:(?=\s|$)", re.MULTILINE
)
"""A name in capitals, or ``Speaker 1``, before a colon at the start of a line."""
NAME = re.compile(r"^[ \t>\-–—]{0,8}([A-Z][\w.'-]{0,30}(?: [A-Z][\w.'-]{0,30}){0,3})[ \t]*:(?=\s)", re.MULTILINE)
"""What may be the name of a speaker, as programs for meetings write it."""
SYMBOLS = re.compile(r"&=\S+|%hesitation\b|\b(?:xxx|yyy)\b|&[-+~](?=\w)|(?<!\w)%(?=[^\W\d])", re.IGNORECASE)
"""CHAT's sounds (``&=laughs``) and words that nobody understood; of hesitations (``%uh``) the mark alone."""
SPEAKER_NAME_LINES = 3
"""A name that begins so many lines is that of a speaker."""
LONGEST_LINE = 1 << 18
"""Most characters of a line: a label may hold four hours of speech."""
MOST_WORDS = 500_000
"""Most words of a transcript: twelve hours of the fastest speech on record."""


class SpokenAs(Enum):
    """What a label stands for."""

    SPEECH = "speech"
    SILENCE = "silence"
    UNKNOWN = "unknown"


SILENCES = frozenset(["", *"sil sp pau ssil nsn h# #h # ## _ - silence = vocnoise iver".split()])
"""Labels of silence, pauses and noise that is not speech; so is anything in brackets that is not of speech."""
UNKNOWN_WORDS = frozenset("spn unk oov xxx yyy usb".split())
"""Labels of speech of which nobody knows the words, also in brackets: of aligners, of CHAT, of WebMAUS (``<usb>``)."""
IN_BRACKETS = re.compile(r"<[^<>]*>|\[[^\[\]]*\]|\([^()]*\)|\{[^{}]*\}|\+\+?\w+\+\+?|&=\S+|♪+|\*+")
UNKNOWN_SPEECH = re.compile(r"unknown|unintelligible|inaudible|indistinct|garbage|spoken.?noise", re.IGNORECASE)


def spoken_as(label: str) -> SpokenAs:
    """Return whether a whole label stands for silence or a sound, speech of unknown words, or speech.

    >>> spoken_as("[laughs]"), spoken_as("<unk>"), spoken_as("hello")
    (<SpokenAs.SILENCE: 'silence'>, <SpokenAs.UNKNOWN: 'unknown'>, <SpokenAs.SPEECH: 'speech'>)
    """
    name = label.strip().lower()
    bracketed = IN_BRACKETS.fullmatch(name) is not None
    inner = name.strip("<>[](){}+&=* ") if bracketed else name
    if inner in UNKNOWN_WORDS or (bracketed and UNKNOWN_SPEECH.search(inner)):
        return SpokenAs.UNKNOWN
    return SpokenAs.SILENCE if bracketed or name in SILENCES else SpokenAs.SPEECH


def spoken_text(text: str, names: frozenset[str] = frozenset()) -> str:
    """Return what is spoken of a text; ``names``: of speakers, as ``speaker_names`` returns them."""
    text = SOUND.sub(" ", TAG.sub("", html.unescape(TAG.sub("", text))))
    text = SPEAKER.sub("", SYMBOLS.sub(" ", text))
    return NAME.sub(lambda found: "" if found[1] in names else found[0], text) if names else text


def speaker_names(texts: Iterable[str]) -> frozenset[str]:
    """Return the names that stand before a colon at the start of several lines."""
    counts = Counter(found[1] for text in texts for found in NAME.finditer(text))
    return frozenset(name for name, count in counts.items() if count >= SPEAKER_NAME_LINES)


def line_words(text: str, where: str) -> tuple[str, ...]:
    """Return the words of one line; ``where``: its place, for messages. Raises InputError: it is too long."""
    if len(text) > LONGEST_LINE:
        raise InputError(f"{where}: a line of {len(text)} characters, required at most {LONGEST_LINE}")
    return words_in(text)


def timed_words(
    text: str, start_s: float | None = None, end_s: float | None = None, where: str = "the transcript"
) -> list[TimedWord]:
    """Return the words of a line with the times of the whole: several words share them by their letters.

    Raises InputError: as ``line_words``.
    """
    words = line_words(text, where)
    if len(words) < 2 or start_s is None or end_s is None:
        return [TimedWord(word, start_s, end_s) for word in words]
    letters, done = sum(map(len, words)), 0
    timed = []
    for word in words:
        first, done = done, done + len(word)
        timed.append(TimedWord(word, *(start_s + (end_s - start_s) * share / letters for share in (first, done))))
    return timed


def check_word_count(count: int, where: str) -> None:
    """Raise InputError for more words than a recording has."""
    if count > MOST_WORDS:
        raise InputError(f"{where}: more than {MOST_WORDS} words; give those of one recording")
