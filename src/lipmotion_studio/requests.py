"""Requests of the page: who may ask, and the values of addresses and bodies, checked."""

from __future__ import annotations

import hmac
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from hashlib import sha256
from typing import Any
from urllib.parse import parse_qs

from starlette.requests import Request

from lipmotion.errors import InputError
from lipmotion.types import values
from lipmotion.types.values import Schema, any_members, items, number_or_text, parse_number, parse_whole, require
from lipmotion_studio.web.replies import read_json, refuse_foreign

TOKEN_HEADER = "x-lipmotion-token"  # noqa: S105 # its name
API = "/api"
KEY_DIGITS = 32


@dataclass(frozen=True)
class Access:
    """What a request must bring: the token of this run, and a host (name with port, lower case) of this server."""

    token: str
    hosts: frozenset[str]

    def make_key(self, path: str) -> str:
        """Return the key that allows to load one address: for elements of a page, which bring no headers."""
        return hmac.new(self.token.encode(), path.encode(), sha256).hexdigest()[:KEY_DIGITS]

    def with_key(self, path: str) -> str:
        """Return an address with its key."""
        return f"{path}?key={self.make_key(path)}"

    def find_refusal(self, method: str, path: str, query: bytes, headers: dict[str, str]) -> tuple[int, str] | None:
        """Return why a request is refused, with a status; None: it is not."""
        foreign = refuse_foreign(path, headers, self.hosts.__contains__)
        if foreign or (path != API and not path.startswith(f"{API}/")):
            return foreign
        if hmac.compare_digest(headers.get(TOKEN_HEADER, "").encode(), self.token.encode()):
            return None
        given = parse_qs(query.decode("latin-1")).get("key", [""])[0] if method in ("GET", "HEAD") else ""
        if hmac.compare_digest(given.encode(), self.make_key(path).encode()):
            return None
        return 401, "the token is missing, or that of an earlier run; open the address that lipmotion studio printed"


MAX_JSON_BYTES = 1 << 20
LATEST_S = 1e6


async def read_content(request: Request) -> dict[str, Any]:
    """Return the object of JSON that a request brings. Raises HTTPException, InputError: it brings something else."""
    content = await read_json(request, MAX_JSON_BYTES)
    if not isinstance(content, dict):
        raise InputError("required an object of JSON")
    return content


def take(given: Mapping[str, Any], name: str, usual: Any, schema: Schema) -> Any:
    """Return a member of a request, checked. Raises InputError: there is none, and no usual value; or another one."""
    return require(schema, given.get(name, usual), name)


def take_int(
    given: Mapping[str, Any], name: str, usual: int | None = None, *, least: int = 0, most: int = 1 << 31
) -> int:
    """Return a whole number of a request, also from its text in an address. Raises as ``take``."""
    return int(
        take(given, name, usual, number_or_text(partial(parse_whole, what=f"{name} is"), values.whole(least, most)))
    )


def take_time(given: Mapping[str, Any], name: str, usual: float | None = None) -> float:
    """Return a time of a request in seconds, also from its text in an address. Raises as ``take``."""
    return float(
        take(given, name, usual, number_or_text(partial(parse_number, what=f"{name} is"), values.number(0, LATEST_S)))
    )


def take_stretch(given: Mapping[str, Any], rate_hz: float, frames: int) -> slice:
    """Return the frames from ``start_s`` to ``end_s`` of a request, or all. Raises InputError: no such times."""
    last_s = (frames - 1) / rate_hz
    start_s, end_s = take_time(given, "start_s", 0.0), min(take_time(given, "end_s", last_s), last_s)
    first, last = math.ceil(start_s * rate_hz - 1e-6), math.floor(end_s * rate_hz + 1e-6)
    if first > last:
        raise InputError(f"{start_s} to {end_s} s holds no frame, required a part of 0 to {last_s:.2f} s")
    return slice(first, last + 1)


def take_text(given: Mapping[str, Any], name: str, usual: str | None = None, *, longest: int = 200) -> str:
    """Return a text of a request. Raises as ``take``."""
    return str(take(given, name, usual, values.text(longest)))


def take_texts(given: Mapping[str, Any], name: str, *, most: int, longest: int = 2000) -> tuple[str, ...]:
    """Return a list of texts of a request. Raises as ``take``."""
    return tuple(take(given, name, None, items(values.text(longest), most=most)))


def take_objects(given: Mapping[str, Any], name: str, *, most: int = 2) -> list[dict[str, Any]]:
    """Return a list of objects of a request. Raises as ``take``."""
    return list(take(given, name, None, items(any_members(lambda value: value), most=most)))
