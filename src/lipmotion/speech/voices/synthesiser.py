"""The interface to speech synthesisers: voices, and synthesised sentences."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from lipmotion.speech.voices.phone_maps import PhoneMap
from lipmotion.types import Audio, Timeline


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
