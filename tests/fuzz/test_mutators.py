import json
import zipfile
from random import Random

import numpy as np
import pytest

from fuzz.inputs import digest
from fuzz.mutators import documents, mutated, raw, zips
from meshes.gltf import document, glb
from robustness.case import npy
from robustness.motion_cases import GOOD

ROUNDS = 40
DOCUMENT = json.dumps(GOOD).encode()
ARRAY = npy(np.arange(12.0).reshape(4, 3))
ZIP = zips.zipped([("header.json", DOCUMENT), ("a.npy", ARRAY)], zipfile.ZIP_DEFLATED)
SOUND = b"RIFF" + bytes(4) + b"WAVEfmt \x10\0\0\0\1\0\1\0\x80\x3e\0\0\0\x7d\0\0\2\0\x10\0data\x08\0\0\0" + bytes(8)
SAMPLES = {
    **{
        "a.json": DOCUMENT,
        "a.npy": ARRAY,
        "a.npz": ZIP,
        "a.wav": SOUND,
        "a.mp4": bytes(40),
        "a.csv": b"time_s,a\n0,1\n",
    },
    **{"a.txt": b"Hello, 42 people.\n", "a.flac": b"fLaC" + bytes(40), "empty.json": b"", "empty.txt": b""},
    **{"a.svg": b'<svg viewBox="0 0 4 4"><path d="M0 0h1v1z"/></svg>', "empty.svg": b""},
    **{"empty.wav": b"", "empty.npy": b"", "empty.npz": b"", "empty.mp4": b""},
}


@pytest.mark.parametrize("name", SAMPLES)
def test_changes_are_many_and_the_same_again(name):
    def made(seed: int) -> list[tuple[int, bytes]]:
        chance, sample = Random(seed), {name: SAMPLES[name]}
        changed = (mutated(chance, sample, sample) for _ in range(ROUNDS))
        return [(len(files[name]), digest(files)) for files in changed]

    found = made(1)
    assert len(set(found)) > ROUNDS / 4
    assert max(size for size, _ in found) <= raw.LARGEST_BYTES
    assert found == made(1) != made(2)


def test_every_hostile_value_comes_to_every_place():
    small = b'{"a": [1, {"b": 2}]}'
    places = ('{"a": %s}', '{"a": [%s, {"b": 2}]}', '{"a": [1, %s]}', '{"a": [1, {"b": %s}]}')
    wanted = {(place % value).encode() for place in places for value in documents.HOSTILE}
    for name in ("a.json", "a.gltf"):
        made = [files[name] for files in documents.systematic({name: small}, Random(0))]
        assert wanted <= set(made)
        assert len(made) == len(places) * (len(documents.HOSTILE) + documents.OTHER_PARTS)


def test_documents_inside_of_other_files_are_changed_in_their_place():
    whole = glb(*document())
    for name, content in (("a.glb", whole), ("a.npz", ZIP)):
        made = next(documents.systematic({name: content}, Random(0)))[name]
        found, before = documents.document_in(name, made), documents.document_in(name, content)
        assert found is not None
        assert before is not None
        assert found[0] != before[0]
        assert found[1](before[0])[:4] == content[:4]
    sizes = [documents.change(Random(seed), whole) for seed in range(40)]
    right = [int.from_bytes(made[8:12], "little") == len(made) for made in sizes if len(made) >= 12]
    assert sum(right) > 30
