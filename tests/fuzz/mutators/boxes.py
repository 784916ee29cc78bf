"""Mutations of MP4 files: boxes, and the numbers in them."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from random import Random

from fuzz.mutators import raw

CONTAINERS = frozenset(
    {b"moov", b"trak", b"mdia", b"minf", b"stbl", b"edts", b"dinf", b"udta", b"mvex", b"moof", b"traf"}
)


@dataclass
class Box:
    """One box: its content, or the boxes in it."""

    name: bytes
    body: bytes
    inner: list[Box] = field(default_factory=list)


def change(chance: Random, content: bytes) -> bytes:
    """Change one box and correct the sizes of the enclosing ones; content without boxes is changed as bytes."""
    root = Box(b"", b"", _boxes(content))
    places = list(_places(root))
    if not places:
        return raw.change(chance, content)
    around, at = chance.choice(places)
    box = around.inner[at]
    kind = chance.choice(("number",) * 5 + ("remove", "double", "swap", "rename", "inside", "many"))
    if kind == "remove":
        del around.inner[at]
    elif kind == "double":
        around.inner.insert(at, box)
    elif kind == "swap":
        chance.shuffle(around.inner)
    elif kind == "rename":
        around.inner[at] = Box(
            chance.choice([b"free", b"????", *(a.inner[i].name for a, i in places)]), box.body, box.inner
        )
    elif kind == "many":
        around.inner[at] = Box(box.name, box.body[:8] + box.body[8:16] * 2000 + box.body[16:], box.inner)
    else:
        around.inner[at] = Box(box.name, (_number if kind == "number" else raw.change)(chance, box.body), box.inner)
    return b"".join(map(_written, root.inner))


def _boxes(content: bytes) -> list[Box]:
    boxes, at = [], 0
    while at + 8 <= len(content):
        size, name = struct.unpack_from(">I4s", content, at)
        if size < 8:
            break
        body = content[at + 8 : at + size]
        boxes.append(Box(name, b"", _boxes(body)) if name in CONTAINERS else Box(name, body))
        at += size
    return boxes


def _places(box: Box) -> Iterator[tuple[Box, int]]:
    for at, inner in enumerate(box.inner):
        yield box, at
        yield from _places(inner)


def _written(box: Box) -> bytes:
    body = box.body + b"".join(map(_written, box.inner))
    return struct.pack(">I4s", len(body) + 8, box.name) + body


def _number(chance: Random, body: bytes) -> bytes:
    """Overwrite one of the first numbers: versions, time scales, counts, durations."""
    if len(body) < 4:
        return raw.change(chance, body)
    at = 4 * chance.randrange(min(len(body) // 4, 24))
    (old,) = struct.unpack_from(">I", body, at)
    near = (old + 1, old - 1, 2 * old, 1000 * old, old // 2, old << 16, 48_000 * 590)
    value = chance.choice((*raw.EDGES, *near)) % 2**32
    return body[:at] + struct.pack(">I", value) + body[at + 4 :]
