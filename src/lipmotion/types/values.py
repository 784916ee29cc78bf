"""Checks of values from outside: numbers, texts and documents of files, options and requests.

A schema is a function that returns a value as the code may use it, or raises ``SchemaError``. Tables of schemas
state which members of a JSON or TOML document are used, with their types and ranges.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from difflib import get_close_matches
from typing import Any

from lipmotion.errors import InputError, shorten

Schema = Callable[[Any], Any]
NAME_BYTES, PATH_BYTES = 255, 4096  # maximum bytes of a name in a path, and of a path, on usual file systems
_LEFT_OUT = object()
_HALVES = re.compile("[\ud800-\udc7f\udd00-\udfff]")
"""Halves of characters, without \\udc80 to \\udcff: Python has those for bytes of file names that are not UTF-8."""
_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?|(?i:nan|[-+]?inf)")
_CLOCK = r"(?:([0-9]{1,6}):)?([0-9]{1,2}):([0-9]{1,2}(?:[.,][0-9]{1,9})?)"
_WHOLE = re.compile("[-+]?[0-9]{1,18}")


def suggest(name: str, names: Iterable[str], form: str = " (is it {}?)", count: int = 1) -> str:
    """Return up to ``count`` names that are like one that is none of them, in the form of a message; empty: none is."""
    lower = {each.lower(): each for each in reversed([*names])}
    near = [lower[each] for each in get_close_matches(name.lower(), lower, count)]
    return form.format(", ".join(near)) if near else ""


class SchemaError(InputError):
    """A value has another type or range; names its place, and what is required there."""

    def __init__(self, found: str, required: str, place: str = "") -> None:
        super().__init__(f"{shorten(place.removeprefix('.')) or 'the document'} is {found}, required {required}")
        self.found, self.required, self.place = found, required, place

    def within(self, step: str) -> SchemaError:
        """Return the error with one step more before its place: ``.name`` of a member, ``[3]`` of an item."""
        return SchemaError(self.found, self.required, step + self.place)


def require(schema: Schema, value: Any, what: str) -> Any:
    """Return a value as its schema does; ``what`` names it in the message. Raises InputError: it does not fit."""
    try:
        return schema(value)
    except SchemaError as error:
        raise InputError(f"{what}{error.place} is {error.found}, required {error.required}") from error


def check_class(value: object, kind: Any, name: str, required: str) -> None:
    """Raise InputError unless an argument has a class; ``required``: how one is made."""
    if not isinstance(value, kind):
        found = describe_value(value) if isinstance(value, str) else f"a {type(value).__name__}"
        raise InputError(f"the {name}: found {found}, required {required}")


def parse_number(
    text: str, what: str = "the number is", required: str = "a number, as 1.24", *, finite: bool = True
) -> float:
    """Return the number that a text states in the digits 0 to 9, with a point.

    finite : whether ``nan`` and ``inf`` are refused; False where the caller checks a range
    Raises InputError: another text, as ``1_0`` or digits of other scripts.
    """
    value = float(text) if _NUMBER.fullmatch(text.strip()) else None
    if value is None or (finite and not math.isfinite(value)):
        raise InputError(f"{what} {describe_value(text)}, required {required}")
    return value


def parse_clock(text: str, frames_per_s: float = 0) -> float:
    """Return the seconds of a time as 1:02:03.5, 2:03,5 or, if frames have a rate, 00:02:03:12; NaN: another text."""
    match = re.fullmatch(rf"{_CLOCK}(?:[:;](\d+(?:\.\d+)?))?", text.strip())
    if match is None or (match[4] and not frames_per_s):
        return math.nan
    seconds = float(match[3].replace(",", ".")) + float(match[4] or 0) / (frames_per_s or 1)
    return int(match[1] or 0) * 3600 + int(match[2]) * 60 + seconds


def parse_whole(text: str, what: str = "the number is", required: str = "a whole number") -> int:
    """Return the whole number that a text states in the digits 0 to 9, 18 at most. Raises InputError: another text."""
    if not _WHOLE.fullmatch(text.strip()):
        raise InputError(f"{what} {describe_value(text)}, required {required}")
    return int(text)


def is_path(text: str) -> bool:
    """Return whether a text can be the path of a file: without NUL and halves, it and its names not too long."""
    names = [] if "\0" in text or _HALVES.search(text) else re.split(r"[/\\]", text)
    sizes = [len(name if os.name == "nt" else os.fsencode(name)) for name in names]
    return bool(sizes) and max(sizes) <= NAME_BYTES and sum(sizes) + len(sizes) <= PATH_BYTES


def _fitting(fits: Callable[[Any], bool], required: str) -> Schema:
    """Return the schema of a value that is returned unchanged if ``fits`` holds."""

    def checked(value: Any) -> Any:
        if not fits(value):
            raise SchemaError(describe_value(value), required)
        return value

    return checked


def whole(least: int, most: int) -> Schema:
    """Return the schema of a whole number in a range, limits included."""
    required = f"a whole number from {least} to {most}"
    return _fitting(lambda value: type(value) is int and least <= value <= most, required)


def number(least: float = -math.inf, most: float = math.inf) -> Schema:
    """Return the schema of a finite number in a range, limits included; whole numbers become fractions."""
    required = f"a number from {least:g} to {most:g}" if least > -math.inf else "a finite number"

    def checked(value: Any) -> float:
        try:
            found = float(value) if type(value) in (int, float) else math.nan
        except OverflowError:
            found = math.inf
        if not (math.isfinite(found) and least <= value <= most):
            raise SchemaError(describe_value(value), required)
        return found

    return checked


truth = _fitting(lambda value: type(value) is bool, "true or false")  # the schema of a truth value


def text(most: int) -> Schema:
    """Return the schema of a text of at most ``most`` characters, none of them half a one."""
    required = f"a text of at most {most} letters"
    return _fitting(lambda value: type(value) is str and len(value) <= most and not _HALVES.search(value), required)


path = _fitting(lambda value: type(value) is str and is_path(value), f"a path, of names of at most {NAME_BYTES} bytes")
"""The schema of the text of a path that a file can have; an empty one is none."""


def optional(schema: Schema) -> Schema:
    """Return the schema of a value that may be None."""
    return lambda value: None if value is None else schema(value)


def one_of(values: Collection[int | str]) -> Schema:
    """Return the schema of a choice among numbers or texts."""
    known = {(type(value), value) for value in values}
    return _fitting(
        lambda value: type(value) in (int, str) and (type(value), value) in known,
        f"one of {', '.join(map(str, values))}",
    )


def items(schema: Schema, least: int = 0, most: int | None = None) -> Schema:
    """Return the schema of a list, all of whose items have one schema, of ``least`` to ``most`` items (None: any)."""
    required = f"a list of {least} items" if least == most else f"a list of {least} to {most} items"

    def checked(value: Any) -> list[Any]:
        if type(value) is not list:
            raise SchemaError(describe_value(value), "a list")
        if len(value) < least or (most is not None and len(value) > most):
            raise SchemaError(f"a list of {len(value)}", required if most is not None else f"at least {least} items")
        return list(_checked(dict(enumerate(value)), lambda _: schema).values())

    return checked


def members(table: Mapping[str, Schema], needed: Collection[str] = (), *, alone: bool = False) -> Schema:
    """Return the schema of an object: its members, which are needed; ``alone``: others are refused, else dropped."""

    def checked(value: Any) -> dict[str, Any]:
        if type(value) is not dict:
            raise SchemaError(describe_value(value), "an object")
        for name in needed:
            if name not in value:
                raise SchemaError("missing", "a value", f".{name}")
        if alone and (others := value.keys() - table.keys()):
            raise SchemaError("a member that is not known", ", ".join(table), f".{shorten(min(others))}")
        names = value.keys() & table.keys() if len(value) > len(table) else [name for name in value if name in table]
        return _checked({name: value[name] for name in names}, table.__getitem__)

    return checked


def value_of(kind: Callable[..., Any], table: Mapping[str, Schema], needed: Collection[str] = ()) -> Schema:
    """Return the schema of an object that becomes an instance of a class: the members are its fields, and no others."""
    schema = members(table, needed, alone=True)
    return lambda value: kind(**schema(value))


def as_tuple(schema: Schema) -> Schema:
    """Return the schema of a list that becomes a tuple."""
    return lambda value: tuple(schema(value))


def any_members(schema: Schema) -> Schema:
    """Return the schema of an object with members of any names, all of one schema."""

    def checked(value: Any) -> dict[str, Any]:
        if type(value) is not dict:
            raise SchemaError(describe_value(value), "an object")
        return _checked(value, lambda _: schema)

    return checked


def if_fits(schema: Schema) -> Schema:
    """Return the schema of an item or a member that is left out where it does not fit: other programs may use it."""

    def checked(value: Any) -> Any:
        try:
            return schema(value)
        except SchemaError:
            return _LEFT_OUT

    return checked


def _checked(content: Mapping[Any, Any], schema_of: Callable[[Any], Schema]) -> dict[Any, Any]:
    """Return the members of an object, or the items of a list by their numbers, as their schemas do."""
    checked = {}
    for key, member in content.items():
        try:
            one = schema_of(key)(member)
        except SchemaError as error:
            raise error.within(f"[{key}]" if type(key) is int else f".{shorten(key)}") from None
        if one is not _LEFT_OUT:
            checked[key] = one
    return checked


def describe_value(value: Any) -> str:
    """Return a value in a few words, for a message: whatever it is, however deep or long."""
    if isinstance(value, Mapping | list | tuple):
        return "an object" if isinstance(value, Mapping) else "a list"
    if value is None or type(value) is bool:
        return {None: "null", True: "true", False: "false"}[value]
    if type(value) is int and value.bit_length() > 10_000:  # which Python refuses to write out
        return "a whole number of thousands of digits"
    return shorten(repr(value[:100] if type(value) is str else value))
