"""What hostile requests get of a studio that is served."""

from __future__ import annotations

import http.client
import socket
from pathlib import Path

from studio.hostile import FOREIGN, hostile_requests
from studio.served import PATIENCE_S, Served
from study.served import NO_REPLY


def attacked(server: Served, folder: Path, count: int) -> set[int]:
    """Send hostile requests to a server, and return the statuses of its replies.

    folder : where files lie that no reply may hold: beside the recording, and its project
    Raises AssertionError: a reply holds what it may not, or is that of a bug.
    """
    for foreign in (
        folder / "foreign.txt",
        folder / "foreign.wav",
        *(each / "foreign.txt" for each in folder.glob("*.studio")),
    ):
        foreign.write_text(FOREIGN, encoding="utf-8")
    statuses, before = set(), {path for path in folder.rglob("*") if path.name.startswith("foreign")}
    for hostile in hostile_requests(count, f"127.0.0.1:{server.port}", server.token):
        raw = http.client.HTTPConnection("127.0.0.1", server.port, timeout=PATIENCE_S)
        try:
            raw.putrequest(hostile.method, hostile.path, skip_host=True, skip_accept_encoding=True)
            for name, value in {**hostile.headers, "content-length": str(len(hostile.body))}.items():
                raw.putheader(name, value.encode("utf-8"))
            raw.endheaders(hostile.body)
            reply = raw.getresponse()
            body = reply.read()
        except NO_REPLY:
            continue  # the connection was closed: no reply is a safe one
        except (ValueError, UnicodeError):
            continue  # nothing that can be sent
        finally:
            raw.close()
        statuses.add(reply.status)
        assert reply.status in (501, 503) or reply.status < 500, hostile
        assert FOREIGN.encode() not in body, hostile
        assert b"root:" not in body, hostile
        assert b'"format": "lipmotion' not in body, hostile
    for content in (b"\x16\x03\x01" * 200, b"GET / HTTP/9.9\r\n\r\n", b"GET /" + b"a" * 100_000, b"\r\n" * 500):
        with socket.create_connection(("127.0.0.1", server.port), timeout=PATIENCE_S) as plain:
            plain.sendall(content)
    assert {path for path in folder.rglob("*") if path.name.startswith("foreign")} == before
    return statuses
