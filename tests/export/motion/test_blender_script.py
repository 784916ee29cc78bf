"""The script for Blender stands alone, and holds the curves."""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lipmotion.export import write_motion
from lipmotion.types import WEIGHT, Channel, Generation, Motion, StateTrace, Timeline


def run(path: Path) -> dict[str, Any]:
    """Return what the script defines, without running it as a program."""
    names: dict[str, Any] = {"__name__": "script", "__file__": str(path)}
    exec(compile(path.read_text(), str(path), "exec"), names)  # noqa: S102
    return names


@pytest.fixture
def path(tmp_path: Path) -> Path:
    names = ("jawOpen", 'odd "name"\\')
    moved = Motion(np.random.default_rng(5).random((7, 2)), 100.0, tuple(Channel(name, WEIGHT) for name in names))
    trace = StateTrace(("a",), np.zeros(7, np.intp))
    made = Generation(moved, np.zeros((7, 2)), Timeline(()), trace, stepped=("jawOpen", "width"))
    source = {"file": "a.wav", "path": "../a 'b'.wav", "start_s": "0.25"}
    write_motion(tmp_path / "a.blender.py", made, source=source, model={})
    return tmp_path / "a.blender.py"


def test_it_holds_curves_rate_and_sound(path: Path) -> None:
    names = run(path)
    assert names["RATE_HZ"] == pytest.approx(100.0)
    assert names["SOUND"] == "../a 'b'.wav"
    assert names["STEPPED"] == ("jawOpen",)
    assert names["SOUND_S"] == pytest.approx(0.25)
    assert list(names["MOTION"]) == ["jawOpen", 'odd "name"\\']
    assert names["MOTION"]["jawOpen"] == pytest.approx(np.random.default_rng(5).random((7, 2))[:, 0].tolist(), abs=1e-5)


def test_it_imports_nothing_but_the_standard_library_and_bpy(path: Path) -> None:
    tree = ast.parse(path.read_text())
    modules = [node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    modules += [each.name for node in ast.walk(tree) if isinstance(node, ast.Import) for each in node.names]
    assert set(modules) <= {"__future__", "typing", "bisect", "bpy", "csv", "json", "math", "os", "re"}
    assert all(node.level == 0 for node in ast.walk(tree) if isinstance(node, ast.ImportFrom))


def test_the_code_is_that_of_the_addon(path: Path) -> None:
    names = run(path)
    assert names["spelling"]("mouthSmile_L") == "mouthsmileleft"
    assert {"key_frames", "key_shapes", "at_frames", "main"} <= set(names)
