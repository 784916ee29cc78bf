"""Mutations of JSON documents: other types, huge numbers, NaN, deep nesting, repeated keys."""

import json
from collections.abc import Iterator
from copy import deepcopy
from random import Random
from typing import Any

from fuzz.mutators import raw, text

NUMBERS = (
    0, -1, 1, 2, -0.0, 0.5, 1e-320, 1e12, 1e300, -1e300, 10**400, 2**53, 2**63, float("nan"), float("inf"), -1e-9,
)  # fmt: skip
VALUES: tuple[Any, ...] = (*NUMBERS, *NUMBERS, None, True, False, "", "0", "é\ud800", [], {}, [[]], [None], {"": None})
NESTING = 100_000  # nested brackets; Python's own limit is far lower


def change(chance: Random, content: bytes) -> bytes:
    """Change one value of a document; other content is changed as bytes."""
    try:
        tree = json.loads(content)
    except (ValueError, RecursionError):
        return raw.change(chance, content)
    found = list(places(tree, 2000))
    if not found or chance.random() < 0.05:
        deep = b"[" * NESTING if chance.random() < 0.5 else b'{"a":' * NESTING
        value = json.dumps(chance.choice(VALUES)).encode("utf-8", "surrogatepass")
        return chance.choice((deep, value, content + content, b"[" + content + b"]"))
    within, key = chance.choice(found)
    _set(chance, within, key)
    return _written(chance, tree)


def places(tree: Any, most: int) -> Iterator[tuple[Any, Any]]:
    """Yield containers and the keys in them, those near the root first."""
    queue = [tree]
    for within in queue:
        if isinstance(within, dict | list):
            keys = list(within) if isinstance(within, dict) else list(range(min(len(within), 20)))
            for key in keys:
                yield within, key
                queue.append(within[key])
        if len(queue) > most:
            return


def _set(chance: Random, within: Any, key: Any) -> None:
    kind = chance.choice(("value", "value", "number", "number", "remove", "wrap", "many", "rename", "swap", "text"))
    value = within[key]
    if kind == "remove":
        del within[key]
    elif kind == "wrap":
        within[key] = chance.choice(([value], {"a": value}, str(value)))
    elif kind == "many" and isinstance(value, list):
        within[key] = [deepcopy(item) for item in value for _ in range(chance.choice((2, 100)))][:20_000]
    elif kind == "rename" and isinstance(within, dict):
        within[chance.choice(text.WORDS)] = within.pop(key)
    elif kind == "swap":
        other = chance.choice(list(within) if isinstance(within, dict) else range(len(within)))
        within[key], within[other] = within[other], value
    elif kind == "text" and isinstance(value, str):
        within[key] = value + chance.choice(text.WORDS) * chance.choice((1, 1, 1000))
    elif kind == "number" and isinstance(value, int | float):
        within[key] = chance.choice((-value, value + 1, value * 1000, value / 3, value * 1e30, int(value), str(value)))
    else:
        within[key] = deepcopy(chance.choice(VALUES))


def _written(chance: Random, tree: Any) -> bytes:
    """Return a document as text, sometimes with a repeated key."""
    written = json.dumps(tree, ensure_ascii=chance.random() < 0.5).encode("utf-8", "surrogatepass")
    if isinstance(tree, dict) and tree and chance.random() < 0.1:
        key = chance.choice(list(tree))
        pair = json.dumps({key: chance.choice(VALUES)}).encode()[1:-1]
        return b"{" + pair + b", " + written[1:] if chance.random() < 0.5 else written[:-1] + b", " + pair + b"}"
    return written
