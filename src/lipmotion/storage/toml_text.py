"""TOML that is read."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from lipmotion.errors import InputError
from lipmotion.storage.files import read_text_file


def read_toml(path: Path, kind: str, instead: str) -> dict[str, Any]:
    """Return the content of a TOML file.

    kind    : what the file is, in messages
    instead : what to use with Python 3.10, which cannot read TOML
    Raises InputError: no such file, no TOML, or Python 3.10.
    """
    if sys.version_info < (3, 11):
        raise InputError(f"{path}: TOML is read by Python 3.11 or newer; {instead}")
    import tomllib

    text = read_text_file(path, kind)
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: {error}") from error
