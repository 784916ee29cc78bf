"""Running the programs of speech synthesisers within bounds: of time, of what they print, and of what they write."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from lipmotion.errors import InputError, MissingDependencyError
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.voices.synthesiser import ARPABET_PHONES, SynthesisedSentence, Synthesiser, SyntheticVoice
from lipmotion.types import Span, Timeline

START_S, EACH_S = 30.0, 5.0
"""The time limit of a program: to start, and for each sentence; both are a hundred times what it needs."""
STILL_S = 10.0
"""A program that prints and writes nothing for so long hangs."""
POLL_S = 0.05
LARGEST_OUTPUT_BYTES = 4 << 20
"""Most bytes that a program may print: many times the phones of twenty sentences."""
LARGEST_SOUND_BYTES = 32 << 20
"""Most bytes that it may write for each sentence: many times the longest one (``units.sentences``)."""
SHOWN_CHARACTERS = 200
"""Characters of a program's error message that ours repeats."""


def program_output(
    command: Sequence[str], package: str, sentences: int = 1, given: str = "", folder: Path | None = None
) -> str:
    """Return the standard output of a program. When it has ended, in whatever way, so have the programs it started.

    package   : the Debian package with it
    sentences : how many it synthesises, which sets its limits
    given     : its standard input
    folder    : where it writes
    Raises MissingDependencyError: there is no such program. Raises InputError: it fails, takes too long, or prints or
    writes too much.
    """
    program = shutil.which(command[0])
    if program is None:
        raise MissingDependencyError(f"{command[0]} is not installed; install it: apt install {package}")
    name = package if command[0] == sys.executable else command[0]
    try:
        with tempfile.TemporaryFile() as task, tempfile.TemporaryFile() as printed, tempfile.TemporaryFile() as errors:
            task.write(given.encode())
            task.seek(0)
            with _started([program, *command[1:]], task, printed, errors) as process:
                _wait(process, name, sentences, lambda: (_size(printed) + _size(errors), _written(folder)))
            if process.returncode:
                errors.seek(0)
                message = (
                    " ".join(errors.read(4 * SHOWN_CHARACTERS).decode(errors="replace").split())[:SHOWN_CHARACTERS]
                    or "no message"
                )
                raise InputError(f"{name} failed with {process.returncode} ({message}); try another text or voice")
            printed.seek(0)
            return printed.read().decode().replace("\r\n", "\n")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{name} cannot be run ({error}); install it again: apt install {package}") from error


@contextmanager
def _started(
    command: Sequence[str], given: IO[bytes], printed: IO[bytes], errors: IO[bytes]
) -> Iterator[subprocess.Popen[bytes]]:
    """Give a program that runs in a group of its own; at the end it is killed, with all that it started."""
    process = subprocess.Popen(command, stdin=given, stdout=printed, stderr=errors, start_new_session=True)
    try:
        yield process
    finally:
        if sys.platform == "win32":
            process.kill()
        else:
            with suppress(OSError):  # all have ended
                os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _wait(process: subprocess.Popen[bytes], name: str, sentences: int, sizes: Callable[[], tuple[int, int]]) -> None:
    """Wait until a program has ended.

    sizes : returns how many bytes it has printed, and how many it has written
    Raises InputError: it does not end, or prints or writes too much.
    """
    limit_s, largest = START_S + EACH_S * sentences, LARGEST_SOUND_BYTES * sentences
    start = moved = time.monotonic()
    before = 0, 0
    running = True
    while running:
        with suppress(subprocess.TimeoutExpired):
            process.wait(POLL_S)
            running = False
        now, sized = time.monotonic(), sizes()
        moved, before = (moved if sized == before else now), sized
        if sized[0] > LARGEST_OUTPUT_BYTES:
            raise InputError(f"{name} prints more than {LARGEST_OUTPUT_BYTES} bytes; try another text or voice")
        if sized[1] > largest:
            raise InputError(f"{name} writes more than {largest} bytes; try another text or voice")
        if running and (now - start > limit_s or now - moved > STILL_S):
            raise InputError(f"{name} did not end within {now - start:.0f} s; give shorter or fewer texts")


def _size(file: IO[bytes]) -> int:
    return os.fstat(file.fileno()).st_size


def _written(folder: Path | None) -> int:
    """Return the size of the files in a folder."""
    total = 0
    with suppress(OSError):  # the program removes what it wrote
        for path in folder.iterdir() if folder else ():
            total += path.lstat().st_size
    return total


FLITE_PACKAGE = "flite"
UNUSED = frozenset({"kal", "awb_time"})
"""kal is kal16 at 8 kHz; awb_time can only say the time of day."""
SPEAKERS = {"kal16": "kal"}


def _flite_voices() -> tuple[SyntheticVoice, ...]:
    if shutil.which("flite") is None:
        return ()
    names = program_output(["flite", "-lv"], FLITE_PACKAGE).partition(":")[2].split()
    return tuple(SyntheticVoice(name, "flite", SPEAKERS.get(name, name)) for name in names if name not in UNUSED)


def _say_with_flite(voice: str, texts: Sequence[str], folder: Path) -> Iterator[SynthesisedSentence]:
    path = folder / "flite.wav"
    for text in texts:
        command = ["flite", "-voice", voice, "-psdur", "-o", str(path), "-t", text]
        printed = program_output(command, FLITE_PACKAGE, folder=folder)
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


FLITE = Synthesiser("flite", FLITE_PACKAGE, _flite_voices, _say_with_flite, ARPABET_PHONES)


FESTIVAL_PACKAGE = "festival festvox-us-slt-hts"
MARK = "-- sentence"
LISTING = """(mapcar (lambda (name)
  (let ((about (cadr (voice.description name))))
    (format t "%s %s %s\\n" name (cadr (assoc 'language about)) (cadr (assoc 'dialect about)))))
  (voice.list))"""
SPEAKING = f"""(define (say text path)
  (let ((utterance (utt.synth (eval (list 'Utterance 'Text text)))))
    (format t "{MARK}\\n")
    (mapcar (lambda (segment) (format t "%s %s %s\\n" (item.name segment) (item.feat segment "segment_start")
                                      (item.feat segment "end")))
            (utt.relation.items utterance 'Segment))
    (utt.save.wave utterance path 'riff)))
"""


def _festival_voices() -> tuple[SyntheticVoice, ...]:
    if shutil.which("festival") is None:
        return ()
    rows = [line.split() for line in program_output(["festival", "-b", LISTING], FESTIVAL_PACKAGE).splitlines()]
    names = [row[0] for row in rows if row[1:] == ["english", "american"]]
    speakers = (re.sub(r"_.*", "", re.sub(r"^cmu_us_", "", name)) for name in names)  # slt of cmu_us_slt_arctic_hts
    return tuple(SyntheticVoice(name, "festival", who) for name, who in zip(names, speakers, strict=True))


def _say_with_festival(voice: str, texts: Sequence[str], folder: Path) -> Iterator[SynthesisedSentence]:
    paths = [folder / f"{number}.wav" for number in range(len(texts))]
    script = folder / "say.scm"
    calls = [f"(say {_quoted(text)} {_quoted(str(path))})" for text, path in zip(texts, paths, strict=True)]
    script.write_text("\n".join([f"(voice_{voice})", SPEAKING, *calls, ""]), encoding="utf-8")
    printed = program_output(["festival", "-b", str(script)], FESTIVAL_PACKAGE, len(texts), folder=folder)
    parts = printed.split(f"{MARK}\n")[1:]
    if len(parts) != len(texts):
        raise InputError(f"festival said {len(parts)} of {len(texts)} sentences; try another text or voice")
    for path, part in zip(paths, parts, strict=True):
        spans = []
        for line in part.splitlines():
            try:
                label, start, end = line.split()
                spans.append(Span(float(start), float(end), label))
            except ValueError as error:
                raise InputError(f"festival prints {line!r}, required a phone, its start and its end") from error
        yield SynthesisedSentence(read_audio(path), Timeline(tuple(spans)), path)
        path.unlink()


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


FESTIVAL = Synthesiser("festival", FESTIVAL_PACKAGE, _festival_voices, _say_with_festival, ARPABET_PHONES)
