"""Tags in the text of what is said: ``[angry]``, ``<smile>``, ``[sad:0.6]``; none of them is spoken."""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

from lipmotion.errors import shorten
from lipmotion.types import Timeline, Unit
from lipmotion.types.delivery import MANNERS, MOODS, NEUTRAL, PLAIN, MoodKey, MoodTag, sort_moods
from lipmotion.units.phone_timelines import group_words
from lipmotion.units.spoken_text import DEED, find_speaker_names, remove_speakers
from lipmotion.units.text_normalisation import find_words

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
    **dict.fromkeys(
        "happily joy joyful joyfully cheerful cheerfully excited laughs laughing laughter".split(), ("happy", 1.0)
    ),
    **dict.fromkeys("smile smiles smiling warm warmly friendly amused".split(), ("happy", 0.6)),
    **dict.fromkeys("sadly sadness crying cries sobbing sorrow sorrowful grief".split(), ("sad", 1.0)),
    **dict.fromkeys("sighs sigh disappointed gloomy melancholy".split(), ("sad", 0.5)),
    **dict.fromkeys("angrily anger furious rage mad".split(), ("angry", 1.0)),
    **dict.fromkeys("annoyed frustrated irritated stern".split(), ("angry", 0.6)),
    **dict.fromkeys("fear fearful fearfully scared terrified frightened".split(), ("afraid", 1.0)),
    **dict.fromkeys("disgust disgustedly revolted".split(), ("disgusted", 1.0)),
    **dict.fromkeys("surprise surprisedly amazed astonished shocked gasps".split(), ("surprised", 1.0)),
    **dict.fromkeys("nervous nervously anxious anxiously stressed worried".split(), ("tense", 1.0)),
    **dict.fromkeys("tiredly exhausted sleepy yawns bored".split(), ("tired", 1.0)),
    **dict.fromkeys("calm calmly normal normally relaxed".split(), (NEUTRAL, 1.0)),
    **dict.fromkeys("whispers whispering whispered softly".split(), ("whisper", 1.0)),
    **dict.fromkeys("shouts shouting shouted yells yelling screams loudly".split(), ("shout", 1.0)),
    **dict.fromkeys("mumbles mumbling muttering mutters".split(), ("mumble", 1.0)),
    **{name: (name, 1.0) for name in (NEUTRAL, *MOODS, PLAIN, *MANNERS)},
}
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
    """Return the mood and the strength that a tag asks for; None: it is not known."""
    name = _NAME.fullmatch((tag[2] or tag["did"] or "").strip().lower())
    known = SYNONYMS.get(name[1]) if name else None
    if name is None or known is None:
        return None
    if tag[1]:
        return PLAIN if known[0] in MANNERS else NEUTRAL, 1.0
    return known[0], min(float(name[2]), 1.0) if name[2] else known[1]
