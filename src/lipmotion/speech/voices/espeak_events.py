"""A stand-alone program: texts to wav files and the start times of their phones, by the library of espeak-ng.

It reads a task as JSON: ``{"voice", "texts", "folder", "ipa", "library", "data"}``; the last two are the paths of the
library, and of the folder that holds ``espeak-ng-data``. It writes a list of ``[label, start_s, place]`` for every text
as JSON, and the sound of text n to ``folder/n.wav``. A label is espeak-ng's mnemonic, or with ``"ipa"`` the phone in
IPA; ``place`` is where the written word begins in the text, in characters. With ``"words"`` instead of texts, it writes
a list of the phones of each in IPA, divided by ``|`` and blanks; nothing is spoken. To start fast it imports nothing.
"""

from __future__ import annotations

import ctypes
import json
import os
import sys
import wave
from pathlib import Path
from typing import Any

SYNCHRONOUS, PHONEME_EVENTS, IPA, UTF_8 = 2, 1, 2, 1
END, WORD, PHONEME = 0, 1, 7
DIVIDER = "|"
SILENCE, PART = "_", ";"  # the mnemonics of a silence, and of a part of the phone before. Both have no IPA


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


class _Voice(ctypes.Structure):
    """``espeak_VOICE`` of speak_lib.h; only ``languages`` is filled in."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("languages", ctypes.c_char_p),
        ("identifier", ctypes.c_char_p),
        ("gender_age_variant", ctypes.c_ubyte * 4),
        ("score", ctypes.c_int),
        ("spare", ctypes.c_void_p),
    )


_Callback = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_int, ctypes.POINTER(_Event))


def _speak(library: Any, rate_hz: int, text: str, path: Path) -> list[tuple[str, float, int]]:
    """Write the sound of a text, and return its phones with their start times, s, and the places of their words."""
    sound, starts = bytearray(), []
    word_position = 1

    def collect(samples: int | None, count: int, events: Any) -> int:
        nonlocal word_position
        if samples and count > 0:
            sound.extend(ctypes.string_at(samples, 2 * count))
        index = 0
        while events[index].type != END:
            event = events[index]
            if event.type == WORD:
                word_position = event.text_position
            elif event.type == PHONEME:
                unnamed = PART if event.text_position == word_position else SILENCE
                label = event.label.decode(errors="ignore") or unnamed
                starts.append((label, event.sample / rate_hz, word_position - 1))
            index += 1
        return 0

    callback = _Callback(collect)
    library.espeak_SetSynthCallback(callback)
    encoded = text.encode()
    if library.espeak_Synth(encoded, len(encoded) + 1, 0, 1, 0, UTF_8, None, None):
        sys.exit(f"the text {text[:40]!r} was not spoken")
    library.espeak_Synchronize()
    with wave.open(str(path), "wb") as file:
        file.setparams((1, 2, rate_hz, 0, "NONE", ""))
        file.writeframes(bytes(sound))
    return starts


def _pronounce(library: Any, word: str) -> str:
    library.espeak_TextToPhonemes.restype = ctypes.c_char_p
    encoded = ctypes.create_string_buffer(word.encode())
    rest, phones = ctypes.c_void_p(ctypes.addressof(encoded)), []
    while rest.value:
        clause = library.espeak_TextToPhonemes(ctypes.byref(rest), UTF_8, IPA | ord(DIVIDER) << 8)
        phones.append(clause.decode(errors="ignore"))
    return " ".join(phones)


def main() -> None:
    """Carry out the task on the standard input."""
    task = json.load(sys.stdin)
    try:
        library = ctypes.CDLL(task["library"])
    except OSError as error:
        sys.exit(f"{task['library']} cannot be loaded ({error}); install espeakng-loader again")
    os.chdir(task["data"])  # the library cuts long paths
    rate_hz = library.espeak_Initialize(SYNCHRONOUS, 0, b".", PHONEME_EVENTS | (IPA if task.get("ipa") else 0))
    if rate_hz <= 0:
        sys.exit("espeak-ng finds no data; install espeakng-loader again")
    voice = task["voice"].encode()
    properties = ctypes.byref(_Voice(languages=voice))
    if library.espeak_SetVoiceByName(voice) and library.espeak_SetVoiceByProperties(properties):
        sys.exit(f"no voice {task['voice']!r}")
    if "words" in task:
        json.dump([_pronounce(library, word) for word in task["words"]], sys.stdout)
        return
    folder = Path(task["folder"])
    starts = [_speak(library, rate_hz, text, folder / f"{number}.wav") for number, text in enumerate(task["texts"])]
    json.dump(starts, sys.stdout)


if __name__ == "__main__":
    main()
