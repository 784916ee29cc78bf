"""What requests ask for: values of addresses and bodies, checked."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from starlette.requests import Request

from lipmotion.errors import InputError, shortened
from lipmotion.web.bodies import json_of

LARGEST_JSON_BYTES = 1 << 20


async def content_of(request: Request) -> dict[str, Any]:
    """Return the object of JSON that a request brings. Raises HTTPException, InputError: it brings something else."""
    content = await json_of(request, LARGEST_JSON_BYTES)
    if not isinstance(content, dict):
        raise InputError("required an object of JSON")
    return content


def whole(given: Mapping[str, Any], name: str, usual: int | None = None, *, least: int = 0, most: int = 1 << 31) -> int:
    """Return a whole number of a request. Raises InputError: there is none, and no usual value; or out of range."""
    value = given.get(name, usual)
    if isinstance(value, str) and value.isascii() and value.isdecimal() and len(value) < 12:
        value = int(value)
    if type(value) is not int or not least <= value <= most:
        raise InputError(f"{name} is {shortened(repr(value))}, required a whole number from {least} to {most}")
    return value


def seconds(given: Mapping[str, Any], name: str, usual: float | None = None) -> float:
    """Return a time of a request in seconds. Raises InputError: there is none, and no usual value; or no time."""
    value = given.get(name, usual)
    try:
        time_s = math.nan if isinstance(value, bool) or value is None else float(value)
    except (TypeError, ValueError):
        time_s = math.nan
    if not 0 <= time_s <= 1e6:
        raise InputError(f"{name} is {shortened(repr(value))}, required seconds from 0, as 1.24")
    return time_s


def stretch(given: Mapping[str, Any], rate_hz: float, frames: int) -> slice:
    """Return the frames from ``start_s`` to ``end_s`` of a request; all, where neither is there.

    Raises InputError: no times, or none of the recording's.
    """
    last_s = (frames - 1) / rate_hz
    start_s, end_s = seconds(given, "start_s", 0.0), min(seconds(given, "end_s", last_s), last_s)
    first, last = math.ceil(start_s * rate_hz - 1e-6), math.floor(end_s * rate_hz + 1e-6)
    if first > last:
        raise InputError(f"{start_s} to {end_s} s holds no frame, required a part of 0 to {last_s:.2f} s")
    return slice(first, last + 1)


def text(given: Mapping[str, Any], name: str, usual: str | None = None, *, longest: int = 200) -> str:
    """Return a text of a request. Raises InputError: there is none, and no usual value; or it is too long."""
    value = given.get(name, usual)
    if not isinstance(value, str) or len(value) > longest:
        raise InputError(f"{name} is {shortened(repr(value))}, required a text of at most {longest} characters")
    return value


def texts(given: Mapping[str, Any], name: str, *, most: int, longest: int = 2000) -> tuple[str, ...]:
    """Return a list of texts of a request. Raises InputError: there is none, or it is too long."""
    value = given.get(name)
    if not isinstance(value, list) or len(value) > most or not all(isinstance(each, str) for each in value):
        raise InputError(f"{name} is {shortened(repr(value))}, required a list of at most {most} texts")
    if any(len(each) > longest for each in value):
        raise InputError(f"a text of {name} has more than {longest} characters")
    return tuple(value)


def objects(given: Mapping[str, Any], name: str, *, most: int = 2) -> list[dict[str, Any]]:
    """Return a list of objects of a request. Raises InputError: there is none, or it is too long."""
    value = given.get(name)
    if not isinstance(value, list) or len(value) > most or not all(isinstance(each, dict) for each in value):
        raise InputError(f"{name} is {shortened(repr(value))}, required a list of at most {most} objects")
    return value
