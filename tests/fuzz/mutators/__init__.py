"""Mutations of inputs: of their bytes, and of formats."""

from collections.abc import Callable
from pathlib import PurePosixPath
from random import Random

from fuzz.inputs import Files
from fuzz.mutators import arrays, documents, json_text, raw, text, zips

Mutate = Callable[[Random, bytes], bytes]
TEXTS = ".svg .obj .mtl .csv .toml .txt .align .lab .TextGrid .dict".split()
FORMS: dict[str, tuple[Mutate, ...]] = {
    **dict.fromkeys(TEXTS, (text.change,) * 3),
    **dict.fromkeys((".json", ".gltf"), (json_text.change, json_text.change, text.change)),
    **dict.fromkeys((".glb", ".vrm"), (documents.change,) * 3),
    **dict.fromkeys((".binding", ".npz", ".lipmotion", ".face"), (zips.change,) * 2),
    ".npy": (arrays.change,) * 2,
}
"""By suffix; the bytes of any file are changed as well."""


def mutated(chance: Random, files: Files, other: Files) -> Files:
    """Return an input with one to four changes in its files.

    other : another input, of which parts may be taken
    """
    result = dict(files)
    for _ in range(min(1 + int(chance.expovariate(1.0)), 4)):
        name = chance.choice(sorted(result))
        result[name] = _changed(chance, name, result[name], other.get(name, b""))
    return result


def _changed(chance: Random, name: str, content: bytes, other: bytes) -> bytes:
    if other and chance.random() < 0.05:
        return raw.spliced(chance, content, other)
    ways = (*FORMS.get(PurePosixPath(name).suffix, ()), raw.change)
    try:
        return chance.choice(ways)(chance, content)[: raw.LARGEST_BYTES]
    except Exception:  # the content does not allow this change
        return raw.change(chance, content)
