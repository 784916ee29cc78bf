"""``lipmotion live``: lip motion of a microphone, a pipe or a file, frame by frame, to whatever shows it."""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Any

from lipmotion.cli.arguments.options import add_verb
from lipmotion.cli.terminal.printing import flush_output, print_line
from lipmotion.errors import InputError, MissingDependencyError
from lipmotion.storage.sources import is_recording

CHUNK_S = 0.02  # sound is taken in pieces of so many seconds


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = add_verb(verbs, __package__, "live", run)
    again: dict[str, Any] = {"nargs": "?", "default": argparse.SUPPRESS, "metavar": "DEVICE|FILE|-"}
    parser.add_argument("input", help="the same", **again)


def run(options: argparse.Namespace) -> None:
    """Push sound into a ``lipmotion.Stream`` and give its frames to all consumers."""
    from contextlib import ExitStack

    from lipmotion.live.consumers import Listener, LiveSound, open_consumer
    from lipmotion.live.face import LiveCharacter
    from lipmotion.live.stream import Stream
    from lipmotion.pipeline.model import load_model
    from lipmotion.speech.sound.audio_files import read_audio

    with ExitStack() as stack:
        rate_hz, is_file = options.rate, options.input != "-" and Path(options.input).is_file()
        if is_file:
            audio = read_audio(Path(options.input))
            rate_hz, step = audio.rate_hz, int(CHUNK_S * audio.rate_hz)
            pieces = (audio.samples[first : first + step] for first in range(0, len(audio.samples), step))
            sound = pieces if options.as_fast_as_possible else _in_time(pieces)
        else:
            sound = _read_pipe(rate_hz) if options.input == "-" else _listen(options.input, rate_hz)
        options.stopper.check()  # a signal that a package swallowed: a page would be waited for without an end
        seed = None if options.still else 0
        stream = Stream(rate_hz, options.look_ahead, load_model(options.model), pauses=options.pauses, seed=seed)
        dress = LiveCharacter(options.character) if options.character else None
        about = LiveSound(rate_hz, options.look_ahead, options.input != "-" and not is_file)
        consumers = [stack.enter_context(open_consumer(to, print_line, about)) for to in options.to or ["-"]]
        listeners = [each for each in consumers if isinstance(each, Listener)]
        try:
            for piece in chain(sound, (None,)):  # None: the sound has ended
                for listener in listeners if piece is not None else ():
                    listener.hear(piece)
                frames = stream.flush() if piece is None else stream.push(piece)
                for frame in map(dress, frames) if dress else frames:
                    for take in consumers:
                        take(frame)
                flush_output()
        except KeyboardInterrupt:
            if is_file:
                raise
    options.stopper.check()  # nothing else ends a microphone: files keep what was said until then


def _read_pipe(rate_hz: int) -> Iterator[bytes]:
    rest = b""
    while content := os.read(sys.stdin.fileno(), 2 * int(CHUNK_S * rate_hz)):
        content = rest + content
        rest = content[len(content) // 2 * 2 :]
        yield content[: len(content) - len(rest)]


def _in_time(pieces: Iterator[Any]) -> Iterator[Any]:
    """Yield pieces of ``CHUNK_S`` when they would have been spoken."""
    began_s = time.monotonic()
    for number, piece in enumerate(pieces, 1):
        time.sleep(max(began_s + number * CHUNK_S - time.monotonic(), 0.0))
        yield piece


def _listen(device: str, rate_hz: int) -> Iterator[Any]:
    """Yield the sound of a microphone; where it is unplugged, wait until it is back."""
    if is_recording(Path(device)):
        raise InputError(f"{device}: no such file; give a recording, the name of a microphone, or -")
    try:
        import sounddevice
    except (ImportError, OSError) as error:
        why = f"{device + ' is no file, and ' if device else ''}a microphone needs sounddevice, and PortAudio ({error})"
        raise MissingDependencyError(f"{why}; pip install sounddevice, or give a FILE or -") from error
    chosen: str | int | None = int(device) if device.isdecimal() else device or None
    opened = False
    while True:
        try:
            size = int(CHUNK_S * rate_hz)
            with sounddevice.InputStream(rate_hz, size, chosen, channels=1, dtype="int16") as microphone:
                opened = True
                while True:
                    yield microphone.read(size)[0]
        except (sounddevice.PortAudioError, ValueError) as error:
            if not opened:
                raise InputError(f"no microphone {device or '(the usual one)'!s}: {error}") from error
            time.sleep(1.0)  # it was unplugged
