"""JSON as every program reads it: finite numbers only, each key once."""

from __future__ import annotations

import json
import math
import re
from typing import Any, NoReturn

from lipmotion.errors import ExportError

HALF_CHARACTER = re.compile("[\ud800-\udfff]")


def as_json(content: Any, **how: Any) -> str:
    """Return content as JSON that is UTF-8. ``how``: as ``json.dumps`` takes it; half a character is escaped anyway.

    Raises ExportError: a number that is not finite; JSON has none (``nan_as_null`` takes them out of reports).
    """
    try:
        text = json.dumps(content, allow_nan=False, **how)
        if HALF_CHARACTER.search(text):  # JSON that was read may hold one, escaped; UTF-8 has none
            text = json.dumps(content, allow_nan=False, **how | {"ensure_ascii": True})
        return text
    except ValueError as error:
        raise ExportError(f"cannot be written as JSON ({error}): every number must be finite") from error


def nan_as_null(content: Any) -> Any:
    """Return content with null for every number that is not finite: a figure that nothing defines."""
    if isinstance(content, dict):
        return {key: nan_as_null(value) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return type(content)(map(nan_as_null, content))
    return None if isinstance(content, float) and not math.isfinite(content) else content


def from_json(text: str | bytes) -> Any:
    """Return what JSON holds. Raises ValueError: not JSON, a key twice, or a number that is not finite."""
    return json.loads(text, object_pairs_hook=_once, parse_constant=_refused, parse_float=_finite)


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [key for key, _ in pairs]
        raise ValueError(f"the key {next(key for key in names if names.count(key) > 1)!r} stands there twice")
    return found


def _refused(constant: str) -> NoReturn:
    raise ValueError(f"the number {constant}, required a finite one")


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        _refused(text[:20])
    return number
