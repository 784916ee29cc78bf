"""Mutations of bytes, whatever the format."""

import struct
from random import Random

LARGEST_BYTES = 1 << 23  # bytes of one file: larger ones are not made
PIECES = (b"\0", b"\xff", b"-", b"nan", b"1e999", b"9" * 40, b'"', b"{", b"[", b"]", b",", b"\n", b"\t", b" ", b"null")
EDGES = (0, 1, -1, 2, 127, 128, 255, 256, 32_767, 32_768, 65_535, 65_536, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**63)
"""Numbers at the limits of integer types."""


def change(chance: Random, content: bytes) -> bytes:
    """Truncate, overwrite, remove, insert, repeat, flip a bit, or overwrite with a number."""
    at, size = chance.randrange(len(content) + 1), chance.choice((1, 2, 4, 8, 16, 64, 256, 4096))
    piece = chance.choice(PIECES) if chance.random() < 0.5 else chance.randbytes(chance.randint(1, 8))
    kind = chance.choice(("cut", "write", "remove", "insert", "repeat", "flip", "number", "number"))
    if kind == "cut":
        return content[:at]
    if kind == "repeat":
        return content[:at] + content[at : at + size] * chance.choice((2, 2, 3, 50)) + content[at + size :]
    if kind == "remove":
        return content[:at] + content[at + size :]
    if kind == "insert":
        return content[:at] + piece + content[at:]
    if kind == "flip" and at < len(content):
        piece = bytes([content[at] ^ 1 << chance.randrange(8)])
    if kind == "number":
        piece = number(chance)
    return content[:at] + piece + content[at + len(piece) :]


def number(chance: Random) -> bytes:
    """Return a number at the limit of an integer type, of any size and byte order."""
    form = chance.choice("<>") + chance.choice("BHIQ")
    return struct.pack(form, chance.choice(EDGES) % (1 << 8 * struct.calcsize(form)))


def spliced(chance: Random, content: bytes, other: bytes) -> bytes:
    """Return the beginning of one content with the end of another."""
    return content[: chance.randrange(len(content) + 1)] + other[chance.randrange(len(other)) :]
