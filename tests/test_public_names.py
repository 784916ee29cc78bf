import ast
import importlib
import sys
from pathlib import Path

import pytest

import lipmotion
from children import run_child

HEAVY = ("numpy", "scipy", "av", "PIL", "pocketsphinx", "tqdm", "cv2", "mediapipe")


def typed_names() -> dict[str, str]:
    """Return what type checkers see: every imported name with its module."""
    (block,) = [node for node in ast.parse(Path(lipmotion.__file__).read_text()).body if isinstance(node, ast.If)]
    return {
        alias.name: node.module or ""
        for node in block.body
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


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'lipmotion' has no attribute 'animat'"):
        _ = lipmotion.animat


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


def test_the_package_is_typed() -> None:
    assert (Path(lipmotion.__file__).parent / "py.typed").is_file()
