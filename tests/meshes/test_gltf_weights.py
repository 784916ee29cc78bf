"""Animations of glTF as motion: even and uneven keys, steps, splines, several meshes, expressions of VRM."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.export.base import read_motion, readable_suffixes
from lipmotion.types import WEIGHT, Channel, Motion
from meshes import gltf
from meshes.heads import head, write_glb

NAMES = ["jawOpen", "mouthWide"]


def animated(
    tmp_path: Path,
    time_s: list[float],
    values: Any,
    kind: str = "LINEAR",
    target: dict[str, Any] | None = None,
    name: str = "a.glb",
) -> Path:
    """Write the square of two targets with one animation."""
    content, binary = gltf.animated_document(time_s, values, kind, target)
    (tmp_path / name).write_bytes(gltf.glb(content, binary))
    return tmp_path / name


def test_even_keys_are_the_frames(tmp_path: Path) -> None:
    rows = np.random.default_rng(2).random((25, 2))
    motion, units = read_motion(animated(tmp_path, [n / 29.97 for n in range(25)], rows))
    assert (motion.rate_hz, len(units), list(motion.names)) == (pytest.approx(30000 / 1001), 0, NAMES)
    assert motion.values == pytest.approx(rows, abs=1e-4)
    assert {channel.unit for channel in motion.channels} == {WEIGHT}


def test_what_is_written_of_a_character_is_read(tmp_path: Path) -> None:
    moved = Motion(np.random.default_rng(3).random((40, 2)), 60.0, tuple(map(Channel, ("jawOpen", "mouthPucker"))))
    write_glb(tmp_path / "a.glb", head(), moved)
    motion, _ = read_motion(tmp_path / "a.glb")
    assert motion.rate_hz == 60
    for name in moved.names:
        assert motion[name] == pytest.approx(moved[name], abs=1e-5)


@pytest.mark.parametrize(
    ("kind", "values", "expected"),
    [
        ("LINEAR", [[0, 1], [1, 0], [0.5, 0]], {0.0: (0, 1), 0.25: (0, 1), 0.75: (0.5, 0.5), 1.5: (0.75, 0)}),
        ("STEP", [[0, 1], [1, 0], [0.5, 0]], {0.0: (0, 1), 0.75: (0, 1), 1.0: (1, 0), 2.0: (0.5, 0)}),
        (
            "CUBICSPLINE",
            [[[0, 0], [0, 1], [2, 0]], [[0, 0], [1, 0], [0, 0]], [[0, 0], [0.5, 0], [0, 0]]],
            {0.5: (0, 1), 0.75: (0.5 + 0.125, 0.5), 1.0: (1, 0), 2.0: (0.5, 0)},
        ),
    ],
)
def test_uneven_keys_are_sampled(
    tmp_path: Path, kind: str, values: Any, expected: dict[float, tuple[float, float]]
) -> None:
    motion, _ = read_motion(animated(tmp_path, [0.5, 1.0, 2.0], values, kind))
    assert motion.rate_hz == 60
    for time_s, row in expected.items():
        assert motion.values[round(60 * time_s)] == pytest.approx(row, abs=1e-6)


def test_expressions_of_a_vrm_animation(tmp_path: Path) -> None:
    rows = [[0, 0, 0], [0.75, 0, 0], [1, 0, 0]]
    file = animated(tmp_path, [0, 1 / 30, 2 / 30], rows, target={"node": 1, "path": "translation"}, name="a.vrma")
    motion, _ = read_motion(file)
    assert (motion.rate_hz, motion.names) == (30, ("eyeBlinkLeft", "eyeBlinkRight"))
    assert motion["eyeBlinkRight"] == pytest.approx([0, 0.75, 1], abs=1e-6)
    assert {".glb", ".gltf", ".vrma"} <= {*readable_suffixes()}


def test_what_moves_no_face_or_is_damaged_is_refused(tmp_path: Path) -> None:
    cases = {
        r"a\.glb: it has no animation of morph targets or expressions": animated(tmp_path, [0, 1], [[0, 0]] * 2),
        r"b\.glb: the times of an animation do not rise": animated(tmp_path, [0, 0], [[0, 0]] * 2, name="b.glb"),
        r"c\.glb: an array of 2 elements, required 4": animated(tmp_path, [0, 1], [[0, 0]], name="c.glb"),
        r"d\.glb: no glTF document": tmp_path / "d.glb",
    }
    content, binary = gltf.document()
    (tmp_path / "a.glb").write_bytes(gltf.glb(content, binary))
    (tmp_path / "d.glb").write_bytes(b"no")
    for message, file in cases.items():
        with pytest.raises(InputError, match=message):
            read_motion(file)
