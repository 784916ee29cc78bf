"""What hostile requests get of a studio that is served."""

from pathlib import Path

from studio.hostile import FOREIGN, hostile_requests
from studio.served import Served
from study.served import raw_reply, send_junk


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
        try:
            answered = raw_reply(server.port, hostile)
        except ValueError:  # nothing that can be sent
            continue
        if answered is None:
            continue
        reply, body = answered
        statuses.add(reply.status)
        assert reply.status in (501, 503) or reply.status < 500, hostile
        assert FOREIGN.encode() not in body, hostile
        assert b"root:" not in body, hostile
        assert b'"format": "lipmotion' not in body, hostile
    send_junk(server.port)
    assert {path for path in folder.rglob("*") if path.name.startswith("foreign")} == before
    return statuses
