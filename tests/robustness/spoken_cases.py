"""Texts that nobody can speak, and voices that nobody has."""

from robustness.case import case

GROUP = "texts to speak"
NO_WORD = ("holds no word", "give the words to be spoken")


def _text(name: str, text: str, code: int, messages: tuple[str, ...] = (), *more: object) -> None:
    case(GROUP, name, code, *messages)(lambda bench: ["speak", text, "--model", bench.model, "-o", "a.json", *more])


_text("lone surrogates to speak", "\udcff\udcfe", 3, NO_WORD)
_text("a million characters without a blank", "a" * 1_000_000, 3, ("has 1000000 characters, required at most 50000",))
_text("one word of 10,000 letters to speak", "ab" * 5000, 3, ("a word of 10000 characters", "required at most 200"))


def _file(name: str, content: bytes, code: int, *messages: str) -> None:
    case(GROUP, name, code, *messages)(
        lambda bench: ["speak", "--text", bench.file("text.txt", content), "--model", bench.model, "-o", "a.json"]
    )


_file("a text file in Latin-1", "pâpa".encode("latin-1"), 3, "not a readable UTF-8 text", "save it as UTF-8 text")
_file("a text file of a million bytes", b"papa " * 200_000, 3, "1000000 bytes, required at most 200000: is it a text?")
