"""Unusual and unusable transcripts and lexicons."""

from robustness.case import case

GROUP = "transcripts"
NO_WORD = ("holds no word", "give the words that are spoken")
TOO_LONG = ("the transcript has", "characters, required at most 10552 for 2.76 s of sound: nobody says so much")
TOO_MUCH = ("words take at least", "frames of 10 ms, found", "too short for what should be said")


def _transcript(name: str, text: str, code: int, *messages: str) -> None:
    case(GROUP, name, code, *messages)(lambda bench: bench.animate(None, "--transcript", text))


_transcript("an empty text", "", 3, *NO_WORD)
_transcript("lone surrogates", "\udcff\udcfe", 3, *NO_WORD)
_transcript("control characters among words", "papa\x07\x1b[31m \x9d mama\0", 0)
_transcript("another script", "真っ昼間なのに", 3, "cannot guess how", "add it to a lexicon file")
_transcript("accents", "pàpa", 0)
_transcript("money, ordinals, signs, numbers of other scripts", "$1 & 2% ٣", 0)
_transcript("a number of 1,000 digits", "7" * 1000, 5, *TOO_MUCH)
case(GROUP, "a number of 20 million digits", 5, *TOO_LONG)(
    lambda bench: bench.animate(None, "--transcript", "7" * 20_000_000)
)
_transcript("one word of 10,000 letters", "ab" * 5000, 5, *TOO_MUCH)
_transcript("a device", "/dev/zero", 3, "is a pipe or a device, required a file")
_transcript("more than fits in a name", "papa mama " * 40 + "/", 5, *TOO_MUCH)


def _transcript_file(name: str, content: bytes | str, code: int, *messages: str) -> None:
    case(GROUP, name, code, *messages)(
        lambda bench: bench.animate(None, "--transcript", bench.file("words.txt", content))
    )


_transcript_file("a file in Latin-1", "papa, “mama”".encode("cp1252"), 0,
                 "not UTF-8; read as Windows-1252 (western Europe); save it")  # fmt: skip
_transcript_file("a file in UTF-16", "papa mama".encode("utf-16"), 0)
_transcript_file("5 million bytes of words", b"a " * 2_500_000, 3, "5000000 characters, required at most 4194304")
_transcript_file("a million accents on one letter", b"b" + "\u0316\u0301".encode() * 500_000, 5, *TOO_LONG)
_transcript_file("subtitles", b"1\n00:00:00,500 --> 00:00:02,000\npapa mama\n", 0,
                 "the words do not fit the sound, first at 0.50 s")  # fmt: skip
_transcript_file("subtitles of another recording", b"10:03,0 --> 10:05,0\npapa\n", 3,
                 "begins at 603.00 s, the recording ends at 2.76 s")  # fmt: skip
_transcript_file("subtitles that go on", b"00:00,5 --> 00:02,0\npapa\n\n00:30,0 --> 00:31,0\nmama\n", 0,
                 "goes on after the recording ends at 2.76 s; its last 1 lines are left out")  # fmt: skip
_transcript_file("14 words in a subtitle of a moment", b"0:1 --> 0:1.1\n" + b"papa " * 7 + b"mama " * 7, 0,
                 "the times of the transcript do not fit the sound; they are not used")  # fmt: skip
_transcript_file("UTF-16 without its mark", "papa mama".encode("utf-16-le"), 0)
_transcript_file(
    "a sound as a transcript", b"RIFF\x80\x81\x82", 3, "not a readable UTF-8 transcript", "save it as UTF-8 text"
)


case(GROUP, "words of another sentence", 0, "the transcript seems not to be what is said", "check it, or leave it out")(
    lambda bench: bench.animate(None, "--transcript", "squash six fish chefs", "--recogniser", "auto")
)


LEXICONS = "lexicons"


def _lexicon(name: str, content: bytes, code: int, *messages: str) -> None:
    case(LEXICONS, name, code, *messages)(
        lambda bench: bench.animate(None, "--transcript", "papa", "--lexicon", bench.file("lexicon.txt", content))
    )


_lexicon("an unknown phone", b"papa P AA\nmama M QQ M\n", 3, "line 2: unknown phone 'QQ'; the phones are:")
_lexicon("an empty file", b"", 0)
_lexicon("a line of 900 phones", b"papa" + b" P" * 900, 5, *TOO_MUCH)
