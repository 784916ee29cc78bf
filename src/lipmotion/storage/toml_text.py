"""TOML that is read."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

from lipmotion.errors import InputError
from lipmotion.storage.files import read_text_file
from lipmotion.storage.json_text import finite

DEEP_KEY = re.compile(r"(?:\.[ \t]*[\w\"'-]+[ \t]*){100}")
"""A name with so many dots; the time to read it grows with the square of their number."""


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
    if DEEP_KEY.search(text):
        raise InputError(f"{path}: a name of more than 100 parts, required one of a table in a table at most")
    try:
        found = tomllib.loads(text, parse_float=finite)
        _check_wholes(found)
        return found
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: {error}") from error


def _check_wholes(content: Any) -> None:
    """Raise ValueError for a whole number beyond 64 bits, which TOML has none of."""
    for name, each in content.items() if isinstance(content, dict) else enumerate(content, 1):
        if isinstance(each, dict | list):
            _check_wholes(each)
        elif type(each) is int and not -(1 << 63) <= each < 1 << 63:
            raise ValueError(f"{name} is a whole number of {each.bit_length()} bits, required at most 63")
