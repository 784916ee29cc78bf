import json
import zipfile
from random import Random

import numpy as np
import pytest

from fuzz.inputs import digest
from fuzz.mutators import mutated, raw, zips
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
