"""The interface to speech synthesisers: voices, sentences, and maps from their phones to those of the inventory."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from lipmotion.types import Audio, Timeline
from lipmotion.units import PHONES, SILENCE
from lipmotion.units.ipa_phones import read_ipa

PhoneMap = Mapping[str, tuple[str, ...]]
"""A synthesiser's label to phones of the inventory."""

ARPABET_PHONES: PhoneMap = {phone: (phone,) for phone in PHONES} | {"pau": (SILENCE,)}
"""Flite and Festival (phone set ``radio``). They have their own ax; their er and ih are stressed and unstressed."""

_ESPEAK: dict[str, str] = {
    # silences
    "_ _: _| _^_ |": SILENCE,
    # vowels, by their sounds in American English
    "0 A: A": "aa", "a aa": "ae", "V": "ah", "O O: O2": "ao", "aU": "aw", "@ @2 @5 a#": "ax", "3": "axr", "aI": "ay",
    "E": "eh", "3:": "er", "eI": "ey", "I": "ih", "I# I2": "ix", "i i:": "iy", "oU": "ow", "OI": "oy", "U": "uh",
    "u u:": "uw",
    # vowels with the r that follows, or with another vowel
    "A@": "aa r", "O@ o@": "ao r", "e@": "eh r", "U@": "uh r", "i@3": "ih r", "i@": "iy ax", "aI@": "ay ax",
    "aI3": "ay axr", "aU@": "aw axr", "@L": "el", "n-": "en", "m-": "em",
    # consonants; ? is a t that stays in the throat, t# one that the tongue only touches
    "b": "b", "d d#": "d", "D": "dh", "dZ": "jh", "f": "f", "g": "g", "h": "hh", "j": "y", "k": "k", "l": "l", "m": "m",
    "n": "n", "N": "ng", "p": "p", "r r-": "r", "s": "s", "S": "sh", "t t# t2 ?": "t", "tS": "ch", "T": "th", "v": "v",
    "w": "w", "z": "z", "Z": "zh",
    # parts of what is before: the glide from a vowel to the next, the beginning of an unstressed vowel
    "; @-": "",
}  # fmt: skip
ESPEAK_PHONES: PhoneMap = {
    label: tuple(phones.split()) for labels, phones in _ESPEAK.items() for label in labels.split()
}
"""espeak-ng's mnemonics (as ``espeak-ng -x`` writes them), voice en-us."""


def complete_map(labels: Iterable[str], table: PhoneMap, *, ipa: bool) -> tuple[PhoneMap, tuple[str, ...]]:
    """Return a map for all labels, and what of them no table has.

    table : labels with their phones, which count first
    ipa   : whether the other labels are IPA; else those that are not in the table are read as if they were, and are
            reported. A label that begins with ``_`` is a silence.
    """
    found: dict[str, tuple[str, ...]] = {}
    unknown: dict[str, None] = {}
    for label in labels:
        if label in table:
            found[label] = table[label]
        elif label.startswith("_"):
            found[label] = (SILENCE,)
        elif label not in found:
            found[label], letters = read_ipa(label)
            unknown |= dict.fromkeys(letters if ipa else [label])
    return found, tuple(unknown)


@dataclass(frozen=True)
class SyntheticVoice:
    """A voice of an installed synthesiser.

    name        : by which the synthesiser knows it
    synthesiser : ``flite``, ``festival`` or ``espeak-ng``
    speaker     : whose voice it is: two voices made from recordings of one person have the same speaker
    language    : what it speaks, as in ``en-us``, ``de``, ``pt-br``
    """

    name: str
    synthesiser: str
    speaker: str
    language: str = "en-us"

    @property
    def full_name(self) -> str:
        """The name by which people ask for it: ``espeak-ng:en-us+f2``."""
        return f"{self.synthesiser}:{self.name}"

    @property
    def is_english(self) -> bool:
        """Whether it speaks English, so that the dictionary knows its words."""
        return self.language.partition("-")[0] == "en"


@dataclass(frozen=True, eq=False)
class SynthesisedSentence:
    """One sentence from a synthesiser.

    audio   : at 16 kHz
    phones  : in time, by the synthesiser's own names
    sound   : the file with the sound at the synthesiser's own rate; it is there until the next sentence is asked for
    words   : as they are written, in time, where the synthesiser tells (None: it does not)
    phone_map : its names to phones of the inventory, where they are not those of the synthesiser's English (None)
    """

    audio: Audio
    phones: Timeline[str]
    sound: Path
    words: Timeline[str] | None = None
    phone_map: PhoneMap | None = None


@dataclass(frozen=True)
class Synthesiser:
    """A speech synthesis program.

    package    : the Debian package with it
    voices     : returns its installed American English voices; none where it is not installed
    synthesise : yields the sentences of some texts in a voice (name, texts, a folder for temporary files), in order
    phone_map  : its phones to those of the inventory (``phone_maps``)
    others     : returns its voices of other languages and kinds of English
    extra      : of lipmotion, that installs it; empty: it is no Python package
    """

    name: str
    package: str
    voices: Callable[[], tuple[SyntheticVoice, ...]]
    synthesise: Callable[[str, Sequence[str], Path], Iterator[SynthesisedSentence]]
    phone_map: PhoneMap
    others: Callable[[], tuple[SyntheticVoice, ...]] = tuple
    extra: str = ""
