"""Tells words from sounds, markup and names in labels, subtitles, scripts and recognised text, and from tags of moods.

Tags stand in the text of what is said: ``[angry]``, ``<smile>``, ``[sad:0.6]``; none of them is spoken.
"""

from __future__ import annotations

import html
import logging
import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from enum import Enum
from itertools import pairwise
from typing import NamedTuple

from lipmotion.errors import InputError, shorten
from lipmotion.types import TimedWord, Timeline, Unit
from lipmotion.types.delivery import MANNERS, MOODS, NEUTRAL, PLAIN, MoodKey, MoodTag, sort_moods
from lipmotion.types.values import parse_clock
from lipmotion.units.phone_timelines import group_words
from lipmotion.units.spelling import read_table
from lipmotion.units.text_normalisation import find_words, tokenise
from lipmotion.units.written_forms import list_readings

LINE_BREAK = re.compile(r"<(?:br|p|div)\b[^<>]{0,40}>", re.IGNORECASE)
MARKUP = re.compile(r"<rt>[^<>]{0,80}|</?[a-zA-Z!|][^<>]{0,200}>|<[\d:.]{1,20}>|\{[^{}]{0,200}\}")
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
    text = LINE_BREAK.sub("\n", html.unescape(MARKUP.sub("", LINE_BREAK.sub("\n", text))))
    text = DEED.sub(" ", SOUND.sub(" ", MARKUP.sub("", text)))
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


LOG = logging.getLogger("lipmotion")
TAG = re.compile(
    r"[\[<{](/?)([^\W\d_][^\[\]<>{}\n]{0,80})[\]>}]|\*(?P<did>[a-z]+s)\*|"
    + DEED.pattern
    + r"|<<[^<>\n]{1,200}>>|<[/!#?|][^<>\n]{0,80}>|\\[nN]|\{[^{}\n]{0,200}\}|\[/?\]|\[\d[\d:.,]{0,12}m?s?\]"
    r"|\([a-z-]{2,20}: ?[$\"'][^()\n]{0,200}\)|#line:\w+|\[\[(?:slnc|rate|volm|pbas|emph|inpt|rset)\b[^\[\]\n]{0,80}]]"
)
"""Tags of moods, and markup of games and voices (Ren'Py, Unity, Yarn, Twine, SSML): ``{w=0.5}``, ``<color=red>``."""
LINK = re.compile(
    r"\[\[(?!(?:slnc|rate|volm|pbas|emph|inpt|rset)\b)(?:[^\[\]\n]*<-)?([^\[\]|\n]*?)(?:(?:\||->)[^\[\]\n]*)?\]\]"
    r"|!?\[([^\[\]\n]{0,200})\]\([^()\s]{1,400}\)"
)
"""A link (``[[Go north|North]]``, ``[our site](https://example.org)``), of which what is shown is spoken."""
INSIDE_WORDS = frozenset("a b i u s em strong mark sub sup font span color colour size wave shake".split())
"""Tags of style, which may stand inside a word."""
_NAME = re.compile(r"([a-z][a-z '-]*?)\s*(?::\s*(\d*\.?\d+))?")
SYNONYMS: dict[str, tuple[str, float]] = {
    word: (mood, float(strength))
    for meaning, words in read_table("moods").items()
    for mood, strength in [meaning.split()]
    for word in words.split()
} | {name: (name, 1.0) for name in (NEUTRAL, *MOODS, PLAIN, *MANNERS)}
"""The words of tags that are understood, and what they mean."""


class TaggedText(NamedTuple):
    """What is spoken of a text, and the moods that its tags ask for."""

    text: str
    tags: tuple[MoodTag, ...]


def parse_tagged_text(text: str, words: Callable[[str], Sequence[str]] = find_words) -> TaggedText:
    """Return what is spoken of a text, and its tags; a text without tags is returned as it is.

    words : returns the words of a text
    A tag holds until the next one of its kind, mood or manner; ``</smile>`` ends in a neutral face. What else is not
    spoken, other tags and the names of speakers before what they say, is named in a warning.

    >>> parse_tagged_text("[sad:0.5] I know. <smile>But</smile> so what")
    TaggedText(text='  I know.  But  so what', tags=(MoodTag(share=0.0, mood='sad', strength=0.5), \
MoodTag(share=0.4, mood='happy', strength=0.6), MoodTag(share=0.6, mood='neutral', strength=1.0)))
    """
    text, unknown = remove_speakers(LINK.sub(r"\1\2", text), find_speaker_names([text]))
    spoken, tags, last = "", [], 0
    for tag in TAG.finditer(text):
        meaning = _meaning(tag)
        if tag["did"] and meaning is None and not DEED.fullmatch(tag[0]):
            continue
        name = re.split(r"[\W_]", tag[2] or "", maxsplit=1)[0]
        spoken += text[last : tag.start()] + " " * (meaning is not None or name.lower() not in INSIDE_WORDS)
        last = tag.end()
        if meaning is None:
            unknown.append(tag[0])
        else:
            tags.append((len(words(spoken)), *meaning))
    spoken += text[last:]
    if not tags and not unknown:
        return TaggedText(text, ())
    if unknown:
        named = ", ".join(map(shorten, dict.fromkeys(unknown)))
        LOG.warning("not known, and not spoken: %s; known tags are [happy], [sad:0.5], ... (docs/expression.md)", named)
    count = max(len(words(spoken)), 1)
    return TaggedText(spoken, tuple(MoodTag(before / count, mood, strength) for before, mood, strength in tags))


def remove_known_tags(text: str) -> str:
    """Return a text without the tags that are understood."""
    return TAG.sub(lambda tag: " " if _meaning(tag) else tag[0], text)


def time_moods(tags: Sequence[MoodTag], units: Timeline[Unit]) -> tuple[MoodKey, ...]:
    """Return the moods of tags at the times of the words (or phones) after them; the last ones at the end of speech."""
    words = [(span.start_s, span.end_s) for span in group_words(units) if span.label]
    spans = words or [(span.start_s, span.end_s) for span in units]
    if not tags or not spans:
        return ()
    keys = []
    for tag in tags:
        place = round(tag.share * len(spans))
        time_s = 0.0 if place == 0 else spans[place][0] if place < len(spans) else spans[-1][1]
        keys.append(MoodKey(max(time_s, 0.0), tag.mood, tag.strength))
    return sort_moods(keys)


def _meaning(tag: re.Match[str]) -> tuple[str, float] | None:
    name = _NAME.fullmatch((tag[2] or tag["did"] or "").strip().lower())
    known = SYNONYMS.get(name[1]) if name else None
    if name is None or known is None:
        return None
    if tag[1]:
        return PLAIN if known[0] in MANNERS else NEUTRAL, 1.0
    return known[0], min(float(name[2]), 1.0) if name[2] else known[1]
