"""Unusual and unusable transcripts and lexicons."""

from __future__ import annotations

import os
from pathlib import Path

from robustness.case import Bench, case

GROUP = "transcripts"
NO_WORD = ("holds no word", "give the words that are spoken")
TOO_LONG = ("the transcript has", "characters, required at most 10552 for 2.76 s of sound: nobody says so much")
TOO_MUCH = ("words take at least", "frames of 10 ms, found", "too short for what should be said")


def _transcript(name: str, text: str, code: int, *messages: str) -> None:
    @case(GROUP, name, code, *messages)
    def _(bench: Bench) -> list[object]:
        return bench.animate(None, "--transcript", text)


_transcript("an empty text", "", 3, *NO_WORD)
_transcript("only punctuation", "... --- !?!", 3, *NO_WORD)
_transcript("emoji", "😀 🎉", 3, *NO_WORD)
_transcript("control characters among words", "papa\x07\x1b[31m \x9d mama", 0)
_transcript("NUL bytes among words", "papa\0 mama", 0)
_transcript("lone surrogates", "\udcff\udcfe", 3, *NO_WORD)
_transcript("another script", "真っ昼間なのに", 3, "cannot guess how", "add it to a lexicon file")
_transcript("right to left among left to right", "papa \u202eשלום\u202c mama", 3, "cannot guess how 'שלום' is said")
_transcript("accents", "pàpa", 0, "'pàpa' is not in the dictionary; read as 'p aa p ax'; a lexicon file can say better")
_transcript("money, ordinals, signs", "$1 & 2%", 0)
_transcript("a number of thirty digits", "9" * 30, 0)
_transcript("numbers of other scripts", "٣", 0)
_transcript("a number of 1,000 digits", "7" * 1000, 5, *TOO_MUCH)
_transcript("2,000 words", "papa " * 2000, 5, *TOO_MUCH)
_transcript("a number of 20 million digits", "7" * 20_000_000, 5, *TOO_LONG)
_transcript("15 million words", "a " * 15_000_000, 5, *TOO_LONG)
_transcript("one word of 60 million letters", "b" * 60_000_000, 5, *TOO_LONG)
_transcript("one word of 10,000 letters", "ab" * 5000, 5, *TOO_MUCH)
_transcript("a name of a file that is not there", "words.txt", 3, "no such transcript file")
_transcript("a device", "/dev/zero", 3, "is a pipe or a device, required a file")
_transcript("more than fits in a name", "papa mama " * 40 + "/", 5, *TOO_MUCH)


def _transcript_file(name: str, content: bytes | str, code: int, *messages: str) -> None:
    @case(GROUP, name, code, *messages)
    def _(bench: Bench) -> list[object]:
        return bench.animate(None, "--transcript", bench.file("words.txt", content))


_transcript_file("an empty file", b"", 3, *NO_WORD)
_transcript_file(
    "a file in Latin-1", "papa, “mama”".encode("cp1252"), 0, "not UTF-8; read as Windows-1252 (western Europe); save it"
)
_transcript_file("a file in UTF-16", "papa mama".encode("utf-16"), 0)
_transcript_file("a file with a byte order mark", b"\xef\xbb\xbfpapa mama", 0)
_transcript_file(
    "30 million bytes of words", b"a " * 15_000_000, 3, "30000000 bytes, required at most 16777216: is it a"
)
_transcript_file(
    "10 million bytes of words", b"a " * 5_000_000, 3, "10000000 characters, required at most 4194304: is it"
)
_transcript_file("a million accents on one letter", b"b" + "\u0316\u0301".encode() * 500_000, 5, *TOO_LONG)
_transcript_file(
    "a TextGrid without a tier", b'"ooTextFile"\n"TextGrid"\n0 1 <exists> 0\n', 3, "the transcript holds no word"
)
_transcript_file(
    "HTK's labels of phones", b"0 1000000 p\n1000000 2000000 aa\n", 3, "phones in time, but no words; give"
)
_transcript_file(
    "HTK's labels of words",
    b"0 10000000 papa\n10000000 20000000 mama\n",
    0,
    "the words do not fit the sound, first at 0.00 s",
)
_transcript_file(
    "subtitles", b"1\n00:00:00,500 --> 00:00:02,000\npapa mama\n", 0, "the words do not fit the sound, first at 0.50 s"
)
_transcript_file(
    "subtitles without words", b"1\n00:00:01,000 --> 00:00:02,000\n[music]\n", 3, "the transcript holds no word"
)
_transcript_file(
    "subtitles with damaged times", b"1\n00:00:01,000 --> 7\npapa\n", 3, "line 2 is '00:00:01,000 --> 7'; required"
)
_transcript_file(
    "subtitles that end before they start", b"00:03,0 --> 00:02,0\npapa\n", 3, "line 1 ends at 2 s, before its start"
)
_transcript_file(
    "subtitles of another recording",
    b"10:03,0 --> 10:05,0\npapa\n",
    3,
    "begins at 603.00 s, the recording ends at 2.76 s",
)
_transcript_file(
    "subtitles that go on",
    b"00:00,5 --> 00:02,0\npapa\n\n00:30,0 --> 00:31,0\nmama\n",
    0,
    "goes on after the recording ends at 2.76 s; its last 1 lines are left out",
)
_transcript_file(
    "subtitles out of order, one over another",
    b"0:1 --> 0:2\nmama\n\n0:0.5 --> 0:2\npapa\n",
    0,
    "the words do not fit the sound, first at",
)
_transcript_file("200 words in a subtitle of a moment", b"0:1 --> 0:1.1\n" + b"papa " * 200, 5, *TOO_MUCH)
_transcript_file(
    "14 words in a subtitle of a moment",
    b"0:1 --> 0:1.1\n" + b"papa " * 7 + b"mama " * 7,
    0,
    "the times of the transcript do not fit the sound; they are not used",
)
_transcript_file(
    "a subtitle of a million words",
    b"0:1 --> 0:2\n" + b"a " * 1_000_000,
    3,
    "line 1: a line of 2000000 characters, required at most 262144",
)
_transcript_file(
    "half a million subtitles", b"0:1 --> 0:2\n" * 500_000, 3, "more than 250000 labels; give those of one"
)
_transcript_file(
    "recognised words",
    b'{"result": [{"word": "papa", "start": 0.5, "end": 1.2}], "text": "papa"}',
    0,
    "the words do not fit the sound, first at 0.50 s",
)
_transcript_file(
    "recognised words, cut off", b'{"segments": [\n{"start": 0.5,', 3, "line 2: damaged JSON (", "write it again"
)
_transcript_file("100,000 brackets", b'{"segments": ' + b"[" * 100_000, 3, "damaged JSON: nested too deeply")
_transcript_file(
    "a time that is NaN", b'{"words": [{"word": "papa", "start": NaN}]}', 3, "word 1: a time is nan, required a number"
)
_transcript_file(
    "a time that is a text",
    b'{"words": [{"word": "papa", "start": "x"}]}',
    3,
    "word 1: a time is 'x', required a number",
)
_transcript_file(
    "a time of centuries",
    b'{"words": [{"word": "papa", "end": 1e99}]}',
    3,
    "word 1: a time is 1e+99, required a number",
)
_transcript_file("JSON of another kind", b'{"name": "papa"}', 3, "required the words alone; save it as text")
_transcript_file(
    "a CTM of two recordings", b"a 1 0.0 0.5 papa\nb 1 0.5 0.5 mama\n", 3, "line 2: words of two recordings"
)
_transcript_file(
    "UTF-16 without its mark", "papa".encode("utf-16-le"), 3, "holds NUL characters: is it UTF-16 without its mark?"
)
ASS = "[Script Info]\n\n[Events]\nDialogue: 0,0:00:00.50,0:00:02.00,Default,,0,0,0,,{\\an8}papa mama\n"
_transcript_file("SubStation subtitles", ASS, 0, "the words do not fit the sound, first at 0.50 s")
_transcript_file("SubStation subtitles with damaged times", ASS.replace("0:00:02.00", "2"), 3, "line 4 is 'Dialogue:")
_transcript_file(
    "subtitles with a damaged arrow",
    b"1\n00:00:00,500 - -> 00:00:02,000\npapa mama\n",
    0,
    "fit the sound, first at 0.50 s",
)
_transcript_file(
    "subtitles without arrows", b"1\n00:00:00,500 00:00:02,000\npapa\n", 3, "two times as in subtitles; required"
)
_transcript_file("a sound as a transcript", b"RIFF\x80\x81\x82", 3, "is not UTF-8 text; save it as UTF-8")


@case(GROUP, "a pipe as a transcript", 3, "is a pipe or a device, required a file")
def _(bench: Bench) -> list[object]:
    os.mkfifo(bench.folder / "words.txt")
    return bench.animate(None, "--transcript", bench.folder / "words.txt")


@case(GROUP, "a file of terabytes", 3, "1099511627776 bytes, required at most 16777216")
def _(bench: Bench) -> list[object]:
    path = bench.file("words.txt", b"")
    os.truncate(path, 2**40)
    return bench.animate(None, "--transcript", path)


@case(GROUP, "words of another sentence", 0, "the transcript seems not to be what is said", "check it, or leave it out")
def _(bench: Bench) -> list[object]:
    return bench.animate(None, "--transcript", "squash six fish chefs", "--recogniser", "auto")


LEXICONS = "lexicons"


def _lexicon(name: str, content: bytes, code: int, *messages: str) -> None:
    @case(LEXICONS, name, code, *messages)
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
_lexicon("a line of 900 phones", b"papa" + b" P" * 900, 5, *TOO_MUCH)
_lexicon(
    "a line of 10 million phones", b"papa" + b" P" * 10_000_000, 3, "line 1: 20000004 characters, required at most 2000"
)
_lexicon(
    "a million pronunciations", b"papa P AA\n" * 1_000_000, 3, "line 33: more than 32 pronunciations of 'papa'; keep"
)
_lexicon("a million empty lines", b"\n" * 1_000_000, 0)
_lexicon("two million lines", b"papa P\n" * 2_000_000, 3, "2000001 lines, required at most 1048576; keep the words")
_lexicon("40 million bytes", b"#" * 40_000_000, 3, "40000000 bytes, required at most 33554432: is it a lexicon?")


@case(LEXICONS, "a device", 3, "is a pipe or a device, required a file")
def _(bench: Bench) -> list[object]:
    return bench.animate(None, "--transcript", "papa", "--lexicon", Path("/dev/zero"))


@case(LEXICONS, "a folder", 3, "is a folder; give one lexicon file")
def _(bench: Bench) -> list[object]:
    return bench.animate(None, "--transcript", "papa", "--lexicon", bench.folder)


@case(LEXICONS, "a file that does not exist", 3, "no such lexicon file")
def _(bench: Bench) -> list[object]:
    return bench.animate(None, "--transcript", "papa", "--lexicon", bench.folder / "none")
