"""Streams of meshopt are decoded; damaged ones are refused."""

from __future__ import annotations

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.meshes.files.meshopt import decode_attributes, decode_exponents, decode_indices, decode_triangles
from meshes.gltf import packed_attributes


def test_attributes_come_back():
    for count, stride in ((1, 4), (16, 8), (300, 12), (700, 36)):
        rng = np.random.default_rng(count)
        smooth = np.cumsum(rng.integers(-2, 3, (count, stride)), axis=0)
        smooth[:, ::3] = rng.integers(0, 256, (count, len(range(0, stride, 3))))
        elements = (smooth & 255).astype(np.uint8)
        np.testing.assert_array_equal(decode_attributes(packed_attributes(elements), count, stride), elements)


TAIL = bytes.fromhex("76 87 56 67 78 a9 86 65 89 68 98 01 69 00 00")
"""The table at the end of each stream of triangles."""


@pytest.mark.parametrize(
    ("start", "triangles"),
    [
        ("e0 f0 10 fe ff f0 0c ff 02 02 02 00", [[0, 1, 2], [2, 1, 3], [4, 6, 5], [7, 8, 9]]),
        ("e1 f0 10 fe 1f 3d 00 0a 00", [[0, 1, 2], [2, 1, 3], [0, 1, 2], [2, 1, 5], [2, 1, 4]]),
    ],
)
def test_triangles_of_both_versions(start, triangles):
    """Streams of the reference implementation (meshoptimizer): fresh, shared, repeated and arbitrary vertices."""
    stream = bytes.fromhex(start) + TAIL
    assert decode_triangles(stream, 3 * len(triangles)).reshape(-1, 3).tolist() == triangles


def test_indices_without_triangles():
    stream = bytes.fromhex("d1 00 04 cd 01 04 07 98 1f 00 00 00 00")
    assert decode_indices(stream, 6).tolist() == [0, 1, 51, 2, 49, 1000]


def test_exponents():
    stored = np.array([[3 | (-1 & 0xFF) << 24, (-5 & 0xFFFFFF) | 2 << 24]], np.uint32).view(np.uint8)
    np.testing.assert_allclose(decode_exponents(stored), [[1.5, -20.0]])


def test_damaged_streams_are_refused():
    for stream in (b"", b"\xa0", b"\xb0" + b"\0" * 60, b"\xa1" + b"\0" * 60, b"\xa0" + b"\xff" * 40):
        with pytest.raises(InputError, match=r"export it (again|without)"):
            decode_attributes(stream, 100, 8)
    for decode in (decode_triangles, decode_indices):
        with pytest.raises(InputError):
            decode(b"\xe1\xff\xff" + b"\x80" * 20, 300)
