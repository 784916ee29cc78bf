"""The letters of words: in one form of writing, and read by rules where a word is in no dictionary."""

from __future__ import annotations

import re
import unicodedata

from lipmotion.errors import InputError, shorten


def parse_table(rows: str) -> dict[str, str]:
    """Return a table of ``key=value`` between blanks; an underscore in a value is a blank."""
    return {key: value.replace("_", " ") for key, _, value in (row.partition("=") for row in rows.split())}


SPELLINGS = parse_table(
    "tion=sh_ah_n sion=zh_ah_n ture=ch_er ough=ao augh=ao eigh=ey igh=ay tch=ch dge=jh sch=sh ee=iy ea=iy ie=iy "
    "ei=ey ai=ey ay=ey ey=iy oa=ow oo=uw ou=aw ow=ow oi=oy oy=oy au=ao aw=ao ew=uw ue=uw ar=aa_r er=er ir=er "
    "or=ao_r ur=er ch=ch ck=k gh=g kn=n ng=ng ph=f qu=k_w rh=r sh=sh th=th wh=w wr=r ce=s_eh ci=s_ih cy=s_iy "
    "ge=jh_eh a=ae b=b c=k d=d e=eh f=f g=g h=hh i=ih j=jh k=k l=l m=m n=n o=aa p=p q=k r=r s=s t=t u=ah v=v w=w "
    "x=k_s y=iy z=z '="
)
"""The longest match from the left wins. ARPAbet, lower case; an empty value is a silent letter."""
LONG_VOWELS = {"a": "ey", "e": "iy", "i": "ay", "o": "ow", "u": "uw"}
ACCENTS = re.compile("[\u0300-\u036f]")
"""The accents of Latin letters; the marks of other scripts are sounds."""
_LONGEST = max(map(len, SPELLINGS))
_SILENT_E = re.compile(r"e'?s?")
"""A silent e, with or without an s, at the end of a word."""
_LONG_VOWEL = re.compile(r"[aeiou][bcdfgklmnpstvz]e('?s)?$")
"""A long vowel: vowel, consonant, final e."""


MOST_MARKS = 30
"""Most accents on one letter; no language has so many."""
APOSTROPHES = re.compile("[’‘ʼʻ′´`‛ʹ＇]")
UNSPOKEN = re.compile("\u00ad\\s*\n\\s*|[™®©]")
"""A soft hyphen at the end of a line, and signs that Unicode's NFKC makes letters of."""
DASHES = str.maketrans({"‐": "-", "‒": "-", "²": " squared", "³": " cubed", "″": '"'})
PLAIN = str.maketrans({"ß": "ss", "æ": "ae", "œ": "oe", "ø": "o", "đ": "d", "ð": "th", "þ": "th", "ł": "l", "ı": "i"})
"""Letters of Latin alphabets that Unicode does not divide into a letter and an accent."""


def plain_text(text: str) -> str:
    """Return a text in Unicode's NFKC form, with straight apostrophes, without characters that nobody sees.

    ``2½`` becomes ``2 1⁄2``.
    """
    if not text.isascii():
        text = re.sub(r"(?<=\d)(?=[¼-¾⅐-⅞])", " ", UNSPOKEN.sub("", APOSTROPHES.sub("'", _few_marks(text))))
        text = unicodedata.normalize("NFKC", text.translate(DASHES)).translate(DASHES)
        text = "".join(letter for letter in text if unicodedata.category(letter) != "Cf")
        text = re.sub(r"\d", lambda digit: str(int(digit[0])), text)
    return text.replace("`", "'")


def normalise_text(text: str) -> str:
    """Return a text as ``plain_text`` does, in lower case."""
    return plain_text(text).lower()


def _few_marks(text: str) -> str:
    """Return a text with at most ``MOST_MARKS`` marks on a letter: Unicode sorts them in quadratic time.

    Source: Unicode Standard Annex 15, Stream-Safe Text Format.
    """
    marks = re.escape("".join(c for c in set(text) if unicodedata.combining(unicodedata.normalize("NFKD", c)[0])))
    return re.sub(f"([{marks}]{{{MOST_MARKS}}})[{marks}]+", r"\1", text) if marks else text


def remove_accents(word: str) -> str:
    """Return a lower-case word in plain letters, as far as its letters are Latin: ``café`` as ``cafe``."""
    if word.isascii():
        return word
    divided = unicodedata.normalize("NFKD", word.translate(PLAIN))
    return "".join(letter for letter in divided if not ACCENTS.fullmatch(letter))


def guess_pronunciation(word: str) -> tuple[str, ...]:
    """Return a guessed pronunciation of a lower-case word, in ARPAbet.

    Accents are left out: ``é`` is read as ``e``.
    Raises InputError: a character is not a letter of the Latin alphabet.
    """
    plain = remove_accents(word)
    foreign = sorted(letter for letter in set(word) if re.search(r"[^a-z']", remove_accents(letter)))
    if foreign or not plain.strip("'"):
        raise InputError(
            f"cannot guess how {shorten(word)!r} is said ({shorten(' '.join(foreign)) or 'no letters'}): "
            "give the language of the words (--language), or add it to a lexicon file"
        )
    phones: list[str] = []
    letters = re.sub(r"([b-df-hj-np-tv-z])\1+", r"\1", plain)  # doubled consonants sound once
    at = 0
    while at < len(letters):
        taken, sound = _next_sound(letters, at, begun=bool(phones))
        phones += sound.split()
        at += taken
    has_vowel = re.search("[aeiouy]", plain)
    return tuple("er" if phone == "r" and not has_vowel else phone for phone in phones)  # the vowel of "brr"


def _next_sound(letters: str, at: int, *, begun: bool) -> tuple[int, str]:
    """Return how many letters from ``at`` on make the next sound, and their phones.

    begun : whether there is a sound before them
    """
    if _SILENT_E.fullmatch(letters, at) and begun:
        return len(letters) - at, "z" if letters.endswith("s") else ""
    if _LONG_VOWEL.match(letters, at):
        return 1, LONG_VOWELS[letters[at]]
    rest = letters[at : at + _LONGEST]
    size = next(n for n in range(len(rest), 0, -1) if rest[:n] in SPELLINGS)
    return size, SPELLINGS[rest[:size]]
