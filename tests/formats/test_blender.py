import ast
import zipfile
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formats.examples import of_motion
from lipmotion.errors import ExportError
from lipmotion.formats import write_motion
from lipmotion.formats.blender import write_addon
from lipmotion.types import WEIGHT, Channel, Motion


def run(path: Path) -> dict[str, Any]:
    """Return what the script defines, without running it as a program."""
    names: dict[str, Any] = {"__name__": "script", "__file__": str(path)}
    exec(compile(path.read_text(), str(path), "exec"), names)  # noqa: S102
    return names


@pytest.fixture
def path(tmp_path: Path) -> Path:
    names = ("jawOpen", 'odd "name"\\')
    moved = Motion(np.random.default_rng(5).random((7, 2)), 100.0, tuple(Channel(name, WEIGHT) for name in names))
    source = {"file": "a.wav", "path": "../a 'b'.wav", "start_s": "0.25"}
    write_motion(tmp_path / "a.blender.py", of_motion(moved, stepped=("jawOpen", "width")), source=source, model={})
    return tmp_path / "a.blender.py"


def test_it_holds_curves_rate_and_sound(path: Path) -> None:
    names = run(path)
    assert names["RATE_HZ"] == pytest.approx(100.0)
    assert names["SOUND"] == "../a 'b'.wav"
    assert names["STEPPED"] == ("jawOpen",)
    assert names["SOUND_S"] == pytest.approx(0.25)
    assert list(names["MOTION"]) == ["jawOpen", 'odd "name"\\']
    assert names["spelling"]("mouthSmile_L") == "mouthsmileleft"
    assert {"key_frames", "key_shapes", "at_frames", "main"} <= set(names)
    assert names["MOTION"]["jawOpen"] == pytest.approx(np.random.default_rng(5).random((7, 2))[:, 0].tolist(), abs=1e-5)


def test_it_imports_nothing_but_the_standard_library_and_bpy(path: Path) -> None:
    tree = ast.parse(path.read_text())
    modules = [node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    modules += [each.name for node in ast.walk(tree) if isinstance(node, ast.Import) for each in node.names]
    assert set(modules) <= {"__future__", "typing", "bisect", "bpy", "csv", "json", "math", "os", "re"}
    assert all(node.level == 0 for node in ast.walk(tree) if isinstance(node, ast.ImportFrom))


def test_the_archive_has_one_folder_with_code_and_manifest(tmp_path: Path) -> None:
    for name in ("a.zip", "b.zip"):
        write_addon("blender", tmp_path / name)
    assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()
    with zipfile.ZipFile(tmp_path / "a.zip") as archive:
        names = archive.namelist()
        texts = {name: archive.read(name).decode() for name in names}
    assert {Path(name).parts[0] for name in names} == {"lipmotion_blender"}
    assert 'blender_version_min = "4.2.0"' in texts["lipmotion_blender/blender_manifest.toml"]
    assert "bl_info" in texts["lipmotion_blender/__init__.py"]
    for name, text in texts.items():
        if name.endswith(".py"):
            imported = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Import | ast.ImportFrom)]
            named = [each.names[0].name if isinstance(each, ast.Import) else each.module or "" for each in imported]
            assert not [each for each in named if each.startswith(("lipmotion", "numpy"))]


def test_what_cannot_be_written_is_said(tmp_path: Path) -> None:
    for program, name, message in (
        ("maya", "a.zip", "no add-on for 'maya', required one of blender"),
        ("blender", "a.py", "unknown format '.py'; Blender installs a .zip"),
        ("blender", "missing/a.zip", "does not exist"),
    ):
        with pytest.raises(ExportError, match=message):
            write_addon(program, tmp_path / name)
        assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("installed", "version"), [(None, "0.0.0"), ("1.2.3", "1.2.3"), ("1.2.3.dev4", "1.2.3")])
def test_the_version_is_three_numbers_also_where_nothing_is_installed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, installed: str | None, version: str
) -> None:
    def found(name: str) -> str:
        if installed is None:
            raise metadata.PackageNotFoundError(name)
        return installed

    monkeypatch.setattr(metadata, "version", found)
    write_addon("blender", tmp_path / "a.zip")
    with zipfile.ZipFile(tmp_path / "a.zip") as archive:
        assert f'\nversion = "{version}"\n' in archive.read("lipmotion_blender/blender_manifest.toml").decode()
