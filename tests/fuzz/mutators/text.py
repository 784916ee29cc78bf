"""Mutations of text: lines, words, numbers, characters and encodings."""

import re
from random import Random

from fuzz.mutators import raw

NUMBERS = (
    "0 -0 -1 1e9 1e308 1e999 -1e999 nan -inf Infinity 0x10 1_000 1,000 .5 5. 1e-320 ٣ ² ½ 0.1e1e1 "
    "9999999999999999999 99999999999999999999999999999999999999999 1" + "0" * 400
).split()
WORDS = (
    *("", "#", "=", ";", '"', "'", "\\", "//", "..", "../../x", "a/b", "/etc/passwd", "C:\\x", "~", "*", "%s", "{0}"),
    *("\x00", "\x1b[2J", "\x1b]52;c;eA==\x07", "\r", "\x85", "\u2028", "\ufeff", "\u202e", "\ud7ff", "e\u0301" * 30),
    *(
        "ﬁ", "İ", "ß", "ǆ", "中文", "😀", "\U0010ffff", "zzz", "sil", "SP", "AH0", "p", "x" * 3000, "don't", "''",
        "=1+1",
    ),
)  # fmt: skip
POWERS = (2,) * 4 + (3,) * 4 + (4, 4, 5, 6)  # numbers of repetitions, as powers of ten
BREAKS = ("\r\n", "\r", "\n\n", "\x0b", "\u2028", "\t", ",", ";", " ", "")


def change(chance: Random, content: bytes) -> bytes:
    """Change a text, or its encoding."""
    words = content.decode("utf-8", "surrogateescape")
    way = chance.choice((_lines, _lines, _token, _token, _number, _number, _flood, _break, _letter, _coding))
    changed = way(chance, words)
    return changed if isinstance(changed, bytes) else changed.encode("utf-8", "surrogateescape")


def _lines(chance: Random, words: str) -> str:
    lines = words.splitlines(keepends=True) or [""]
    first, second = chance.randrange(len(lines)), chance.randrange(len(lines))
    kind = chance.choice(("swap", "double", "remove", "shuffle", "many"))
    if kind == "swap":
        lines[first], lines[second] = lines[second], lines[first]
    elif kind == "shuffle":
        chance.shuffle(lines)
    else:
        lines[first : first + 1] = [lines[second]] * {"double": 2, "remove": 0, "many": 2000}[kind]
    return "".join(lines)


def _token(chance: Random, words: str) -> str:
    """Replace a word, or insert one beside it."""
    return _replaced(chance, r"\S+", words, chance.choice(WORDS))


def _number(chance: Random, words: str) -> str:
    return _replaced(chance, r"-?\d+(?:\.\d*)?", words, chance.choice(NUMBERS))


def _replaced(chance: Random, pattern: str, words: str, new: str) -> str:
    found = [match.span() for match in re.finditer(pattern, words[:100_000])] or [(len(words), len(words))]
    start, end = chance.choice(found)
    return words[:start] + new + words[chance.choice((start, end, end)) :]


def _flood(chance: Random, words: str) -> str:
    """Insert many repetitions of something."""
    token = chance.choice(words[:100_000].split() or ["a"])
    one = chance.choice((token[:1000], "a", "9", "0.1", '"', "p")) + chance.choice(("", " ", "\n", ","))
    many = one * min(10 ** chance.choice(POWERS), raw.LARGEST_BYTES // 2 // len(one))
    at = chance.choice((0, len(words), chance.randrange(len(words) + 1)))
    return words[:at] + many + words[at:]


def _break(chance: Random, words: str) -> str:
    return words.replace(chance.choice(("\n", " ", "\t", ",")), chance.choice(BREAKS), chance.choice((1, -1)))


def _letter(chance: Random, words: str) -> str:
    at = chance.randrange(len(words) + 1)
    return words[:at] + chance.choice((chr(chance.randrange(0x250)), chr(chance.randrange(0xD800)))) + words[at + 1 :]


def _coding(chance: Random, words: str) -> bytes:
    coding = chance.choice(("utf-16", "utf-16-be", "utf-8-sig", "latin-1", "utf-7", "cp037"))
    return raw.change(chance, words.encode(coding, "replace"))
