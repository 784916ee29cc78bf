"""Time points of Google's text to speech: the times of the marks of SSML, which are named as the words after them.

Source: Google Cloud, Text-to-Speech API reference, ``Timepoint`` (``enableTimePointing: SSML_MARK``).
"""

from __future__ import annotations

import re

from lipmotion.corpora.labels.tier import LabelTier, TimedLabel
from lipmotion.corpora.labels.timings.rows import Documents, required_seconds, required_text, tiers_of, until_next
from lipmotion.errors import InputError, shortened

POINTS, NAME, TIME = "timepoints", "markName", "timeSeconds"
WORD = re.compile(r"[^\W\d_]+(?:['’-][^\W\d_]+)*[.,;:!?]?")
"""A name that is a word."""


def tiers(documents: Documents, where: str) -> list[LabelTier] | None:
    """Return words in time, each up to the next mark; None: these are no time points of Google.

    Raises InputError: a mark whose name is no word, or a time that is none.
    """
    if (
        len(documents) != 1
        or not isinstance(documents[0][1], dict)
        or not isinstance(documents[0][1].get(POINTS), list)
    ):
        return None
    words = []
    for number, point in enumerate(documents[0][1][POINTS], 1):
        place = f"time point {number}"
        fields = point if isinstance(point, dict) else {}
        start_s = required_seconds(fields.get(TIME, 0), where, place)
        name = required_text(fields.get(NAME), where, place)
        if not WORD.fullmatch(name):
            raise InputError(
                f"{where}: {place} is the mark {shortened(name)!r}, which is no word; name every mark as the word that "
                'follows it, <mark name="hello"/>hello, or give the words as a transcript'
            )
        words.append(TimedLabel(start_s, start_s, name, place))
    return tiers_of(where, until_next(words))
