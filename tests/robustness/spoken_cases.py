"""Texts that nobody can speak, and voices that nobody has."""

from __future__ import annotations

from robustness.case import Bench, case

GROUP = "texts to speak"
NO_WORD = ("holds no word", "give the words to be spoken")


def _text(name: str, text: str, code: int, messages: tuple[str, ...] = (), *more: object) -> None:
    @case(GROUP, name, code, *messages)
    def _(bench: Bench) -> list[object]:
        return ["speak", text, "--model", bench.model, "-o", "a.json", *more]


_text("an empty text to speak", "", 3, NO_WORD)
_text("only punctuation to speak", "... --- !?!", 3, NO_WORD)
_text("emoji to speak", "😀 🎉", 3, NO_WORD)
_text("lone surrogates to speak", "\udcff\udcfe", 3, NO_WORD)
_text("control characters among words to speak", "papa\x07\x1b[31m \x9d mama", 0)
_text("NUL bytes among words to speak", "papa\0 mama", 0)
_text("a number of thirty digits to speak", "9" * 30, 0)
_text("tags and phones in brackets", "<speak>papa</speak> [[m'A:m@]]", 0)
_text("100,000 characters", "papa " * 20_000, 3, ("has 100000 characters, required at most 50000", "speak it in parts"))
_text("a million characters without a blank", "a" * 1_000_000, 3, ("has 1000000 characters, required at most 50000",))
_text("one word of 10,000 letters to speak", "ab" * 5000, 3, ("a word of 10000 characters", "required at most 200"))
_text("a voice that is not there", "papa", 3, ("no voice 'paul' is installed", "--voices lists"), "--voice", "paul")
_text("a voice of an unknown synthesiser", "papa", 3, ("unknown synthesiser 'dectalk'",), "--voice", "dectalk:paul")
_text("a voice without a name", "papa", 3, ("no voice 'stand-in:' is installed",), "--voice", "stand-in:")
_text("a sound of another format", "papa", 7, ("unknown format '.mp3'", ".wav .flac .ogg"), "a.mp3")


def _file(name: str, content: bytes, code: int, *messages: str) -> None:
    @case(GROUP, name, code, *messages)
    def _(bench: Bench) -> list[object]:
        return ["speak", "--text", bench.file("text.txt", content), "--model", bench.model, "-o", "a.json"]


_file("an empty text file", b"", 3, *NO_WORD)
_file("a text file in UTF-16", "papa".encode("utf-16"), 3, "not a readable UTF-8 text", "save it as UTF-8 text")
_file("a text file with a byte order mark", b"\xef\xbb\xbfpapa mama", 0)
_file("a text file of a million bytes", b"papa " * 200_000, 3, "1000000 bytes, required at most 200000: is it a text?")
_file("a text file of NUL bytes", bytes(1000), 3, *NO_WORD)


def _path(name: str, path: str, *messages: str) -> None:
    @case(GROUP, name, 3, *messages)
    def _(bench: Bench) -> list[object]:
        return ["speak", "--text", path, "--model", bench.model, "-o", "a.json"]


_path("a text file that is not there", "text.txt", "no such text file")
_path("a device as a text file", "/dev/zero", "is a pipe or a device, required a file")
_path("a folder as a text file", "/usr", "is a folder; give one text file")
