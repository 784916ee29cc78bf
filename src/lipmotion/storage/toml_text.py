"""TOML files of options."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

from lipmotion.errors import InputError, MissingDependencyError, shortened
from lipmotion.storage.files import read_text_file

LARGEST = 1 << 20
"""Most bytes of a file."""


def read_toml(path: Path, what: str) -> dict[str, Any]:
    """Return the content of a TOML file.

    what : noun for it in messages
    Raises InputError: no such file, too large, or no TOML. Raises MissingDependencyError: Python 3.10 without tomli.
    """
    text = read_text_file(path, what, LARGEST)
    reader = _reader()
    try:
        content: dict[str, Any] = reader.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: is no TOML: {shortened(str(error))}; required lines as: name = value") from error
    return content


def _reader() -> Any:
    for name in ("tomllib", "tomli"):
        try:
            return import_module(name)
        except ImportError:
            continue
    raise MissingDependencyError(
        "job files need Python 3.11 or newer, or the package tomli: pip install tomli; or give options instead"
    )
