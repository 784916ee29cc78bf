"""Mutations of inputs: of their bytes, and of formats."""

from collections.abc import Callable
from pathlib import PurePosixPath
from random import Random

from fuzz.inputs import Files
from fuzz.mutators import arrays, boxes, documents, json_text, raw, riff, text, xml_text, zips

Mutate = Callable[[Random, bytes], bytes]

FORMS: dict[str, tuple[Mutate, ...]] = {
    ".json": (json_text.change, json_text.change, text.change),
    ".gltf": (json_text.change, json_text.change, text.change),
    ".glb": (documents.change, documents.change, documents.change),
    ".vrm": (documents.change, documents.change, documents.change),
    ".binding": (zips.change, zips.change),
    ".obj": (text.change, text.change, text.change),
    ".mtl": (text.change, text.change, text.change),
    ".npy": (arrays.change, arrays.change),
    ".npz": (zips.change, zips.change),
    ".lipmotion": (zips.change, zips.change),
    ".face": (zips.change, zips.change),
    ".wav": (riff.change, riff.change),
    ".avi": (riff.change,),
    ".mp4": (boxes.change, boxes.change),
    ".mov": (boxes.change, boxes.change),
    ".m4a": (boxes.change, boxes.change),
    ".csv": (text.change, text.change, text.change),
    ".toml": (text.change, text.change, text.change),
    ".txt": (text.change, text.change, text.change),
    ".align": (text.change, text.change, text.change),
    ".lab": (text.change, text.change, text.change),
    ".TextGrid": (text.change, text.change, text.change),
    ".svg": (xml_text.change, xml_text.change, text.change),
    ".dict": (text.change, text.change, text.change),
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
