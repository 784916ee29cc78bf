"""JSON of other programs: one value, or several one after another, and the times in it."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from typing import Any

from lipmotion.errors import InputError, shortened

BLANK = re.compile(r"\s*")
DECODER = json.JSONDecoder()
LATEST_S = 1e6
"""Times beyond eleven days are an error, or in another unit."""


class DamagedJsonError(InputError):
    """A text that begins as JSON is none."""


def is_json(text: str) -> bool:
    """Return whether a text begins as an object or a list of objects does."""
    return re.match(r'\s*(?:\{\s*["}]|\[\s*[\[{\]])', text) is not None


def json_documents(text: str, where: str) -> Iterator[tuple[int, Any]]:
    """Yield the values of a text, one after another, each with the number of its first line.

    where : the file's name, for messages
    Raises DamagedJsonError: with the line.
    """
    at, line, counted = _next(text, 0), 1, 0
    while at < len(text):
        line, counted = line + text.count("\n", counted, at), at
        try:
            value, at = DECODER.raw_decode(text, at)
        except json.JSONDecodeError as error:
            raise DamagedJsonError(
                f"{where}: line {error.lineno}: damaged JSON ({error.msg}); write it again"
            ) from error
        except (ValueError, RecursionError) as error:
            raise DamagedJsonError(f"{where}: damaged JSON: nested too deeply, or a number too long") from error
        yield line, value
        at = _next(text, at)


def _next(text: str, at: int) -> int:
    """Return the position of the next character that is not blank."""
    found = BLANK.match(text, at)
    return found.end() if found else at


def json_seconds(value: Any, where: str, per_s: float = 1.0) -> float | None:
    """Return a time in seconds, None for null. Raises InputError: not a finite number, or no time."""
    if value is None:
        return None
    try:
        time_s = float(value) / per_s if not isinstance(value, bool) else math.nan
    except (TypeError, ValueError, OverflowError):
        time_s = math.nan
    if not abs(time_s) <= LATEST_S:
        raise InputError(f"{where}: a time is {shortened(repr(value)[:200])}, required a number of seconds")
    return time_s
