"""Speech marks of Amazon Polly: one JSON object a line, words and visemes with their starts in milliseconds.

Source: Amazon Polly Developer Guide, "Speech mark output", "Phoneme and viseme tables for supported languages".
"""

from __future__ import annotations

from lipmotion.corpora.labels.tier import LabelTier, TimedLabel
from lipmotion.corpora.labels.timings.rows import Documents, required_seconds, required_text, tiers_of, until_next
from lipmotion.errors import InputError, shortened
from lipmotion.units import SILENCE

MS_PER_S = 1000
KINDS = frozenset(("sentence", "word", "viseme", "ssml"))
PHONE_OF = {
    "sil": SILENCE, "p": "p", "t": "t", "S": "sh", "T": "th", "f": "f", "k": "k", "i": "iy", "r": "r", "s": "s",
    "l": "l", "u": "uw", "@": "ax", "a": "aa", "e": "ey", "E": "eh", "o": "ow", "O": "ao",
    "B": "v", "D": "dh", "J": "n", "G": "g", "x": "k", "w": "w",
}  # fmt: skip
"""A phone with the mouth of each viseme; those of the last row are of other languages than English."""


def tiers(documents: Documents, where: str) -> list[LabelTier] | None:
    """Return words and visemes in time; None: these are no speech marks.

    A word lasts to the next one, or to the silence after it; so do visemes. Marks of sentences and of SSML are passed
    over. Raises InputError: a viseme of another name, or a time that is none.
    """
    if not all(isinstance(mark, dict) and mark.get("type") in KINDS and "time" in mark for _, mark in documents):
        return None
    words, visemes, silences_s = [], [], []
    for line, mark in documents:
        place = f"line {line}"
        start_s = required_seconds(mark["time"], where, place, MS_PER_S)
        value = required_text(mark.get("value", ""), where, place)
        if mark["type"] == "word":
            words.append(TimedLabel(start_s, start_s, value, place))
        elif mark["type"] == "viseme":
            if value not in PHONE_OF:
                known = " ".join(PHONE_OF)
                raise InputError(f"{where}: {place}: no viseme of Polly is {shortened(value)!r}; known are: {known}")
            visemes.append(TimedLabel(start_s, start_s, PHONE_OF[value], place))
            silences_s += [start_s] if PHONE_OF[value] == SILENCE else []
    return tiers_of(where, until_next(words, silences_s), until_next(visemes))
