"""The interface to speech synthesisers, and their programs, run within bounds of time."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from lipmotion.errors import InputError, MissingDependencyError
from lipmotion.types import Audio, Timeline
from lipmotion.units import PHONES, SILENCE
from lipmotion.units.ipa_phones import read_ipa
from lipmotion.units.spelling import read_table

PhoneMap = Mapping[str, tuple[str, ...]]  # a synthesiser's label to phones of the inventory

ARPABET_PHONES: PhoneMap = {phone: (phone,) for phone in PHONES} | {"pau": (SILENCE,)}
"""Flite and Festival (phone set ``radio``). They have their own ax; their er and ih are stressed and unstressed."""

ESPEAK_PHONES: PhoneMap = {
    name: tuple(phones.split()) for names, phones in read_table("espeak").items() for name in names.split()
}
"""espeak-ng's mnemonics (as ``espeak-ng -x`` writes them), voice en-us."""


def complete_map(labels: Iterable[str], table: PhoneMap, *, ipa: bool) -> tuple[PhoneMap, tuple[str, ...]]:
    """Return a map for all labels, and what of them no table has.

    table : labels with their phones, which count first
    ipa   : whether the other labels are IPA; else those that are not in the table are read as if they were, and are
            reported. A label that begins with ``_`` is a silence.
    """
    complete: dict[str, tuple[str, ...]] = {}
    unknown: dict[str, None] = {}
    for label in labels:
        if label in table:
            complete[label] = table[label]
        elif label.startswith("_"):
            complete[label] = (SILENCE,)
        elif label not in complete:
            complete[label], letters = read_ipa(label)
            unknown |= dict.fromkeys(letters if ipa else [label])
    return complete, tuple(unknown)


@dataclass(frozen=True)
class SyntheticVoice:
    """A voice of an installed synthesiser."""

    name: str  # by which the synthesiser knows it
    synthesiser: str  # ``flite``, ``festival`` or ``espeak-ng``
    speaker: str  # whose voice it is: two voices made from recordings of one person have the same speaker
    language: str = "en-us"  # what it speaks, as in ``en-us``, ``de``, ``pt-br``

    @property
    def full_name(self) -> str:
        """The name by which people ask for it: ``espeak-ng:en-us+f2``."""
        return f"{self.synthesiser}:{self.name}"


@dataclass(frozen=True, eq=False)
class SynthesisedSentence:
    """One sentence from a synthesiser."""

    audio: Audio  # at 16 kHz
    phones: Timeline[str]  # in time, by the synthesiser's own names
    sound: Path  # of the synthesiser's own rate; the file is there until the next sentence is asked for
    words: Timeline[str] | None = None  # as they are written, in time, where the synthesiser tells (None: it does not)
    phone_map: PhoneMap | None = None  # its names to phones, where they are not those of the English voices


@dataclass(frozen=True)
class Synthesiser:
    """A speech synthesis program."""

    name: str
    package: str  # the Debian package with it; empty: it is a Python package
    voices: Callable[[], tuple[SyntheticVoice, ...]]  # those of American English; none where it is not installed
    synthesise: Callable[[str, Sequence[str], Path], Iterator[SynthesisedSentence]]
    """Yields the sentences of some texts in a voice (name, texts, a folder for temporary files), in order."""
    phone_map: PhoneMap  # its phones to those of the inventory
    others: Callable[[], tuple[SyntheticVoice, ...]] = tuple  # its voices of other languages and kinds of English
    extra: str = ""  # of lipmotion, that installs that


START_S, EACH_S = 30.0, 5.0
"""The time limit of a program: to start, and for each sentence; both are a hundred times what it needs."""
SHOWN_CHARACTERS = 200  # characters of a program's error message that ours repeats


def run_program(command: Sequence[str], package: str, sentences: int = 1, stdin: str = "") -> str:
    """Return the standard output of a program. When it has ended, in whatever way, so have the programs it started.

    sentences : how many it synthesises, which sets its limit of time
    Raises MissingDependencyError: no such program. Raises InputError: it fails, or takes too long.
    """
    program = shutil.which(command[0])
    if program is None:
        raise MissingDependencyError(f"{command[0]} is not installed; install it: apt install {package}")
    name = package if command[0] == sys.executable else command[0]
    try:
        with tempfile.TemporaryFile() as task, tempfile.TemporaryFile() as printed, tempfile.TemporaryFile() as errors:
            task.write(stdin.encode())
            task.seek(0)
            process = subprocess.Popen(
                [program, *command[1:]], stdin=task, stdout=printed, stderr=errors, start_new_session=True
            )
            try:
                process.wait(limit_s := START_S + EACH_S * sentences)
            except subprocess.TimeoutExpired as error:
                raise InputError(f"{name} did not end within {limit_s:.0f} s; give shorter or fewer texts") from error
            finally:
                if sys.platform == "win32":
                    process.kill()
                else:
                    with suppress(OSError):  # all have ended
                        os.killpg(process.pid, signal.SIGKILL)
                process.wait()
            if process.returncode:
                errors.seek(0)
                message = " ".join(errors.read(4 * SHOWN_CHARACTERS).decode(errors="replace").split())
                message = message[:SHOWN_CHARACTERS] or "no message"
                raise InputError(f"{name} failed with {process.returncode} ({message}); try another text or voice")
            printed.seek(0)
            return printed.read().decode().replace("\r\n", "\n")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{name} cannot be run ({error}); install it again: apt install {package}") from error
