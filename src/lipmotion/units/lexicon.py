"""Pronunciations of words: from a user's file, then pocketsphinx's dictionary, then a network or rules for spelling.

Also which language words are in: of a text, by its script and commonest words; of speech, whether it is English.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache
from importlib.util import find_spec
from io import StringIO
from itertools import product
from pathlib import Path
from typing import Any

from lipmotion.errors import InputError, MissingDependencyError, shorten
from lipmotion.storage.sources import read_text_file
from lipmotion.types.languages import ENGLISH, LANGUAGES, find_script
from lipmotion.units.ipa_phones import read_tokens
from lipmotion.units.phones import OTHER_NAMES, PAUSE, PHONES, REDUCED_VOWELS, describe_unknown_phone, is_silent
from lipmotion.units.spelling import guess_pronunciation, normalise_text, read_patterns, read_table, remove_accents
from lipmotion.units.written_forms import list_readings

LONGEST_WORD = 30  # letters of the longest word that is read by the network: longer ones are web addresses and noise


@lru_cache(maxsize=4096)
def pronounce_by_network(word: str) -> tuple[str, ...]:
    """Return the phones of a lower-case word in plain letters; empty: ``hama`` is not installed, or has no phones."""
    network = _network() if len(word) <= LONGEST_WORD else None
    if network is None:
        return ()
    return tuple(phone for phone, _ in read_tokens([each.phoneme for each in network.predict(word).alignments]))


@cache
def _network() -> Any:
    """Return the network; None: it is not installed, or has no library for this system."""
    if find_spec("hama") is None:
        return None
    try:
        from hama.inference import G2PModel

        return G2PModel()
    except (ImportError, OSError, RuntimeError):
        return None


Pronunciation = tuple[str, ...]
SpokenForm = tuple[tuple[str, str], ...]
"""Phones, each with the word that it is of; between words a pause that may be made, without a word."""

FULL_VOWELS = frozenset("aa ae ao aw ay eh ey iy ow oy uh uw".split())
OWNED = dict.fromkeys("p t k f th".split(), ("s",)) | dict.fromkeys("s z sh zh ch jh".split(), ("ix", "z"))
"""The phones of an ``'s`` after some phones; ``z`` after all others."""
WEAK_WORDS = frozenset("a an the of and from was but than that's her were your for if in is it its".split())
"""Monosyllables that are unstressed in running speech."""
LARGEST_LEXICON_BYTES = 1 << 25  # of a user's file; the dictionary of 134,000 words has 3.3 million
LONGEST_PRONUNCIATION = 1000  # most phones of a word
OFTEN_LENGTHENED = frozenset("no so go do to who hello yo bro ho he me we she be the long stop".split())
"""Words that are meant rather than those with their vowel twice (``noo``, ``loong``, ``stoop``)."""
MARKS = read_patterns(Path(__file__).with_name("tables") / "lexicon.tsv")
"""Patterns of words and of entries of lexicons, by their names in the table."""
BRITISH = read_table("british")
SOUNDED = re.compile(r"(?=.*(.)\1\1|.*rr\Z|p[sf]{2})(?!([^fhmrsvz])\2*\Z)[b-df-hj-np-tv-xz]+\Z")
"""Sounds in letters: ``brrr``, ``psst``, ``fff``; no dictionary has them, and their letters are not spelled."""
LONGEST_LENGTHENED, MAX_LENGTHENED = 100, 5  # a word of more letters, or with more that are doubled, is none of these
MAX_VARIANTS = 32
"""Most pronunciations of a word: alignment tries each after each of the word before. The dictionary has up to six."""
COMMON_WORDS = read_table("common_words")
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


@lru_cache(maxsize=4096)
def find_phone(label: str) -> str | None:
    """Return the phone that a label names, or None.

    A label is ARPAbet in either case, stressed or not, TIMIT's, with its place in a word as in Kaldi (``hh_B``), ours.
    """
    name = re.sub(r"\d?(_[bies])?$", "", label.lower())
    name = REDUCED_VOWELS.get(name, name) if label[len(name) :].startswith("0") else OTHER_NAMES.get(name, name)
    return name if name in PHONES else None


def require_phone(label: str, where: str = "") -> str:
    """Return the phone that a label names, found ``where`` (with a blank before it). Raises InputError: it is none."""
    phone = find_phone(label)
    if phone is None:
        raise InputError(describe_unknown_phone(label, where))
    return phone


@dataclass(frozen=True)
class Lexicon:
    """Pronunciations of words.

    user : the user's pronunciations, which replace those of the dictionary

    >>> Lexicon().pronunciations("boat")
    (('b', 'ow', 't'),)
    >>> Lexicon({"zenodo": (("z", "eh", "n", "ow", "d", "ow"),)}).known("zenodo")
    True
    """

    user: dict[str, tuple[Pronunciation, ...]] = field(default_factory=dict)

    @classmethod
    def from_file(cls, path: str | Path) -> Lexicon:
        """Return the lexicon of a file: ``word PHONE PHONE ...`` a line; comments begin with ``#``, ``;;;``.

        Phones are ARPAbet in either case, with or without stress digits, or names of the inventory.
        Raises InputError: no such file, not UTF-8, larger than allowed (``LARGEST_LEXICON_BYTES``), or with its line:
        no phones after a word, more than ``LONGEST_PRONUNCIATION`` or ``MAX_VARIANTS``, or an unknown phone.
        """
        text = read_text_file(Path(path), "lexicon", LARGEST_LEXICON_BYTES)
        user: dict[str, list[Pronunciation]] = {}
        for number, line in enumerate(StringIO(text), start=1):
            where = f"{path}, line {number}"
            word, *labels = MARKS["ENTRY"].sub(r"\1 ", re.split("#|;;;", line, maxsplit=1)[0]).split() or [""]
            if not word or MARKS["NO_WORD"].fullmatch(word):
                continue
            if not 0 < len(labels) <= LONGEST_PRONUNCIATION:
                what = f"{len(labels)} phones after a word, required 1 to {LONGEST_PRONUNCIATION}"
                raise InputError(f"{where}: {what}; write a pronunciation of a word a line")
            word = MARKS["VARIANT_NUMBER"].sub("", normalise_text(word)).strip("'")  # as in ``split_words``
            phones = tuple([find_phone(label) or "" for label in labels])
            for label, phone in zip(labels, phones, strict=True):
                if not phone or is_silent(phone):
                    raise InputError(f"{where}: unknown phone {shorten(label)!r}; the phones are: {' '.join(PHONES)}")
            variants = user.setdefault(word, [])
            if len(variants) == MAX_VARIANTS:
                what = f"more than {MAX_VARIANTS} pronunciations of {shorten(word)!r}"
                raise InputError(f"{where}: {what}; keep those that are said")
            variants.append(phones)
        return cls({word: tuple(variants) for word, variants in user.items()})

    def known(self, word: str) -> bool:
        """Return whether a word, or the usual reading of a written form, is in the user's file or the dictionary."""
        word = self._find_name(word)
        are_known = (each in self.user or list_entries(each) for each in list_readings(word.removesuffix("'s"))[0])
        return word in self.user or all(are_known) or bool(expand_lengthened(word) or SOUNDED.fullmatch(word))

    def pronunciations(self, word: str) -> tuple[Pronunciation, ...]:
        """Return every pronunciation of a lower-case word, or of a written form (``1995``) in all its readings.

        Of an unknown one: those of the same word without accents or lengthened letters, if the dictionary has it
        (``cafe`` for ``café``, ``boom`` for ``boooom``), else that of ``hama``'s network, where installed, or of rules.
        Raises InputError: as ``guess_pronunciation``.
        """
        forms = (tuple(phone for phone, _ in form if phone != PAUSE) for form in self.spoken_forms(word))
        return tuple(dict.fromkeys(forms))

    def spoken_forms(self, word: str) -> tuple[SpokenForm, ...]:
        """Return every way to say a word or a written form, the usual one first. Raises as ``pronunciations``."""
        word = self._find_name(word)
        readings = list_readings(word)
        if readings == ((word,),) and word not in self.user:
            readings = expand_lengthened(word) or readings
        user_readings = tuple(reading for reading in readings if len(reading) == 1 and reading[0] in self.user)
        forms: list[SpokenForm] = []
        for reading in ((word,),) if word in self.user else user_readings or readings:
            choices = [self._pronounce(each) for each in reading]
            several = len(readings) > 1 and len(reading) > 1  # then not in all their pronunciations
            for number in range(min(max(map(len, choices)), 2 if several else MAX_VARIANTS)):
                form: list[tuple[str, str]] = []
                for each, variants in zip(reading, choices, strict=True):
                    form += [(PAUSE, "")] if form else []
                    form += [(phone, each) for phone in variants[min(number, len(variants) - 1)]]
                forms.append(tuple(form))
        return tuple(dict.fromkeys(forms))

    def _find_name(self, word: str) -> str:
        """Return a word, or a written form as the user's file has it: ``4k`` for ``4K``."""
        return word.lower() if word.lower() in self.user else word

    def _pronounce(self, word: str) -> tuple[Pronunciation, ...]:
        if word in self.user:
            return self.user[word]
        if entries := list_entries(word):
            return tuple(dict.fromkeys(reduce_vowels(word, entry) for entry in entries))
        if word[1:].endswith("'s"):
            return tuple((*each, *OWNED.get(each[-1], ("z",))) for each in self._pronounce(word[:-2]))
        by_rules = guess_pronunciation(word)
        if SOUNDED.fullmatch(word):
            return (by_rules,)
        return (reduce_vowels(word, pronounce_by_network(remove_accents(word)) or by_rules),)


@cache
def expand_lengthened(word: str) -> tuple[tuple[str, ...], ...]:
    """Return the words of the dictionary that a lengthened word stands for, the likeliest first; none of any other.

    Letters that stand there three times and more are meant once or twice: ``nooo``, ``boooom``; or a part is repeated.
    """
    plain = remove_accents(word)
    if not MARKS["LENGTHENED"].search(plain) or len(plain) > LONGEST_LENGTHENED or list_entries(word):
        return ()
    runs = [match[0] for match in re.finditer(r"(.)\1*", plain)]
    choices = [
        (run[0],) if len(run) == 1 else (run[0], 2 * run[0]) if run[0] in "aiuy" else (2 * run[0], run[0])
        for run in runs
    ]
    if max(map(len, runs)) > 2 and sum(len(each) > 1 for each in choices) <= MAX_LENGTHENED:
        shortest = 3 if SOUNDED.fullmatch(plain) else 1  # "sss" is no name of a letter
        known = [each for each in map("".join, product(*choices)) if len(each) >= shortest and list_entries(each)]
        return tuple((each,) for each in sorted(known, key=lambda each: each not in OFTEN_LENGTHENED))
    match = MARKS["REPEATED"].fullmatch(plain)
    return ((match[1],) * match[0].count(match[1]),) if match and list_entries(match[1]) else ()


def find_english_data() -> Path:
    """Return the folder of pocketsphinx's dictionary and models. Raises MissingDependencyError: it is not installed."""
    spec = find_spec("pocketsphinx")  # its data files are read, the package itself is not imported
    if spec is None or not spec.submodule_search_locations:
        what = "the pronunciation dictionary and the phone models of many voices come with pocketsphinx:"
        raise MissingDependencyError(f"{what} pip install pocketsphinx")
    return Path(spec.submodule_search_locations[0]) / "model" / "en-us"


@cache
def _dictionary() -> bytes:
    return b"\n" + (find_english_data() / "cmudict-en-us.dict").read_bytes()


@cache
def list_entries(word: str) -> tuple[Pronunciation, ...]:
    """Return the pronunciations of a word in the dictionary, by binary search in its text.

    Of a word that is not in it: those of the same word without accents, or none.
    """
    text, wanted, entries = _dictionary(), word.encode(), []
    low, high = 0, len(text) - 1  # each at the line break before a line
    while low < high:
        middle = text.rindex(b"\n", 0, (low + high) // 2 + 1)
        if _head(text, middle) < wanted:
            low = text.index(b"\n", middle + 1)
        else:
            high = middle
    while low + 1 < len(text) and _head(text, low) == wanted:
        end = text.index(b"\n", low + 1)
        entries.append(tuple(text[low:end].decode().lower().split()[1:]))
        low = end
    entries += [tuple(phones.split()) for phones in BRITISH[word].split(",")] if word in BRITISH else []
    plain = remove_accents(word)
    return tuple(entries) if entries or plain == word else list_entries(plain)


def _head(text: bytes, line_break: int) -> bytes:
    """Return the word of the line after a line break, without the number of its variant."""
    return text[line_break + 1 : text.index(b" ", line_break)].partition(b"(")[0]


def reduce_vowels(word: str, phones: Pronunciation) -> Pronunciation:
    """Return phones with the unstressed AH, ER and IH reduced. The dictionary has no stress, so a rule decides.

    A word of one syllable keeps its vowel unless it is a weak word. In a longer word these three are
    unstressed, but for the first vowel when it follows a consonant and no full vowel (see FULL_VOWELS)
    precedes the last syllable's: ``b ah t axr`` but ``ax b aw t``.
    """
    vowels = [i for i, phone in enumerate(phones) if phone in FULL_VOWELS or phone in REDUCED_VOWELS]
    stressed = -1
    if vowels and word not in WEAK_WORDS:
        stressed = vowels[0]
        if len(vowels) > 1 and phones[stressed] not in FULL_VOWELS and stressed == 0:
            stressed = next((i for i in vowels if phones[i] in FULL_VOWELS), vowels[1])
    return tuple(REDUCED_VOWELS.get(p, p) if i != stressed else p for i, p in enumerate(phones))


def detect_language(words: Sequence[str]) -> str:
    """Return the code of the language of a text; empty: not known.

    >>> detect_language("der hund und die katze und das".split()), detect_language(["밥을"]), detect_language(["zxqv"])
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
    if highest > counts[ENGLISH]:  # a few words: better none than a wrong one
        return first if 1 < highest > second else ""
    if not counts[ENGLISH] and 2 * sum(word != remove_accents(word) for word in words) >= len(words):
        return ""
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
