"""Hostile requests to a studio, the same every time, and what they get of one that is served."""

import json
from collections.abc import Iterator
from pathlib import Path
from random import Random

from lipmotion_studio.application import TOKEN_HEADER
from studio.served import Served
from study.hostile import FOREIGN, METHODS, RANGES, Hostile
from study.served import attacked

LINES = ("1", "2", "0", "-1", "01", "1.0", "9" * 500, "../1", "%2e%2e", "1/../../foreign", "é", "1%00", "true")
LINE_PARTS = (
    " /edits /undo /redo /settle /transcript /mark /export /video /sound.wav /recorded /versions /versions/back "
    "/versions/forget /motion /weights /picture /why /doubts /../../project.json /edits/../../../foreign.txt /remove/x"
).split(" ")
PATHS = (
    *(
        "/ /../project.json /project.json /studio.html /vendor/../../project.json //etc/passwd "
        "/%2e%2e/%2e%2e/etc/passwd /page/studio.html /edits/line.edits.json /sounds/line.wav /lexicon.txt "
        "/foreign.txt /api /api/ /api/project /api/progress /api/lexicon /api/export /api/understand "
        "/api/training /api/training/again /api/training/../../foreign.txt /api/voice "
        "/voices/../../foreign.txt /api/faces/../../foreign.txt.glb /api/faces/head.glb/.. "
        "/api/faces/%2e%2e%2fforeign.glb /api/faces/portrait.glb /api/lines?name=../../foreign.txt "
        "/api/lines?name=%00.wav /static /%ff%fe /api/lines/1/sound.wav?key=0 /application.py"
    ).split(),
    "/api/lines?name=" + "a" * 600 + ".wav", "/" + "a/" * 500,
)  # fmt: skip
QUERIES = (
    "", "?time=nan", "?time=-1", "?time=1e999", "?time=0.5&face=../../foreign", "?face=/etc/passwd", "?names=",
    "?names=opening,../../foreign", "?names=" + "opening," * 3000, "?start_s=2&end_s=1", "?of=__class__", "?by=other",
    "?by=../../foreign", "?from=-1", "?count=99999999", "?word=" + "a" * 90, "?word=%00", "?word=a%20b",
    "?order=;drop", "?key=", "?key=é", "?" + "a=1&" * 900, "?time=" + "1" * 5000, "?end_s=0.5&start_s=0.4",
)  # fmt: skip
BODIES = (
    b"", b"{", b"null", b"[]", b"[" * 5000, b"\xff\xfe\x00", b'{"revision": NaN}', b"x" * 20_000, b"1" * 4400,
    *(json.dumps(each).encode() for each in (
        {"revision": 0, "steps": ["phone 999999999999999999999 is p"]}, {"revision": 10**400, "count": 10**400},
        {"revision": 0, "steps": ["pin opening 1e308 at 0.5", "set background ../../foreign.txt"]},
        {"revision": 0, "steps": ["say " + "a " * 900 + "from 0 to 1"]}, {"mark": "../../foreign"},
        {"text": "\ud800", "revision": 0, "start_s": 0, "end_s": 1}, {"start_s": 0, "end_s": 1, "face": "/etc/passwd"},
        {"files": ["/../../foreign.txt", ".csv"]}, {"files": [".csv/../../../foreign"]}, {"preset": "../x"},
        {"kind": "voice", "name": "../../foreign", "lines": ["../../foreign.wav"], "options": {"path": "/etc"}},
        {"kind": "face", "name": "/etc/passwd", "options": {"engine": "../../foreign"}}, {"lines": [99]},
        {"voice": "../../foreign.txt"}, {"word": "\n# a\nb", "phones": ["../x"]},
    )),
)  # fmt: skip
"""Few: the fuzzer mutates the body of every request."""
TOKENS = ("{token}",) * 6 + ("", "x", "é", "' OR 1=1 --", "a" * 6000, "\t{token}")
HOSTS = ("{host}",) * 8 + ("example.org", "127.0.0.1", "", "{host}.example.org")


def hostile_requests(count: int, host: str, token: str) -> Iterator[Hostile]:
    """Yield requests that no page sends; ``host`` and ``token`` are valid ones."""
    chance = Random(31)
    for _ in range(count):
        path = chance.choice(PATHS)
        if chance.random() < 0.7:
            path = f"/api/lines/{chance.choice(('1', '1', '1', *LINES))}{chance.choice(LINE_PARTS)}"
        if "?" not in path:
            path += chance.choice(QUERIES)
        kind = chance.choice(("application/json",) * 4 + ("text/plain", "", "application/json; charset=utf-16"))
        headers = {"content-type": kind, "range": chance.choice(RANGES)}
        headers["host"] = chance.choice(HOSTS).replace("{host}", host)
        headers[TOKEN_HEADER] = chance.choice(TOKENS).replace("{token}", token)
        if chance.random() < 0.15:
            headers["origin"] = chance.choice(("http://example.org", "null", f"http://{host}", "é"))
        if chance.random() < 0.1:
            headers["x-lipmotion-transcript"] = chance.choice(("%ff%fe", "a" * 5000, "%00", "../../foreign.txt"))
        yield Hostile(chance.choice(("GET", "POST", *METHODS)), path, chance.choice(BODIES), headers)


def attack(server: Served, folder: Path, count: int) -> set[int]:
    """Send hostile requests to a server, and return the statuses of its replies.

    folder : where files lie that no reply may hold: beside the recording, and its project
    Raises AssertionError: a reply holds what it may not, or is that of a bug.
    """
    names = ("foreign.txt", "foreign.wav", *(f"{each.name}/foreign.txt" for each in folder.glob("*.studio")))
    for name in names:
        (folder / name).write_text(FOREIGN, encoding="utf-8")
    before = {path for path in folder.rglob("*") if path.name.startswith("foreign")}
    requests = hostile_requests(count, f"127.0.0.1:{server.port}", server.token)
    replies = attacked(server.port, requests, (FOREIGN.encode(), b'"format": "lipmotion'))
    statuses = {reply.status for reply, _ in replies}
    assert not {status for status in statuses if status >= 500} - {501, 503}
    assert {path for path in folder.rglob("*") if path.name.startswith("foreign")} == before
    return statuses
