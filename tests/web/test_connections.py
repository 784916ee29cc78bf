import asyncio
import socket
import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from threading import Thread
from types import SimpleNamespace
from typing import Any

import pytest

from lipmotion.errors import ExportError, InputError

uvicorn = pytest.importorskip("uvicorn", reason="the extra 'studio' is not installed")

from starlette.applications import Starlette  # noqa: E402
from starlette.requests import Request  # noqa: E402
from starlette.responses import Response  # noqa: E402
from starlette.routing import Route  # noqa: E402

from lipmotion_studio.web import connections  # noqa: E402
from lipmotion_studio.web.listening import open_socket  # noqa: E402
from lipmotion_studio.web.replies import ERRORS  # noqa: E402

LARGE, SMALL = 1 << 24, b"small"
PATIENCE_S = 60.0
ASKED = b"GET /small HTTP/1.1\r\nhost: x\r\n"


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    """Serve a page in a thread, with limits that tests need not wait for; give the port."""

    async def replied(request: Request) -> Response:
        return Response(bytes(LARGE) if request.url.path == "/large" else SMALL)

    application = Starlette(routes=[Route("/{name}", replied)])
    with pytest.MonkeyPatch.context() as patch, open_socket("127.0.0.1", 0) as place:
        limits = {"HEADERS_S": 0.2, "STALLED_S": 0.2, "FIRST_READ_S": 0.01, "MAX_OF_ONE": 5, "MAX_CONNECTIONS": 8}
        for name, value in limits.items():
            patch.setattr(connections, name, value)
        config = uvicorn.Config(application, lifespan="off", log_level="error", http=connections.PunctualConnection)
        server = uvicorn.Server(config)
        thread = Thread(target=server.run, args=([place],), daemon=True)
        thread.start()
        while not server.started:
            time.sleep(0.01)
        yield place.getsockname()[1]
        server.should_exit = True
        thread.join(PATIENCE_S)


def connected(port: int) -> socket.socket:
    return socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S)


def reply_to(client: socket.socket) -> bytes:
    """Return the reply to a request for the small page."""
    client.sendall(ASKED + b"\r\n")
    reply = b""
    while not reply.endswith(SMALL):
        part = client.recv(1 << 16)
        assert part, "closed"
        reply += part
    return reply


def is_closed(client: socket.socket) -> bool:
    """Return whether the server closes a connection, after whatever it has sent."""
    try:
        while client.recv(1 << 20):
            pass
    except ConnectionResetError:
        pass
    except TimeoutError:
        return False
    return True


SENT = {
    "nothing": b"", "a letter": b"G", "no end": ASKED, "half a header": ASKED + b"x: ",
    "half a second request": ASKED + b"\r\n" + ASKED, "no body": ASKED + b"content-length: 9\r\n\r\n",
}  # fmt: skip


@pytest.mark.parametrize("sent", SENT.values(), ids=SENT)
def test_who_does_not_end_a_request_is_closed(port, sent):
    with connected(port) as client:
        client.sendall(sent)
        if sent.endswith(b"9\r\n\r\n"):
            assert client.recv(1 << 20)
            client.sendall(b"x")
        assert is_closed(client)


def test_a_request_that_comes_drop_by_drop_is_closed(port):
    """Each drop does not begin the time anew."""
    with connected(port) as client:

        def send_drops() -> None:
            for _ in range(300):
                client.sendall(b"x")
                time.sleep(0.02)

        client.sendall(ASKED)
        with pytest.raises((ConnectionResetError, BrokenPipeError)):
            send_drops()


def test_many_connections_without_a_request_leave_room(port):
    """The client that asks is served, over one connection and over new ones; the oldest without a request go."""
    with ExitStack() as stack, connected(port) as client:
        for _ in range(12):
            stack.enter_context(connected(port))
            with connected(port) as other:
                assert all(reply_to(each).startswith(b"HTTP/1.1 200") for each in (client, other))


class Clock:
    """A loop whose time the test moves on."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self.timers: list[SimpleNamespace] = []

    def time(self) -> float:
        return self.now_s

    def call_later(self, delay_s: float, call: Callable[[], object]) -> SimpleNamespace:
        timer = SimpleNamespace(at_s=self.now_s + delay_s, call=call)
        timer.cancel = lambda: self.timers.remove(timer) if timer in self.timers else None
        self.timers.append(timer)
        return timer

    def wait(self, seconds: float) -> None:
        self.now_s += seconds
        for timer in [each for each in self.timers if each.at_s <= self.now_s]:
            timer.cancel()
            timer.call()


@pytest.mark.parametrize(("bytes_s", "is_served"), [(0, False), (3000, False), (50_000, True), (5_000_000, True)])
def test_who_takes_a_reply_drop_by_drop_is_closed(bytes_s, is_served, monkeypatch):
    """A part of 64 KB is written whenever the one before is nearly taken, each sooner than what stands still may be."""
    monkeypatch.setattr(connections, "STALLED_S", 30.0)
    clock: Any = Clock()
    ended: list[float] = []
    transport = SimpleNamespace(left=0, abort=lambda: ended.append(clock.now_s), get_extra_info=lambda *_: None)
    transport.get_write_buffer_size = lambda: transport.left
    config = uvicorn.Config(lambda *_: None, log_level="error")
    config.load()
    client = connections.PunctualConnection(config, uvicorn.server.ServerState(), {}, clock)
    client.connection_made(transport)
    client._stop_waiting()  # the time of headers is another limit
    is_paused = False
    while clock.now_s < 600 and not ended:
        if not is_paused:
            transport.left += 1 << 16
            client.pause_writing()
        clock.wait(0.5)
        transport.left = max(transport.left - bytes_s // 2, 0)
        is_paused = transport.left > 1 << 14
        if not is_paused:
            client.resume_writing()
    assert bool(ended) != is_served


@pytest.mark.parametrize("kind", [ExportError, OSError, MemoryError, sqlite3.OperationalError, InputError])
def test_a_full_disk_or_memory_is_a_refusal_that_says_nothing_of_the_machine(kind):
    handler = next(ERRORS[each] for each in kind.__mro__ if each in ERRORS)
    reply = asyncio.run(handler(None, kind("/home/ann: no space left")))  # type: ignore[arg-type]
    assert reply.status_code == (422 if kind is InputError else 503)
    assert (b"/home" in reply.body) == (kind is InputError)
