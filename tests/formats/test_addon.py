"""The add-on for Blender, as a file."""

from __future__ import annotations

import ast
import zipfile
from importlib import metadata
from pathlib import Path

import pytest

from lipmotion.errors import ExportError
from lipmotion.formats.blender import write_addon


def test_the_archive_has_one_folder_with_code_and_manifest(tmp_path: Path) -> None:
    write_addon("blender", tmp_path / "a.zip")
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


def test_the_same_version_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a.zip", "b.zip"):
        write_addon("blender", tmp_path / name)
    assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()


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
