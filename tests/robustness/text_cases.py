"""Transcripts and lexicons."""

from __future__ import annotations

import os
from pathlib import Path

from robustness.case import Bench, case

GROUP = "transcripts"
NO_WORD = ("holds no word", "give the words that are spoken")
TOO_MUCH = ("words take at least", "frames of 10 ms, found", "too short for what should be said")


def _said(name: str, text: str, code: int, *says: str) -> None:
    @case(GROUP, name, code, *says)
    def _(bench: Bench) -> list[object]:
        return bench.animate(None, "--transcript", text)


_said("an empty one", "", 3, *NO_WORD)
_said("only punctuation", "... --- !?!", 3, *NO_WORD)
_said("emoji", "😀 🎉", 3, *NO_WORD)
_said("control characters among words", "papa\x07\x1b[31m \x9d mama", 0)
_said("NUL bytes among words", "papa\0 mama", 0)
_said("lone surrogates", "\udcff\udcfe", 3, *NO_WORD)
_said("another script", "真っ昼間なのに", 3, "cannot guess how", "add it to a lexicon file")
_said("right to left among left to right", "papa \u202eשלום\u202c mama", 3, "cannot guess how 'שלום' is said")
_said("accents", "näh", 3, "cannot guess how 'näh' is said", "add it to a lexicon file")
_said("a number of thirty digits", "9" * 30, 0)
_said("numbers of other scripts", "٣", 0)
_said("a number of 100,000 digits", "7" * 100_000, 5, *TOO_MUCH)
_said("100,000 words", "papa " * 100_000, 5, *TOO_MUCH)
_said("one word of 10,000 letters", "ab" * 5000, 5, *TOO_MUCH)
_said("a name of a file that is not there", "words.txt", 3, "no such transcript file")
_said("a device", "/dev/zero", 3, "is a pipe or a device, required a file")
_said("more than fits in a name", "papa mama " * 40 + "/", 5, *TOO_MUCH)


def _written(name: str, content: bytes, code: int, *says: str) -> None:
    @case(GROUP, name, code, *says)
    def _(bench: Bench) -> list[object]:
        return bench.animate(None, "--transcript", bench.file("words.txt", content))


_written("an empty file", b"", 3, *NO_WORD)
_written("a file in Latin-1", "Bübchen".encode("latin-1"), 3, "not a readable UTF-8 transcript", "save it as UTF-8")
_written("a file in UTF-16", "papa".encode("utf-16"), 3, "not a readable UTF-8 transcript", "save it as UTF-8")
_written("a file with a byte order mark", b"\xef\xbb\xbfpapa mama", 0)
_written("a sound as a transcript", b"RIFF\x80\x81\x82", 3, "not a readable UTF-8 transcript")


@case(GROUP, "a pipe as a transcript", 3, "is a pipe or a device, required a file")
def _(bench: Bench) -> list[object]:
    os.mkfifo(bench.folder / "words.txt")
    return bench.animate(None, "--transcript", bench.folder / "words.txt")


@case(GROUP, "a file of terabytes", 3, "1099511627776 bytes, required at most 67108864")
def _(bench: Bench) -> list[object]:
    path = bench.file("words.txt", b"")
    os.truncate(path, 2**40)
    return bench.animate(None, "--transcript", path)


@case(GROUP, "words of another sentence", 0, "the transcript seems not to be what is said", "check it, or leave it out")
def _(bench: Bench) -> list[object]:
    return bench.animate(None, "--transcript", "squash six fish chefs", "--recogniser", "auto")


LEXICONS = "lexicons"


def _lexicon(name: str, content: bytes, code: int, *says: str) -> None:
    @case(LEXICONS, name, code, *says)
    def _(bench: Bench) -> list[object]:
        return bench.animate(None, "--transcript", "papa", "--lexicon", bench.file("lexicon.txt", content))


_lexicon("an unknown phone", b"papa P AA\nmama M QQ M\n", 3, "line 2: unknown phone 'QQ'; the phones are:")
_lexicon("a silence as a phone", b"papa SIL\n", 3, "line 1: unknown phone 'SIL'")
_lexicon("a word without phones", b"\n# mine\npapa\n", 3, "line 3: a word without phones; write the word, then")
_lexicon("an empty file", b"", 0)
_lexicon("the same line twice", b"papa P AA\npapa P AA\n", 0)
_lexicon("a byte order mark, and lines of Windows", b"\xef\xbb\xbfpapa P AA P AX\r\n", 0)
_lexicon("Latin-1", "bübchen B UW\n".encode("latin-1"), 3, "not a readable UTF-8 lexicon", "save it as UTF-8")
_lexicon("NUL bytes", b"\0\0\0\n", 3, "line 1: a word without phones")
_lexicon("a line of 100,000 phones", b"papa" + b" P" * 100_000, 5, *TOO_MUCH)
_lexicon("a million empty lines", b"\n" * 1_000_000, 0)


@case(LEXICONS, "a device", 3, "is a pipe or a device, required a file")
def _(bench: Bench) -> list[object]:
    return bench.animate(None, "--transcript", "papa", "--lexicon", Path("/dev/zero"))


@case(LEXICONS, "a folder", 3, "is a folder; give one lexicon file")
def _(bench: Bench) -> list[object]:
    return bench.animate(None, "--transcript", "papa", "--lexicon", bench.folder)


@case(LEXICONS, "nothing of that name", 3, "no such lexicon file")
def _(bench: Bench) -> list[object]:
    return bench.animate(None, "--transcript", "papa", "--lexicon", bench.folder / "none")
