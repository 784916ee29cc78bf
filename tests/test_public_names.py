from __future__ import annotations

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
        alias.name: node.module or "" for node in block.body if isinstance(node, ast.ImportFrom) for alias in node.names
    }


@pytest.mark.parametrize("name", lipmotion.__all__)
def test_a_public_name_is_the_one_that_type_checkers_see(name: str) -> None:
    assert getattr(lipmotion, name) is getattr(importlib.import_module(typed_names()[name]), name)


def test_all_names_are_listed_and_sorted() -> None:
    assert lipmotion.__all__ == sorted(typed_names())
    assert dir(lipmotion) == lipmotion.__all__


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'lipmotion' has no attribute 'animat'"):
        _ = lipmotion.animat


@pytest.mark.parametrize(
    "code",
    [
        "import lipmotion; dir(lipmotion)",
        "import lipmotion.errors",
        "import lipmotion.cli.main",
        "from lipmotion.cli.main import main; main(['--version'])",
        "from lipmotion.cli.main import main; main(['--help'])",
        "from lipmotion.cli.main import main; main(['animate', '--help'])",
    ],
)
def test_heavy_packages_are_imported_when_they_are_needed(code: str) -> None:
    program = (
        "import sys\n"
        f"try:\n    exec({code!r})\nexcept SystemExit:\n    pass\n"
        f"print([name for name in {HEAVY!r} if name in sys.modules], file=sys.stderr)"
    )
    done = run_child([sys.executable, "-c", program], check=True)
    assert done.stderr.strip() == "[]"


def test_the_package_is_typed() -> None:
    assert (Path(lipmotion.__file__).parent / "py.typed").is_file()
