"""Mutations of WAV and AVI files: chunks, their sizes and order, and the fields of the format."""

import struct
from random import Random

from fuzz.mutators import raw

Chunk = tuple[bytes, bytes]
FIELDS = {
    "tag": (0, "H"), "channels": (2, "H"), "rate": (4, "I"), "bytes": (8, "I"), "align": (12, "H"), "bits": (14, "H"),
}  # fmt: skip
VALUES = (0, 1, 2, 3, 6, 7, 8, 11, 16, 24, 32, 64, 255, 4000, 8000, 44_100, 65_534, 10**6, 2**31, 2**32 - 1)


def change(chance: Random, content: bytes) -> bytes:
    """Change, add or remove one chunk; content without chunks is changed as bytes."""
    chunks = _chunks(content)
    if content[:4] != b"RIFF" or not chunks:
        return raw.change(chance, content)
    at = chance.randrange(len(chunks))
    name, body = chunks[at]
    kind = chance.choice(("field", "field", "size", "double", "remove", "swap", "extra", "inside"))
    if kind == "field" and any(chunk[0] == b"fmt " for chunk in chunks):
        chunks = [(n, _field(chance, b) if n == b"fmt " else b) for n, b in chunks]
    elif kind == "remove":
        del chunks[at]
    elif kind == "double":
        chunks.insert(chance.randrange(len(chunks) + 1), chunks[at])
    elif kind == "swap":
        chance.shuffle(chunks)
    elif kind == "extra":
        name = chance.choice((b"LIST", b"fact", b"cue ", b"bext", b"id3 ", b"data", b"fmt ", b"RIFF"))
        chunks.insert(at, (name, chance.randbytes(chance.choice((0, 1, 16, 1000)))))
    elif kind == "inside":
        chunks[at] = (name, raw.change(chance, body))
    sizes = {at: chance.choice(raw.EDGES) % 2**32} if kind == "size" else {}
    return content[:12] + b"".join(_written(chunk, sizes.get(i)) for i, chunk in enumerate(chunks))


def _chunks(content: bytes) -> list[Chunk]:
    chunks, at = [], 12
    while at + 8 <= len(content):
        size = int.from_bytes(content[at + 4 : at + 8], "little")
        chunks.append((content[at : at + 4], content[at + 8 : at + 8 + size]))
        at += 8 + size + size % 2
    return chunks


def _written(chunk: Chunk, size: int | None) -> bytes:
    name, body = chunk
    stated = struct.pack("<I", len(body) if size is None else size)
    return name + stated + body + b"\0" * (len(body) % 2)


def _field(chance: Random, body: bytes) -> bytes:
    at, form = FIELDS[chance.choice(sorted(FIELDS))]
    value = struct.pack("<" + form, chance.choice(VALUES) % (1 << 8 * struct.calcsize(form)))
    return body[:at] + value + body[at + len(value) :]
