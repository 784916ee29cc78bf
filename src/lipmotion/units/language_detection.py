"""Which language words are in: of a text, by its script and its commonest words; of speech, whether it is English."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from functools import cache

from lipmotion.types.languages import ENGLISH, LANGUAGES, find_script
from lipmotion.units.lexicon import Lexicon, Pronunciation, find_english_data

COMMON_WORDS = {
    "en": "the and of to is that it was you for with this",
    "es": "el los las que y en es por con para una del",
    "fr": "le les et est des je vous une dans pas il du",
    "de": "der die und das ist nicht ich ein den zu mit es",
    "it": "il che di è non un per sono con gli della una",
    "pt": "o os que não um uma do da em com para é",
    "nl": "de het een en van is ik niet dat op zijn te",
}
"""The commonest words of languages in Latin letters, as any frequency list has them."""
MIN_COMMON, AHEAD = 3, 1.5
"""A text is in a language with so many of its common words in it, and so many times as many as of any other one."""
MIN_KNOWN = 0.85  # a text of which the dictionary knows so large a share is English
MIN_PHONES, MIN_WORDS = 4, 12
"""Shorter words than the first are in the dictionary by chance, and of fewer words than the second nothing is said."""
NOT_ENGLISH, IS_ENGLISH = 0.2, 0.5
"""Shares of recognised words with a pronunciation of English, up to and from which speech is not English, or is. In
14 s of English it is 0.17 to 0.93, of other languages 0.00 to 0.43."""
_ALIKE = {"ax": "ah", "axr": "er", "ix": "ih", "ao": "aa", "uh": "uw"}


def detect_language(words: Sequence[str]) -> str:
    """Return the code of the language of a text; empty: not known.

    >>> detect_language("der hund und die katze und das".split()), detect_language(["밥을"]), detect_language(["ok"])
    ('de', 'ko', '')
    """
    scripts = Counter(find_script(letter) for word in words for letter in word) - Counter([""])
    for code in ("ja", "ko", "zh", "el"):  # a Japanese text has Chinese characters, too
        if any(scripts[script] for script in LANGUAGES[code].scripts):
            return code
    if set(scripts) != {"LATIN"}:
        return ""
    counts = Counter({code: sum(word in common.split() for word in words) for code, common in COMMON_WORDS.items()})
    (first, highest), (_, second) = counts.most_common(2)
    if highest >= max(MIN_COMMON, AHEAD * second):
        return first
    return ENGLISH if sum(map(Lexicon().known, words)) >= MIN_KNOWN * len(words) else ""


def is_english(words: Iterable[Pronunciation]) -> bool | None:
    """Return whether the words of speech, as a recogniser of phones divides it, are English; None: not known."""
    known, long = _pronunciations(), [_alike(word) for word in words if len(word) >= MIN_PHONES]
    share = sum(word in known for word in long) / max(len(long), 1)
    return share >= IS_ENGLISH if len(long) >= MIN_WORDS and not NOT_ENGLISH < share < IS_ENGLISH else None


def _alike(phones: Iterable[str]) -> str:
    """Return phones, with spaces between, without the differences that recognisers of phones do not make."""
    return " ".join(_ALIKE.get(phone, phone) for phone in phones)


@cache
def _pronunciations() -> frozenset[str]:
    text = (find_english_data() / "cmudict-en-us.dict").read_text(encoding="utf-8").lower()
    return frozenset(_alike(line.split()[1:]) for line in text.splitlines())
