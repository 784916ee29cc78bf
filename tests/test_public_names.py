import ast
import importlib
import inspect
import sys
from pathlib import Path
from typing import Any

import pytest

import lipmotion
from children import run_child
from lipmotion import errors
from lipmotion.errors import InputError, LipMotionError, MissingDependencyError
from lipmotion.printable import printable

HEAVY = ("numpy", "scipy", "av", "PIL", "pocketsphinx", "tqdm", "cv2", "mediapipe")


def typed_names() -> dict[str, str]:
    """Return what type checkers see: every imported name with its module."""
    return {
        alias.name: node.module or ""
        for node in ast.parse(Path(lipmotion.__file__).with_suffix(".pyi").read_text()).body
        if isinstance(node, ast.ImportFrom) and node.module != "typing"
        for alias in node.names
    }


def test_public_names_are_those_that_type_checkers_see() -> None:
    typed = typed_names()
    assert lipmotion.__all__ == sorted(typed)
    added = sorted({*dir(lipmotion)} - {*lipmotion.__all__})
    own = "FilmedFace SessionPictures analyse_study build_face compare evaluate load_face map_onto prepare save_face"
    assert added == own.split()
    assert all(getattr(lipmotion, name).__module__.partition(".")[0] != "lipmotion" for name in added)
    for name, module in typed.items():
        assert getattr(lipmotion, name) is getattr(importlib.import_module(module), name)
    with pytest.raises(AttributeError, match="module 'lipmotion' has no attribute 'animat'"):
        _ = lipmotion.animat
    assert (Path(lipmotion.__file__).parent / "py.typed").is_file()


def test_heavy_packages_are_imported_when_they_are_needed() -> None:
    program = (
        "import sys, lipmotion, lipmotion.errors\n"
        "dir(lipmotion)\n"
        "from lipmotion.cli.main import main\n"
        "for words in (['--version'], ['--help'], ['animate', '--help']):\n"
        "    try:\n        main(words)\n    except SystemExit:\n        pass\n"
        f"print([name for name in {HEAVY!r} if name in sys.modules], file=sys.stderr)"
    )
    done = run_child([sys.executable, "-c", program], check=True)
    assert done.stderr.strip() == "[]"


CLASSES: list[Any] = [value for _, value in inspect.getmembers(errors, inspect.isclass)]
NAMES = ("InputError", "CorpusError", "AlignmentError", "ModelFormatError", "ExportError", "MissingDependencyError")
EXIT_CODES = dict(zip(NAMES, range(3, 9), strict=True))
"""As ``lipmotion --help`` lists them: scripts depend on these numbers."""


def test_every_error_has_its_exit_code() -> None:
    assert {kind.__name__: kind.exit_code for kind in CLASSES if kind is not LipMotionError} == EXIT_CODES
    assert all(issubclass(kind, LipMotionError) for kind in CLASSES)
    assert issubclass(InputError, ValueError)
    assert issubclass(MissingDependencyError, ImportError)


def test_the_module_imports_nothing() -> None:
    tree = ast.parse(inspect.getsource(errors))
    imports = [ast.unparse(node) for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    assert imports == ["from __future__ import annotations"]


def test_what_is_printable() -> None:
    for text in ("plain", "Ünïcödé 語 👩‍👧 ן ک‌ه", "\u00a0\u3000", "back\\slash"):
        assert printable(text) == text
    for code in (*range(0x20), *range(0x7F, 0xA0), 0xAD, 0x200E, 0x2028, 0x202E, 0x2066, 0xFEFF, 0xDC80, 0xE0041):
        assert printable(f"a{chr(code)}b") == "a" + chr(code).encode("unicode_escape").decode() + "b"
    assert printable(ValueError("two\nlines")) == r"two\nlines"
