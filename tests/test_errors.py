import ast
import inspect
from typing import Any

from lipmotion import errors
from lipmotion.errors import InputError, LipMotionError, MissingDependencyError

CLASSES: list[Any] = [value for _, value in inspect.getmembers(errors, inspect.isclass)]
EXIT_CODES = {
    "InputError": 3,
    "CorpusError": 4,
    "AlignmentError": 5,
    "ModelFormatError": 6,
    "ExportError": 7,
    "MissingDependencyError": 8,
}
"""As ``lipmotion --help`` lists them: scripts depend on these numbers."""


def test_every_error_has_its_exit_code() -> None:
    assert {kind.__name__: kind.exit_code for kind in CLASSES if kind is not LipMotionError} == EXIT_CODES


def test_all_are_caught_as_one_and_some_are_what_python_calls_them() -> None:
    assert all(issubclass(kind, LipMotionError) for kind in CLASSES)
    assert issubclass(InputError, ValueError)
    assert issubclass(MissingDependencyError, ImportError)


def test_the_module_imports_nothing() -> None:
    tree = ast.parse(inspect.getsource(errors))
    imports = [ast.unparse(node) for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    assert imports == ["from __future__ import annotations"]
