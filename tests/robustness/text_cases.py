"""Unusual and unusable transcripts and lexicons."""

from robustness.case import case

GROUP = "transcripts"
TOO_LONG = ("the transcript has", "characters, required at most 10552 for 2.76 s of sound: nobody says so much")

case(GROUP, "a number of 20 million digits", 5, *TOO_LONG)(
    lambda bench: bench.animate(None, "--transcript", "7" * 20_000_000)
)


def _transcript_file(name: str, content: bytes | str, code: int, *messages: str) -> None:
    case(GROUP, name, code, *messages)(
        lambda bench: bench.animate(None, "--transcript", bench.file("words.txt", content))
    )


_transcript_file("a file in Latin-1", "papa, “mama”".encode("cp1252"), 0,
                 "not UTF-8; read as Windows-1252 (western Europe); save it")  # fmt: skip
_transcript_file("a file in UTF-16", "papa mama".encode("utf-16"), 0)
_transcript_file("5 million bytes of words", b"a " * 2_500_000, 3, "5000000 characters, required at most 4194304")
_transcript_file("a million accents on one letter", b"b" + "\u0316\u0301".encode() * 500_000, 5, *TOO_LONG)
_transcript_file(
    "a sound as a transcript", b"RIFF\x80\x81\x82", 3, "not a readable UTF-8 transcript", "save it as UTF-8 text"
)
