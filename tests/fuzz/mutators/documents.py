"""JSON inside files: of text, of glTF's binary container, and of archives; and every hostile value in every place."""

import json
import struct
from collections.abc import Callable, Iterator
from pathlib import PurePosixPath
from random import Random

from fuzz.inputs import Files
from fuzz.mutators import json_text, raw, zips

Document = tuple[bytes, Callable[[bytes], bytes]]
"""The JSON text in a file, and a function that returns the file with another one."""
NESTING = 300
HOSTILE = (
    *("null", "true", "false", "0", "-1", "1", "0.5", "255", "1e308", "-1e308", "1e999", "NaN", "-Infinity", "1e-320"),
    *("1" + "0" * 30, "-1" + "0" * 30, "1" + "0" * 400, "9" * 5000, "4294967296", "9007199254740993", "1e9"),
    *('""', '"0"', '"' + "x" * 3000 + '"', '"\\ud800"', '"../../x"', '"\\u0000"', '"data:;base64,AAAA"', '"head.glb"'),
    *("[]", "[0]", "[-1]", "[null]", "[[0]]", "{}", '{"": null}', '{"a": 1, "a": 2}', "[" + "0," * 1000 + "0]"),
    *("[" * NESTING + "]" * NESTING, '{"a":' * NESTING + "0" + "}" * NESTING, "[" * 100_000),
    *("[{}]", "[[[0, 0], 1e308]]"),
)
"""Values as JSON spells them, and some that it does not."""
OTHER_PARTS = 3  # values of the same document that are put in each place
MARK = "a place in a document"
_JSON, _ARCHIVES = {".json", ".gltf"}, {".npz", ".lipmotion", ".face", ".binding"}


def document_in(name: str, content: bytes) -> Document | None:
    """Return the JSON in a file, by its name; None if there is none."""
    suffix = PurePosixPath(name).suffix
    if suffix in _JSON:
        return content, lambda text: text
    if suffix in _ARCHIVES:
        return _in_archive(content)
    if suffix in {".glb", ".vrm"} and len(content) >= 20:
        (size,) = struct.unpack_from("<I", content, 12)
        return content[20 : 20 + size], lambda text: _glb(text, content[20 + size :])
    return None


def change(chance: Random, content: bytes) -> bytes:
    """Change the document of a GLB, and keep the sizes right; or the rest of it, as bytes."""
    found = document_in("a.glb", content)
    if found is None or chance.random() < 0.15:
        return raw.change(chance, content)
    text, written = found
    return written(json_text.change(chance, text))


def systematic(files: Files, chance: Random) -> Iterator[Files]:
    """Yield a good input with every hostile value in every place of its documents, in any order."""
    orders = []
    for name in sorted(files):
        found = document_in(name, files[name])
        try:
            count = 0 if found is None else sum(1 for _ in json_text.places(json.loads(found[0]), 2000))
        except (ValueError, RecursionError):
            continue
        orders += [(name, place, value) for place in range(count) for value in range(len(HOSTILE) + OTHER_PARTS)]
    chance.shuffle(orders)
    for name, place, value in orders:
        found = document_in(name, files[name])
        assert found is not None
        text, written = found
        yield files | {name: written(_placed(text, place, value, chance))}


def _placed(text: bytes, place: int, value: int, chance: Random) -> bytes:
    tree = json.loads(text)
    found = list(json_text.places(tree, 2000))
    within, key = found[place]
    other, theirs = chance.choice(found)
    new = HOSTILE[value] if value < len(HOSTILE) else json.dumps(other[theirs])
    within[key] = MARK
    return json.dumps(tree).replace(f'"{MARK}"', new).encode()


def _in_archive(content: bytes) -> Document | None:
    members = zips.members_of(content)
    name = next((name for name, _ in members if name.endswith(".json")), None)
    if name is None:
        return None
    others = {member: body for member, body in members if member != name}
    return dict(members)[name], lambda text: zips.zipped([(name, text), *others.items()], 0)


def _glb(text: bytes, rest: bytes) -> bytes:
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sIIII", b"glTF", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A)
    return head + text + rest
