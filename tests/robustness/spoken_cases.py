"""Texts that nobody can speak, and voices that nobody has."""

from robustness.case import case

GROUP = "texts to speak"

case(GROUP, "a million characters without a blank", 3, "has 1000000 characters, required at most 50000")(
    lambda bench: ["speak", "a" * 1_000_000, "--model", bench.model, "-o", "a.json"]
)


def _file(name: str, content: bytes, code: int, *messages: str) -> None:
    case(GROUP, name, code, *messages)(
        lambda bench: ["speak", "--text", bench.file("text.txt", content), "--model", bench.model, "-o", "a.json"]
    )


_file("a text file in Latin-1", "pâpa".encode("latin-1"), 3, "not a readable UTF-8 text", "save it as UTF-8 text")
_file("a text file of a million bytes", b"papa " * 200_000, 3, "1000000 bytes, required at most 200000: is it a text?")
