"""A stand-alone program: texts to wav files and the start times of their phones, by the library of espeak-ng.

It reads ``{"voice", "texts", "folder"}`` as JSON, and writes a list of ``[label, start_s]`` for every text as JSON and
the sound of text n to ``folder/n.wav``. It imports nothing of this package, so that it starts fast.
"""

from __future__ import annotations

import ctypes
import json
import sys
import wave
from pathlib import Path
from typing import Any

LIBRARIES = ("libespeak-ng.so.1", "libespeak-ng.1.dylib", "libespeak-ng.dll")
SYNCHRONOUS, PHONEME_EVENTS, UTF_8 = 2, 1, 1
END, PHONEME = 0, 7


class _Event(ctypes.Structure):
    """``espeak_EVENT`` of speak_lib.h: ``label`` is eight bytes of a union, ``sample`` counts from the text's start."""

    _fields_ = (
        ("type", ctypes.c_int),
        ("identifier", ctypes.c_uint),
        ("text_position", ctypes.c_int),
        ("length", ctypes.c_int),
        ("audio_position", ctypes.c_int),
        ("sample", ctypes.c_int),
        ("user_data", ctypes.c_void_p),
        ("label", ctypes.c_char * 8),
    )


_Callback = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_int, ctypes.POINTER(_Event))


def _library() -> Any:
    for name in LIBRARIES:
        try:
            return ctypes.CDLL(name)
        except OSError:
            continue
    sys.exit(f"none of {', '.join(LIBRARIES)} is installed; apt install libespeak-ng1")


def _speak(library: Any, rate_hz: int, text: str, path: Path) -> list[tuple[str, float]]:
    """Write the sound of a text, and return its phones with their start times, s."""
    sound, starts = bytearray(), []

    def collect(samples: int | None, count: int, events: Any) -> int:
        if samples and count > 0:
            sound.extend(ctypes.string_at(samples, 2 * count))
        index = 0
        while events[index].type != END:
            if events[index].type == PHONEME and events[index].label:
                starts.append((events[index].label.decode(), events[index].sample / rate_hz))
            index += 1
        return 0

    callback = _Callback(collect)
    library.espeak_SetSynthCallback(callback)
    encoded = text.encode()
    if library.espeak_Synth(encoded, len(encoded) + 1, 0, 1, 0, UTF_8, None, None):
        sys.exit(f"the text {text[:40]!r} was not spoken")
    library.espeak_Synchronize()
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(rate_hz)
        file.writeframes(bytes(sound))
    return starts


def main() -> None:
    """Synthesise the texts of the task on the standard input."""
    task = json.load(sys.stdin)
    library = _library()
    rate_hz = library.espeak_Initialize(SYNCHRONOUS, 0, None, PHONEME_EVENTS)
    if rate_hz <= 0:
        sys.exit("espeak-ng finds no data; apt install espeak-ng-data")
    if library.espeak_SetVoiceByName(task["voice"].encode()):
        sys.exit(f"no voice {task['voice']!r}")
    folder = Path(task["folder"])
    starts = [_speak(library, rate_hz, text, folder / f"{number}.wav") for number, text in enumerate(task["texts"])]
    json.dump(starts, sys.stdout)


if __name__ == "__main__":
    main()
