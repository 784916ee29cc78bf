"""Schemas of JSON documents: tables of types and ranges, by which what is used of a document is checked and taken out.

A schema is a function that returns a value as the code may use it, or raises ``SchemaError``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from typing import Any

from lipmotion.errors import shortened

Schema = Callable[[Any], Any]
_LEFT_OUT = object()


class SchemaError(ValueError):
    """A value of a document has another type or range; says where it stands, and what is required there."""

    def __init__(self, found: str, required: str, place: str = "") -> None:
        super().__init__(f"{shortened(place.removeprefix('.')) or 'the document'} is {found}, required {required}")
        self.found, self.required, self.place = found, required, place

    def within(self, step: str) -> SchemaError:
        """Return the error with one step more before its place: ``.name`` of a member, ``[3]`` of an item."""
        return SchemaError(self.found, self.required, step + self.place)


def whole(least: int, most: int) -> Schema:
    """Return the schema of a whole number in a range, limits included."""
    required = f"a whole number from {least} to {most}"

    def checked(value: Any) -> int:
        if type(value) is not int or not least <= value <= most:
            raise SchemaError(_spelled(value), required)
        return value

    return checked


def number(least: float = -math.inf, most: float = math.inf) -> Schema:
    """Return the schema of a finite number in a range, limits included; whole numbers become fractions."""
    required = f"a number from {least:g} to {most:g}"

    def checked(value: Any) -> float:
        if type(value) not in (int, float) or not least <= value <= most:
            raise SchemaError(_spelled(value), required)
        return float(value)

    return checked


def truth(value: Any) -> bool:
    """Return a truth value. Raises SchemaError: another one."""
    if type(value) is not bool:
        raise SchemaError(_spelled(value), "true or false")
    return value


def text(most: int) -> Schema:
    """Return the schema of a text of at most so many letters."""

    def checked(value: Any) -> str:
        if type(value) is not str or len(value) > most:
            raise SchemaError(_spelled(value), f"a text of at most {most} letters")
        return value

    return checked


def one_of(values: Collection[int | str]) -> Schema:
    """Return the schema of a choice among numbers or texts."""
    known = {(type(value), value) for value in values}

    def checked(value: Any) -> int | str:
        if type(value) not in (int, str) or (type(value), value) not in known:
            raise SchemaError(_spelled(value), f"one of {', '.join(map(str, values))}")
        return value

    return checked


def items(schema: Schema, least: int = 0, most: int | None = None) -> Schema:
    """Return the schema of a list, all of whose items have one schema, of ``least`` to ``most`` items (None: any)."""
    required = f"a list of {least} items" if least == most else f"a list of {least} to {most} items"

    def checked(value: Any) -> list[Any]:
        if type(value) is not list:
            raise SchemaError(_spelled(value), "a list")
        if len(value) < least or (most is not None and len(value) > most):
            raise SchemaError(f"a list of {len(value)}", required if most is not None else f"at least {least} items")
        kept = []
        for place, item in enumerate(value):
            try:
                one = schema(item)
            except SchemaError as error:
                raise error.within(f"[{place}]") from None
            if one is not _LEFT_OUT:
                kept.append(one)
        return kept

    return checked


def members(table: Mapping[str, Schema], needed: Collection[str] = ()) -> Schema:
    """Return the schema of an object: a table of its members, and which of them must be there; others are dropped."""

    def checked(value: Any) -> dict[str, Any]:
        if type(value) is not dict:
            raise SchemaError(_spelled(value), "an object")
        for name in needed:
            if name not in value:
                raise SchemaError("missing", "a value", f".{name}")
        names = value.keys() & table.keys() if len(value) > len(table) else [name for name in value if name in table]
        return _checked({name: value[name] for name in names}, table.__getitem__)

    return checked


def any_members(schema: Schema) -> Schema:
    """Return the schema of an object with members of any names, all of one schema."""

    def checked(value: Any) -> dict[str, Any]:
        if type(value) is not dict:
            raise SchemaError(_spelled(value), "an object")
        return _checked(value, lambda _: schema)

    return checked


def if_fits(schema: Schema) -> Schema:
    """Return the schema of an item or a member that is left out where it does not fit, as others read it as well."""

    def checked(value: Any) -> Any:
        try:
            return schema(value)
        except SchemaError:
            return _LEFT_OUT

    return checked


def _checked(content: Mapping[str, Any], schema_of: Callable[[str], Schema]) -> dict[str, Any]:
    kept = {}
    for name, member in content.items():
        try:
            one = schema_of(name)(member)
        except SchemaError as error:
            raise error.within(f".{shortened(name)}") from None
        if one is not _LEFT_OUT:
            kept[name] = one
    return kept


def _spelled(value: Any) -> str:
    """Return a value in a few words, whatever it is and however deep."""
    if type(value) in (dict, list):
        return "an object" if type(value) is dict else "a list"
    if value is None or type(value) is bool:
        return {None: "null", True: "true", False: "false"}[value]
    return shortened(repr(value[:100] if type(value) is str else value))
