"""Hostile requests, the same every time: wrong paths, methods, bodies, headers and tokens."""

import json
from collections.abc import Iterator
from random import Random
from typing import NamedTuple

FOREIGN = "nobody may read this"
PATHS = (
    "/../study.json", "/videos/../study.json", "/videos/%2e%2e/study.json", "/videos/..%2fstudy.json", "/study.json",
    "/videos/....//study.json", "/videos//etc/passwd", "//etc/passwd", "/videos/%00", "/videos/..\\study.json",
    "/answers.sqlite", "/videos/answers.sqlite", "/videos/foreign.mp4", "/videos/../answers.sqlite", "/page/study.html",
    "/videos/", "/videos", "/api", "/api/", "/api/raters/../answers", "/static/", "/%ff%fe", "/study.py",
    "/videos/" + "a" * 5000, "/api/state?token=1", "/videos/%c0%ae%c0%ae/study.json", "/application.py",
)  # fmt: skip
BODIES = (
    b"", b"{", b"null", b"[]", b"[" * 5000, b'{"agrees": true', b"\xff\xfe\x00", b"1" * 4400, b"x" * 20_000,
    b'{"trial": 1e999}', b'{"trial": NaN}', b'{"trial": 0, "trial": 1}',
    json.dumps({"trial": 0, "values": ["'; DROP TABLE answers; --"], "plays": [1, 1], "seconds": 2}).encode(),
    json.dumps({"trial": 10**300, "values": ["\ud800"], "plays": [[[]]], "seconds": 10**300}).encode(),
)  # fmt: skip
METHODS = ("GET", "POST", "PUT", "DELETE", "HEAD", "OPTIONS", "PATCH", "TRACE", "LOCK")
APIS = ("/api/study", "/api/raters", "/api/state", "/api/answers", "/", "/videos/{video}")
RANGES = ("bytes=0-", "bytes=-1", "bytes=5-1", "bytes=9999999-", "bytes=a-b", "lines=1-2", "bytes=" + "0-1," * 900)
TOKENS = ("", "x", "é", "' OR 1=1 --", "a" * 6000, "{token}", "Basic", "\t{token}")


class Hostile(NamedTuple):
    """One request."""

    method: str
    path: str
    body: bytes
    headers: dict[str, str]


def hostile_requests(count: int, video: str, token: str) -> Iterator[Hostile]:
    """Yield requests that no page sends; ``video`` and ``token`` are valid ones."""
    chance = Random(30)
    for _ in range(count):
        path = chance.choice((*PATHS, *APIS, *APIS, *APIS)).replace("{video}", video)
        kind = chance.choice(("application/json",) * 3 + ("text/plain", "", "application/json; charset=utf-16"))
        headers = {"content-type": kind, "range": chance.choice(RANGES)}
        headers["authorization"] = f"Bearer {chance.choice(TOKENS)}".replace("{token}", token)
        if chance.random() < 0.2:
            headers["if-range"] = chance.choice(("x", '"1"', "Thu, 01 Jan 1970 00:00:00 GMT"))
        yield Hostile(chance.choice(METHODS), path, chance.choice(BODIES), headers)
