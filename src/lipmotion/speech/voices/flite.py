"""Flite: four voices at 16 kHz; one run of the program for each sentence."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

from lipmotion.errors import InputError
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.voices.phone_maps import ARPABET_PHONES
from lipmotion.speech.voices.programs import program_output
from lipmotion.speech.voices.synthesiser import SynthesisedSentence, Synthesiser, SyntheticVoice
from lipmotion.types import Span, Timeline

PACKAGE = "flite"
UNUSED = frozenset({"kal", "awb_time"})
"""kal is kal16 at 8 kHz; awb_time can only say the time of day."""
SPEAKERS = {"kal16": "kal"}


def _voices() -> tuple[SyntheticVoice, ...]:
    if shutil.which("flite") is None:
        return ()
    names = program_output(["flite", "-lv"], PACKAGE).partition(":")[2].split()
    return tuple(SyntheticVoice(name, "flite", SPEAKERS.get(name, name)) for name in names if name not in UNUSED)


def _synthesise(voice: str, texts: Sequence[str], folder: Path) -> Iterator[SynthesisedSentence]:
    path = folder / "flite.wav"
    for text in texts:
        command = ["flite", "-voice", voice, "-psdur", "-o", str(path), "-t", text]
        printed = program_output(command, PACKAGE, folder=folder)
        yield SynthesisedSentence(read_audio(path), parse_phone_ends(printed), path)


def parse_phone_ends(printed: str) -> Timeline[str]:
    """Return phones in time from what ``flite -psdur`` prints: ``pau:0.220 k:0.346``, a line an utterance.

    The number is the end of the phone in its utterance; a long text is several utterances.
    Raises InputError: it prints something else.
    """
    spans, start_s = [], 0.0
    for line in printed.splitlines():
        first_s = start_s
        for entry in line.split():
            label, _, end = entry.partition(":")
            try:
                end_s = max(first_s + float(end), start_s)
            except ValueError as error:
                raise InputError(f"flite prints {entry!r}, required a phone and its end, as in 'k:0.346'") from error
            spans.append(Span(start_s, end_s, label))
            start_s = end_s
    return Timeline(tuple(spans))


FLITE = Synthesiser("flite", PACKAGE, _voices, _synthesise, ARPABET_PHONES)
