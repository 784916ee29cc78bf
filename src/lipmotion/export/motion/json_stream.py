"""Reading a JSON object item by item: rows of numbers need no more memory than an array."""

from __future__ import annotations

import json
import re
from array import array
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

MOST_ITEMS = 1 << 20
"""Most items of a list that has not one item a frame."""
MOST_ROWS = 1 << 22
"""Most rows of numbers: eleven hours of frames of 10 ms."""
_BLANK = re.compile(r"[ \t\n\r]*")
_DECODER = json.JSONDecoder()


def read_members(text: str, rows_of: str, numbers_of: str = "") -> dict[str, Any]:
    """Return the members of a JSON object; the list called ``rows_of`` becomes an array of numbers [shape=(T, P)].

    numbers_of : name of a list that may have an item for every row

    Raises json.JSONDecodeError, RecursionError: not one object.
    Raises ValueError, TypeError, OverflowError: a list that is too long, or rows that are uneven or no numbers.
    """
    members_by_name: dict[str, Any] = {}

    def member(at: int) -> int:
        key, at = _DECODER.raw_decode(text, at)
        at = _next(text, _passed(text, _next(text, at), ":"))
        is_list = text[at : at + 1] == "["
        if is_list and key == rows_of:
            members_by_name[key], at = _rows(text, at)
        elif is_list:
            members_by_name[key], at = _items(text, at, MOST_ROWS if key == numbers_of else MOST_ITEMS)
        else:
            members_by_name[key], at = _DECODER.raw_decode(text, at)
        return at

    end = _next(text, _each(text, _next(text, 0), "{}", member))
    if end < len(text):
        raise json.JSONDecodeError("Extra data", text, end)
    return members_by_name


def _items(text: str, at: int, most: int) -> tuple[list[Any], int]:
    """Return the items of a list, and the position of its end."""
    items: list[Any] = []

    def item(at: int) -> int:
        value, at = _DECODER.raw_decode(text, at)
        items.append(value)
        if len(items) > most:
            raise ValueError(f"a list of more than {most} items")
        return at

    return items, _each(text, at, "[]", item)


def _rows(text: str, at: int) -> tuple[NDArray[np.float64], int]:
    """Return the rows of a list of lists of numbers [shape=(T, P)], and the position of its end."""
    numbers = array("d")
    widths = array("q")

    def row(at: int) -> int:
        values, at = _DECODER.raw_decode(text, at)
        if not values or not isinstance(values, list) or len(values) != (widths[0] if widths else len(values)):
            raise ValueError(
                f"row {len(widths) + 1} of the values is not a list of as many numbers as the first: no shape"
            )
        numbers.extend(values)
        widths.append(len(values))
        if len(widths) > MOST_ROWS:
            raise ValueError(f"more than {MOST_ROWS} rows of values")
        return at

    end = _each(text, at, "[]", row)
    table = np.array(numbers, np.float64)
    return table.reshape(len(widths), widths[0] if widths else 0), end


def _each(text: str, at: int, brackets: str, take: Callable[[int], int]) -> int:
    """Let ``take`` read each item between brackets; return the position after the closing bracket."""
    at = _next(text, _passed(text, at, brackets[0]))
    if text[at : at + 1] == brackets[1]:
        return at + 1
    while True:
        at = _next(text, take(at))
        if text[at : at + 1] == brackets[1]:
            return at + 1
        at = _next(text, _passed(text, at, ","))


def _next(text: str, at: int) -> int:
    """Return the position of the next character that is not blank."""
    match = _BLANK.match(text, at)
    return match.end() if match else at


def _passed(text: str, at: int, character: str) -> int:
    """Return the position after a required character. Raises JSONDecodeError: another character is there."""
    if text[at : at + 1] != character:
        raise json.JSONDecodeError(f"Expecting {character!r}", text, at)
    return at + 1
