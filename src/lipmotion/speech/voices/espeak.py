"""espeak-ng: American English by formants, in the variants that sound like people; one program run for all sentences.

Only its library tells when each phone begins. The library is called in a process of its own (``espeak_events``), so
that its state, its crashes and its licence (GPL) stay there.
"""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from lipmotion.errors import InputError
from lipmotion.speech.audio_files import read_audio
from lipmotion.speech.voices.espeak_times import corrected_phone_times
from lipmotion.speech.voices.phone_maps import ESPEAK_PHONES
from lipmotion.speech.voices.synthesiser import SynthesisedSentence, Synthesiser, SyntheticVoice, program_output

PACKAGE = "espeak-ng"
LANGUAGE = "en-us"
VARIANTS = ("f1", "f2", "f3", "f4", "m1", "m2", "m3", "m4", "m7", "m8")
"""The variants with the vocal tract, pitch and breath of a person; not the robots, whispers, echoes and growls."""
PROGRAM = [sys.executable, "-I", str(Path(__file__).with_name("espeak_events.py"))]


def _voices() -> tuple[SyntheticVoice, ...]:
    if shutil.which("espeak-ng") is None:
        return ()
    listed = program_output(["espeak-ng", "--voices=variant"], PACKAGE)
    names = [name for name in VARIANTS if f"!v/{name} " in f"{listed} "]
    return tuple(SyntheticVoice(f"{LANGUAGE}+{name}", "espeak-ng", f"espeak-{name}") for name in names)


def _synthesise(voice: str, texts: Sequence[str], folder: Path) -> Iterator[SynthesisedSentence]:
    task = json.dumps({"voice": voice, "texts": list(texts), "folder": str(folder)})
    sentences = _answer(program_output(PROGRAM, PACKAGE, len(texts), task))
    for number, sentence in enumerate(sentences):
        path = folder / f"{number}.wav"
        audio = read_audio(path)
        yield SynthesisedSentence(audio, corrected_phone_times(sentence, audio))
        path.unlink()


def _answer(printed: str) -> Any:
    """Return the parsed output of ``espeak_events``. Raises InputError: it is no JSON."""
    try:
        return json.loads(printed)
    except ValueError as error:
        raise InputError(f"espeak-ng's library answers {printed[:40]!r}; install it again: {PACKAGE}") from error


ESPEAK_NG = Synthesiser("espeak-ng", PACKAGE, _voices, _synthesise, ESPEAK_PHONES)
