"""Tells words from sounds and markup in labels, subtitles, scripts and recognised text."""

from __future__ import annotations

import html
import re
from collections import Counter
from collections.abc import Iterable
from enum import Enum
from itertools import pairwise

from lipmotion.errors import InputError
from lipmotion.types import TimedWord
from lipmotion.types.values import parse_clock
from lipmotion.units.text_normalisation import tokenise
from lipmotion.units.written_forms import list_readings

LINE_BREAK = re.compile(r"<(?:br|p|div)\b[^<>]{0,40}>", re.IGNORECASE)
TAG = re.compile(r"<rt>[^<>]{0,80}|</?[a-zA-Z!|][^<>]{0,200}>|<[\d:.]{1,20}>|\{[^{}]{0,200}\}")
"""Tags of SubRip (``<i>``), WebVTT (``<v Anna>``, ``<00:01.5>``), SubStation (``{\\an8}``), ``<unk>``, ``<|en|>``, and
how letters are read (``<rt>``)."""
SOUND = re.compile(r"\[[^\[\]]{0,200}\]|\((?!\d{3}\))[^()]{0,200}\)|（[^（）]{0,200}）")
"""Descriptions of sounds, as subtitles for the deaf and recognisers write them: ``[music]``, ``(laughs)``."""
DEED = re.compile(
    r"[*(](?i:(?:[a-z]+ly )?(?:clears?|clearing|(?:cough|laugh|giggle?|chuckle?|sigh|sniff|sneeze?|gasp|breathe?"
    r"|inhale?|exhale?|sob|groan|grunt|moan|snort|yawn|whistle?|scream|burp|gulp)(?:e?s|ing)?)"
    r"(?: (?:\w+ )?throat| \w+ly)?)[*)]"
)
"""What somebody does, as chats and texts for voices write it: ``*coughs*``, ``(clears throat)``."""
SPEAKER = re.compile(
    r"^[ \t>\-–—*_]{0,8}(?:\[([^\[\]\n:]{1,31})\]|([^\W\d_][\w.'’&# -]{0,30}?))"
    r"[ \t]*(\([^()\n]{1,30}\))?[ \t*_]*[:：][*_]*(?=\s|$)",
    re.MULTILINE,
)
"""What may be the name of a speaker: before a colon at the start of a line, perhaps with ``(V.O.)``."""
STAMP = re.compile(
    r"(?m)^[ \t]*(?:[^\W\d_][\w.'’ -]{0,30}?[ \t]+(?=[(\[]?[\d:]{4,8}[)\]]?[ \t]*$))?"
    r"[(\[]?((?:\d{1,2}:)?\d{1,2}:\d\d)(?:[.,]\d{1,3})?[)\]]?(?:[ \t]*$|[ \t]*[-–—|]?[ \t]+(?=\S))"
)
"""The time of a line of a transcript of the web, before it or above it: ``0:12 Hello``, ``Anna  0:12``."""
NUMBER = re.compile(
    r"(?m)^[ \t]*[(#]?(?:(\d{1,4})(?:[.):]+(?=\s|[^\W\d_])|[ \t]+[-–—](?=\s)|\t)|([a-z])\)(?=\s))[ \t]*(?=\S)"
)
"""The number of a line of a list, which is not said: ``1. Hello``, ``2) Hello``, ``a) Hello``."""
CUE = re.compile(r"(?:\A|(?<=\n\n))[ \t]*([A-Z][A-Z0-9.'’ -]{1,30}(?:\([^()\n]{1,20}\))?)[ \t]*\n(?=[^\n]*[a-z])")
"""A name in capitals above what that person says, as in screenplays."""
DIRECTION = re.compile(r"^[ \t]*(?:\([^()\n]{1,80}\)|(?:INT|EXT)\b[./][^\n]*)[ \t]*$", re.MULTILINE)
"""A line of a screenplay that is not spoken."""
SCRIPT = re.compile(r'[ \t]*(?:([a-z_]\w*)((?:[ \t]+[\w@-]+){0,3})[ \t]+)?"(?![a-z])(?:[^"\\\n]|\\.)*"[ \t]*')
"""A line of a game's script: who speaks, how he looks, and in quotes a sentence (``e happy "Hello"``)."""
NO_TAGS = frozenset("i he she we they you it and then but so or said says".split())
"""Words that begin a sentence with quotes in it."""
NO_NAMES = frozenset("note notes warning question answer step tip remember ps p.s example".split())
MARKED = r"[~%!]+(?:sp|(?:sil|pau|lau|noise|breath|inhal|exhal|cough|throat|lip|smack|sniff|sigh|click|music)\w*)"
"""Sounds with a mark before them: ``~SIL``, ``%noise``, ``!SIL``."""
SYMBOLS = re.compile(
    rf"&=\S+|%hesitation\b|(?<!\S){MARKED}(?!\S)|\b(?:xxx|yyy)\b|&[-+~](?=\w)|(?<!\w)%(?=[^\W\d])", re.IGNORECASE
)
"""CHAT's sounds (``&=laughs``) and words that nobody understood; of hesitations (``%uh``) the mark alone."""
SPEAKER_NAME_LINES = 3  # a name that begins this many lines is that of a speaker
LONGEST_LINE = 1 << 18  # maximum characters of a line: a label may hold four hours of speech
MAX_WORDS = 500_000  # maximum words of a transcript: twelve hours of the fastest speech on record


class SpokenAs(Enum):
    """What a label stands for."""

    SPEECH = "speech"
    SILENCE = "silence"
    UNKNOWN = "unknown"


SILENCES = frozenset(["", *"sil sp pau ssil nsn h# #h # ## _ - silence = vocnoise iver".split()])
"""Labels of silence, pauses and noise that is not speech; so is anything in brackets that is not of speech."""
LAUGHTER = "LAU"  # in capitals, as in lexicons of telephone speech; ``Lau`` is a name
UNKNOWN_WORDS = frozenset("spn unk oov xxx yyy usb".split())
"""Labels of speech of which nobody knows the words, also in brackets: of aligners, of CHAT, of WebMAUS (``<usb>``)."""
IN_BRACKETS = re.compile(
    r"<[^<>]*>|\[[^\[\]]*\]|\([^()]*\)|\{[^{}]*\}|\+\+?\w+\+\+?|&=\S+|♪+|\*+|" + MARKED + "|" + DEED.pattern
)
UNKNOWN_SPEECH = re.compile(r"unknown|unintelligible|inaudible|indistinct|garbage|spoken.?noise", re.IGNORECASE)


def classify_label(label: str) -> SpokenAs:
    """Return whether a whole label stands for silence or a sound, speech of unknown words, or speech.

    >>> classify_label("[laughs]"), classify_label("<unk>"), classify_label("hello")
    (<SpokenAs.SILENCE: 'silence'>, <SpokenAs.UNKNOWN: 'unknown'>, <SpokenAs.SPEECH: 'speech'>)
    """
    name = "sil" if label.strip() == LAUGHTER else label.strip().lower()
    bracketed = IN_BRACKETS.fullmatch(name) is not None
    inner = name.strip("<>[](){}+&=* ") if bracketed else name
    if inner in UNKNOWN_WORDS or (bracketed and UNKNOWN_SPEECH.search(inner)):
        return SpokenAs.UNKNOWN
    return SpokenAs.SILENCE if bracketed or name in SILENCES else SpokenAs.SPEECH


def extract_spoken_text(text: str, names: frozenset[str] = frozenset()) -> str:
    """Return what is spoken of a text; ``names``: of speakers, as ``find_speaker_names`` returns them."""
    text = LINE_BREAK.sub("\n", html.unescape(TAG.sub("", LINE_BREAK.sub("\n", text))))
    text = DEED.sub(" ", SOUND.sub(" ", TAG.sub("", text)))
    return remove_speakers(SYMBOLS.sub(" ", text), names)[0]


def remove_speakers(text: str, names: frozenset[str] = frozenset()) -> tuple[str, list[str]]:
    """Return a text without the names of speakers, and what was left out.

    Names are those in capitals and with a remark (``ANNA:``, ``Anna (V.O.):``, ``[Anna]:``), ``Speaker 1:``, those in
    ``names``, two lines or more in capitals above what is said, as in screenplays, and what stands before the quotes of
    a game's script, if all lines are such; also times before lines that rise from the first minute on, and numbers.
    """
    left_out: list[str] = []

    def leave_out(match: re.Match[str]) -> str:
        left_out.append(match[0].strip())
        return ""

    def leave_out_name(match: re.Match[str]) -> str:
        name = match[1] or match[2]
        in_capitals = name == name.upper() != name.lower()
        has_remark = match[1] or (match[3] and name[0].isupper())
        numbered = re.fullmatch(r"[Ss]peaker[ _]?\w{1,3}", name)
        return leave_out(match) if in_capitals or has_remark or numbered or name in names else match[0]

    times_s = [parse_clock(stamp[1]) for stamp in STAMP.finditer(text)]
    if times_s[:1] == [0] or (len(times_s) > 1 and times_s[0] < 60 and times_s == sorted({*times_s})):
        text = STAMP.sub(leave_out, text)
    numbers = [int(line[1] or ord(line[2])) for line in NUMBER.finditer(text)]
    if len(numbers) > 1 and all(b in (a + 1, 1, ord("a")) for a, b in pairwise(numbers)):
        text = NUMBER.sub(leave_out, text)
    cues = list(CUE.finditer(text))
    if len(cues) > 1 or any("(" in cue[1] for cue in cues):
        text = DIRECTION.sub(leave_out, CUE.sub(leave_out, text))
    text = SPEAKER.sub(leave_out_name, text)
    lines = [SCRIPT.fullmatch(line) for line in text.splitlines() if line.strip()]
    tags = [line[1] for line in lines if line and line[1]]
    if tags and all(lines) and not NO_TAGS & {*tags} and (len(lines) > 1 or not (lines[0] and lines[0][2])):
        text = re.sub(r'^[^"\n]+(?=")', leave_out, text, flags=re.MULTILINE)
    return text, [name for name in left_out if name]


def find_speaker_names(texts: Iterable[str]) -> frozenset[str]:
    """Return the names before a colon at the start of several lines, or of every one of two lines and more."""
    lines = [line for text in texts for line in text.splitlines() if line.strip()]
    matched = [match[2] for match in map(SPEAKER.match, lines) if match and match[2] and match[2].istitle()]
    names = {name: count for name, count in Counter(matched).items() if name.lower() not in NO_NAMES}
    in_all = len(matched) == len(lines) > 1
    return frozenset(name for name, count in names.items() if in_all or count >= SPEAKER_NAME_LINES)


def read_line_words(text: str, where: str) -> tuple[str, ...]:
    """Return the words of one line; ``where``: its place, for messages. Raises InputError: it is too long."""
    if len(text) > LONGEST_LINE:
        raise InputError(f"{where}: a line of {len(text)} characters, required at most {LONGEST_LINE}")
    return tokenise(text)


def time_words(
    text: str, start_s: float | None = None, end_s: float | None = None, where: str = "the transcript"
) -> list[TimedWord]:
    """Return the words of a line with times, shared by letters. Raises InputError: as ``read_line_words``."""
    words = read_line_words(text, where)
    if len(words) < 2 or start_s is None or end_s is None:
        return [TimedWord(word, start_s, end_s) for word in words]
    readings = ["".join(list_readings(word)[0]) for word in words]
    letters, done = sum(map(len, readings)), 0
    timed = []
    for word, reading in zip(words, readings, strict=True):
        first, done = done, done + len(reading)
        timed.append(TimedWord(word, *(start_s + (end_s - start_s) * share / letters for share in (first, done))))
    return timed


def check_word_count(count: int, where: str) -> None:
    """Raise InputError for more words than a recording has."""
    if count > MAX_WORDS:
        raise InputError(f"{where}: more than {MAX_WORDS} words; give those of one recording")
