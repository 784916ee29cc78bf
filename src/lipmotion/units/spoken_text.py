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
from pathlib import Path
from typing import NamedTuple

from lipmotion.errors import InputError, shorten
from lipmotion.types import TimedWord, Timeline, Unit
from lipmotion.types.delivery import MANNERS, MOODS, NEUTRAL, PLAIN, MoodKey, MoodTag, sort_moods
from lipmotion.types.values import parse_clock
from lipmotion.units.phone_timelines import group_words
from lipmotion.units.spelling import read_patterns, read_table
from lipmotion.units.text_normalisation import find_words, tokenise
from lipmotion.units.written_forms import list_readings

MARKS = read_patterns(Path(__file__).with_name("tables") / "spoken_forms.tsv")
"""Patterns of what stands in texts and labels and is not spoken, by their names in the table."""
WORDS = {name: frozenset(words.split()) for name, words in read_table("spoken_words").items()}
"""Words by what they are in texts and labels: of silence, of speech that is not known, no names, ..."""
LONGEST_LINE = 1 << 18  # maximum characters of a line: a label may hold four hours of speech
LOG = logging.getLogger("lipmotion")
Matches = Sequence[re.Match[str]]
SYNONYMS: dict[str, tuple[str, float]] = {
    word: (mood, float(strength))
    for meaning, words in read_table("moods").items()
    for mood, strength in [meaning.split()]
    for word in words.split()
} | {name: (name, 1.0) for name in (NEUTRAL, *MOODS, PLAIN, *MANNERS)}
"""The known words of tags, and what they mean."""


class SpokenAs(Enum):
    """What a label stands for."""

    SPEECH = "speech"
    SILENCE = "silence"
    UNKNOWN = "unknown"


def classify_label(label: str) -> SpokenAs:
    """Return whether a whole label stands for silence or a sound, speech of unknown words, or speech.

    >>> classify_label("[laughs]"), classify_label("<unk>"), classify_label("hello")
    (<SpokenAs.SILENCE: 'silence'>, <SpokenAs.UNKNOWN: 'unknown'>, <SpokenAs.SPEECH: 'speech'>)
    """
    name = "sil" if label.strip() == "LAU" else label.strip().lower()  # in lexicons of calls; ``Lau`` is a name
    bracketed = MARKS["IN_BRACKETS"].fullmatch(name) is not None
    inner = name.strip("<>[](){}+&=* ") if bracketed else name
    if inner in WORDS["unknown"] or (bracketed and MARKS["UNKNOWN_SPEECH"].search(inner)):
        return SpokenAs.UNKNOWN
    return SpokenAs.SILENCE if bracketed or name in WORDS["silences"] or not name else SpokenAs.SPEECH


def extract_spoken_text(text: str, names: frozenset[str] = frozenset()) -> str:
    """Return what is spoken of a text; ``names``: of speakers, as ``find_speaker_names`` returns them."""
    text = MARKS["LINE_BREAK"].sub("\n", html.unescape(MARKS["MARKUP"].sub("", MARKS["LINE_BREAK"].sub("\n", text))))
    text = MARKS["DEED"].sub(" ", MARKS["SOUND"].sub(" ", MARKS["MARKUP"].sub("", text)))
    return remove_speakers(MARKS["SYMBOLS"].sub(" ", text), names)[0]


def remove_speakers(text: str, names: frozenset[str] | None = None) -> tuple[str, list[str]]:
    """Return a text without the names of speakers, and what was left out; ``names``: None finds them in the text.

    Names are those in capitals and with a remark (``ANNA:``, ``Anna (V.O.):``, ``[Anna]:``), ``Speaker 1:``, those in
    ``names``, two lines or more in capitals above what is said, as in screenplays, and what stands before the quotes of
    a game's script, if all lines are such; also times before lines that rise from the first minute on, and numbers.
    """
    left_out: list[str] = []

    def leave_out(match: re.Match[str]) -> str:
        left_out.append(match[0].strip())
        return ""

    def leave_out_marks(name: str, text: str) -> str:
        found = list(MARKS[name].finditer(text))
        return MARKS[name].sub(leave_out, text) if found and ARE_MARKS[name](found, text.split("\n")) else text

    def leave_out_name(match: re.Match[str]) -> str:
        name = match[1] or match[2]
        in_capitals = name == name.upper() != name.lower()
        is_bold = name.lower() not in WORDS["no_names"] and (match[0].endswith(("**", "__")) or text.count("**:") > 1)
        has_remark = match[1] or (name[0].isupper() and (match[3] or is_bold))
        numbered = MARKS["NUMBERED"].fullmatch(name)
        return leave_out(match) if in_capitals or has_remark or numbered or name in speakers else match[0]

    if text.lstrip("\ufeff").startswith("@"):
        text = MARKS["CHAT"].sub(leave_out, text)
    text = MARKS["CODE"].sub(leave_out, text)
    for name in ("RECORDING", "DATED", "STAMP"):
        text = leave_out_marks(name, text)
    speakers = find_speaker_names([text]) if names is None else names
    for name in ("NUMBER", "BARE_NUMBER", "ASKED", "DASHED"):
        text = leave_out_marks(name, text)
    cues = list(MARKS["CUE"].finditer(text))
    if len(cues) > 1 or any("(" in cue[1] for cue in cues):
        text = MARKS["DIRECTION"].sub(leave_out, MARKS["CUE"].sub(leave_out, text))
    text = MARKS["SPEAKER"].sub(leave_out_name, text)
    if _is_game_script(text):
        text = re.sub(r'^[^"\n]+(?=")', leave_out, text, flags=re.MULTILINE)
    return text, [name for name in left_out if name]


def _is_game_script(text: str) -> bool:
    """Return whether all lines are those of a game's script, quotes behind who speaks, and one says who."""
    lines = [MARKS["SCRIPT"].fullmatch(line) for line in text.splitlines() if line.strip()]
    tags = [line[1] for line in lines if line and line[1]]
    is_stated = len(lines) > 1 or any(line and not line[2] for line in lines)  # one line says no look
    return bool(tags) and all(lines) and is_stated and not WORDS["no_tags"] & {*tags}


def _rise_from_start(stamps: Matches) -> bool:
    """Return whether times at the starts of lines are those of a recording: from 0, or rising from the first minute."""
    times_s = [parse_clock(stamp[1]) for stamp in stamps]
    is_full = all(stamp[1].count(":") == 2 or "[" in stamp[0] for stamp in stamps)  # no time of day that is said
    rise = len(times_s) > 1 and times_s == sorted({*times_s})
    return times_s[0] == 0 or (rise and (is_full or times_s[0] < 60))


def _count_up(numbers: Matches) -> bool:
    """Return whether numbers or letters at the starts of lines each follow the one before, or begin again."""
    counts = [int(line[1] or ord(line[2])) for line in numbers]
    return len(counts) > 1 and all(b in (a + 1, 1, ord("a")) for a, b in pairwise(counts))


ARE_MARKS: dict[str, Callable[[Matches, Sequence[str]], bool]] = {
    "RECORDING": lambda found, rows: len(found) == sum(map(bool, rows)),
    "DATED": lambda found, _: len(found) > 1 or any(line[1] or "T" in line[0] for line in found),
    "STAMP": lambda found, _: _rise_from_start(found),
    "NUMBER": lambda found, _: _count_up(found),
    "ASKED": lambda found, _: len({line[1] for line in found}) > 1,
    "BARE_NUMBER": lambda found, rows: (
        all(re.match(r"(?!007$)0\d\d", line[1]) for line in found)
        or (_count_up(found) and int(found[0][1]) < 2 and len(found) == len(rows))
    ),
    "DASHED": lambda found, rows: 1 < len({line[1] for line in found}) < len(found) == sum(map(bool, rows)),
}
"""Whether what is found of a pattern at the starts of lines are names, times or numbers of them, in their order."""


def find_speaker_names(texts: Iterable[str]) -> frozenset[str]:
    """Return the names before a colon at the start of three lines, one twice, or of each of two lines and more."""
    lines = [line for text in texts for line in text.splitlines() if line.strip()]
    matched = [match[2] for match in map(MARKS["SPEAKER"].match, lines) if match and match[2] and match[2].istitle()]
    names = {name: count for name, count in Counter(matched).items() if name.lower() not in WORDS["no_names"]}
    speak = len(matched) == len(lines) > 1 or (max(names.values(), default=0) > 1 and sum(names.values()) > 2)
    return frozenset(names if speak else ())


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
    text, unknown = remove_speakers(
        MARKS["LINK"].sub(lambda link: " ".join(link[4] or "") or "".join(link.groups("")), text)
    )
    spoken, tags, last = "", [], 0
    for tag in MARKS["TAG"].finditer(text):
        meaning = _meaning(tag)
        if tag["did"] and meaning is None and not MARKS["DEED"].fullmatch(tag[0]):
            continue
        name = re.split(r"[\W_]", tag[2] or "", maxsplit=1)[0]
        spoken += text[last : tag.start()] + " " * (meaning is not None or name.lower() not in WORDS["inside_words"])
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
    """Return a text without its known tags."""
    return MARKS["TAG"].sub(lambda tag: " " if _meaning(tag) else tag[0], text)


def time_moods(tags: Sequence[MoodTag], units: Timeline[Unit]) -> tuple[MoodKey, ...]:
    """Return the moods of tags at the times of the words (or phones) after them; the last ones at the end of speech."""
    words = [(span.start_s, span.end_s) for span in group_words(units) if span.label]
    spans = words or [(span.start_s, span.end_s) for span in units]
    if not tags or not spans:
        return ()
    edges_s = [0.0, *(start_s for start_s, _ in spans[1:]), spans[-1][1]]
    times_s = (edges_s[min(round(tag.share * len(spans)), len(spans))] for tag in tags)
    return sort_moods([MoodKey(max(at_s, 0.0), t.mood, t.strength) for at_s, t in zip(times_s, tags, strict=True)])


def _meaning(tag: re.Match[str]) -> tuple[str, float] | None:
    name = MARKS["MOOD"].fullmatch((tag[2] or tag["did"] or "").strip().lower())
    known = SYNONYMS.get(name[1]) if name else None
    if name is None or known is None:
        return None
    if tag[1]:
        return PLAIN if known[0] in MANNERS else NEUTRAL, 1.0
    return known[0], min(float(name[2]), 1.0) if name[2] else known[1]
