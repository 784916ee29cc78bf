"""JSON that every program reads: finite numbers only, and each key once; and TOML that is read."""

from __future__ import annotations

import json
import math
import re
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, NoReturn

from lipmotion.errors import ExportError, InputError
from lipmotion.storage.sources import read_text_file

LONGEST_WHOLE = 300  # most digits of a whole number: one of 309 may be larger than any fraction
SURROGATE = re.compile("[\ud800-\udfff]")
DEEP_KEY = re.compile(r"(?:\.[ \t]*[\w\"'-]+[ \t]*){100}")
"""A name with so many dots; the time to read it grows with the square of their number."""


def as_json(content: Any, **options: Any) -> str:
    """Return content as JSON text that can be encoded as UTF-8.

    options : of ``json.dumps``; surrogates, which UTF-8 cannot encode, are escaped in any case
    Raises ExportError: a number that is not finite; JSON has none (``replace_nan`` removes them from reports); or it is
    nested too deeply.
    """
    try:
        text = _encoder(**options)(content)
        if SURROGATE.search(text):  # JSON that was read may contain one, escaped
            text = _encoder(**options | {"ensure_ascii": True})(content)
        return text
    except ValueError as error:
        raise ExportError(f"cannot be written as JSON ({error}): every number must be finite") from error
    except RecursionError as error:
        raise ExportError("cannot be written as JSON: lists and objects are nested too deeply") from error


@cache
def _encoder(**options: Any) -> Callable[[Any], str]:
    return json.JSONEncoder(allow_nan=False, **options).encode


def as_json_rows(content: Mapping[str, Any], *, ensure_ascii: bool = True) -> str:
    """Return an object as JSON text of several lines: a line for each member, and for each member of a list.

    It is what people read and compare line by line, and is made faster than text with an indent.
    Raises ExportError: as ``as_json``.
    """
    members = []
    for name, value in content.items():
        rows = _rows(value, ensure_ascii=ensure_ascii) if isinstance(value, list | tuple) and value else ""
        members.append(
            f"{as_json(name)}: " + (f"[\n  {rows}\n ]" if rows else as_json(value, ensure_ascii=ensure_ascii))
        )
    return "{\n " + ",\n ".join(members) + "\n}\n"


def _rows(rows: Sequence[Any], *, ensure_ascii: bool) -> str:
    """Return the members of a list, a line each; of long lists of lists or of objects at once, which is faster."""
    for kinds, between in (((list, tuple), "], ["), (dict, "}, {")):
        if all(isinstance(row, kinds) for row in rows):
            text = as_json(rows, ensure_ascii=ensure_ascii)[1:-1]
            if text.count(between) == len(rows) - 1:  # it stands nowhere within a row
                return text.replace(between, between.replace(" ", "\n  "))
    return ",\n  ".join(as_json(row, ensure_ascii=ensure_ascii) for row in rows)


def replace_nan(content: Any) -> Any:
    """Return content with None (null in JSON) for every number that is not finite: such figures are undefined."""
    if isinstance(content, dict):
        return {key: replace_nan(value) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return type(content)(map(replace_nan, content))
    return None if isinstance(content, float) and not math.isfinite(content) else content


def from_json(text: str | bytes) -> Any:
    """Return the content of JSON text. Raises ValueError: it is none, a key is twice, or a number is not finite."""
    try:
        numbers: Any = {"parse_constant": _refuse, "parse_float": finite, "parse_int": _whole}
        return json.loads(text, object_pairs_hook=_check_keys, **numbers)
    except RecursionError as error:
        raise ValueError("nested too deeply") from error


@contextmanager
def catch_errors(what: str) -> Iterator[None]:
    """Turn the errors of reading JSON that are raised inside into an InputError; ``what`` is read."""
    try:
        yield
    except (json.JSONDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise InputError(f"not JSON ({error}); export it again") from error
    except (TypeError, KeyError, ValueError, OverflowError) as error:
        if type(error) is InputError:
            raise
        raise InputError(f"{what} is damaged ({error}); export it again") from error


def _check_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) < len(pairs):
        counts = Counter(key for key, _ in pairs)
        raise ValueError(f"the key {next(key for key, count in counts.items() if count > 1)!r} occurs twice")
    return content


def _refuse(constant: str) -> NoReturn:
    raise ValueError(f"the number {constant}, required a finite one")


def _whole(text: str) -> int:
    if len(text) > LONGEST_WHOLE:
        _refuse(text[:20])
    return int(text)


def finite(text: str) -> float:
    """Return the number of a text of JSON or TOML. Raises ValueError: it is not finite."""
    number = float(text)
    if not math.isfinite(number):
        _refuse(text[:20])
    return number


def read_toml(path: Path, kind: str, instead: str) -> dict[str, Any]:
    """Return the content of a TOML file. Raises InputError: no TOML, or Python 3.10: what to use ``instead``."""
    if sys.version_info < (3, 11):
        raise InputError(f"{path}: TOML is read by Python 3.11 or newer; {instead}")
    import tomllib

    text = read_text_file(path, kind)
    if DEEP_KEY.search(text):
        raise InputError(f"{path}: a name of more than 100 parts, required one of a table in a table at most")
    try:
        content = tomllib.loads(text, parse_float=finite)
        _check_wholes(content)
        return content
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: {error}") from error


def _check_wholes(content: Any) -> None:
    for name, each in content.items() if isinstance(content, dict) else enumerate(content, 1):
        if isinstance(each, dict | list):
            _check_wholes(each)
        elif type(each) is int and not -(1 << 63) <= each < 1 << 63:
            raise ValueError(f"{name} is a whole number of {each.bit_length()} bits, required at most 63")
