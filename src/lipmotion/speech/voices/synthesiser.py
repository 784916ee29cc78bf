"""What all synthesisers have in common: voices, what they say, and programs that are run to have it said."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from lipmotion.errors import InputError, MissingDependencyError
from lipmotion.speech.voices.phone_maps import PhoneMap
from lipmotion.types import Audio, Timeline

START_S, EACH_S = 30.0, 5.0
"""How long a program may take to start, and for each sentence: a hundred times what they need."""
SHOWN = 200
"""Letters of a program's complaint that an error repeats."""


@dataclass(frozen=True)
class SyntheticVoice:
    """A voice of an installed synthesiser.

    name        : to the synthesiser
    synthesiser : ``flite``, ``festival`` or ``espeak-ng``
    speaker     : who is heard: voices of two synthesisers that were made from one person's recordings share it
    """

    name: str
    synthesiser: str
    speaker: str


@dataclass(frozen=True, eq=False)
class SynthesisedSentence:
    """One sentence as a synthesiser says it.

    audio  : 16 kHz
    phones : in time, by the names that the synthesiser has for them
    """

    audio: Audio
    phones: Timeline[str]


@dataclass(frozen=True)
class Synthesiser:
    """A program that speaks.

    package : of Debian, that brings it
    voices  : returns those of it that are installed; none where it is not
    say     : gives the texts in a voice (name, texts, a folder for its files), one after the other
    labels  : its phones to those of the inventory (``sounds``)
    """

    name: str
    package: str
    voices: Callable[[], tuple[SyntheticVoice, ...]]
    say: Callable[[str, Sequence[str], Path], Iterator[SynthesisedSentence]]
    labels: PhoneMap


def program_output(command: Sequence[str], package: str, sentences: int = 1, given: str = "") -> str:
    """Return what a program writes.

    package : of Debian, that brings it
    given   : what it reads
    Raises MissingDependencyError: there is no such program. Raises InputError: it fails, or takes too long.
    """
    program = shutil.which(command[0])
    if program is None:
        raise MissingDependencyError(f"{command[0]} is not installed; install it: apt install {package}")
    limit_s = START_S + EACH_S * sentences
    try:
        done = subprocess.run(
            [program, *command[1:]], input=given, capture_output=True, encoding="utf-8", timeout=limit_s, check=False
        )
    except subprocess.TimeoutExpired as error:
        raise InputError(f"{command[0]} did not end within {limit_s:.0f} s; give shorter or fewer texts") from error
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{command[0]} cannot be run ({error}); install it again: apt install {package}") from error
    if done.returncode:
        complaint = " ".join(done.stderr.split())[:SHOWN] or "no message"
        raise InputError(f"{command[0]} failed with {done.returncode} ({complaint}); try another text or voice")
    return done.stdout
