"""WebSocket servers of live frames, whose clients come and go, and which no slow client holds up."""

from __future__ import annotations

import asyncio
import logging
import re
import socket
from collections import deque
from collections.abc import Callable, Coroutine, Iterator
from contextlib import closing, contextmanager, suppress
from threading import Thread
from typing import TYPE_CHECKING, Any

import numpy as np

from lipmotion.cli.terminal.printing import print_error
from lipmotion.errors import InputError, MissingDependencyError
from lipmotion.extensions import install_command
from lipmotion.live.consumers import Consumer, LiveSound, json_line, read_address
from lipmotion.live.network import mono_samples

if TYPE_CHECKING:
    from websockets.asyncio.server import ServerConnection
    from websockets.http11 import Request, Response

PORT = 8765
QUEUED = 1000  # messages that wait for a slow client; beyond these the oldest are dropped
CLOSE_S, REPLY_S = 1.0, 600.0
"""How long a client may take what was sent, and close, when the stream ends; and how long a reply may take: a busy
machine makes the head in minutes."""
MAX_BYTES = 1 << 12  # the longest message that a client may send
LOCAL = r"https?://(localhost|127\.0\.0\.1|\[::1\])(:\d+)?"
"""Origins of pages that may listen: those of this machine. Any other site could overhear a microphone."""
LOG = logging.getLogger("lipmotion")


@contextmanager
def open_websocket(to: str, sound: LiveSound) -> Iterator[Consumer]:  # noqa: ARG001
    """Give a consumer that sends each client a line of JSON for each frame. Raises as ``open_server``."""
    with open_server(to, PORT) as server:
        print_error(f"frames are at ws://{server.address}/")
        yield lambda frame: server.send(json_line(frame))


class Server:
    """Sends messages to all clients that are there.

    greeting : the first message to each client; empty: none
    reply    : returns what a request that is not for a WebSocket is answered
    joined   : is called when a client has come
    received : is called with what a client says
    The last three are called in the server's own thread.
    """

    def __init__(
        self,
        greeting: str = "",
        reply: Callable[[ServerConnection, Request], Coroutine[Any, Any, Response]] | None = None,
        joined: Callable[[], object] = lambda: None,
        received: Callable[[str | bytes], object] = lambda _: None,
    ) -> None:
        self._greeting, self._reply, self._joined, self._received = greeting, reply, joined, received
        self._clients: dict[asyncio.Event, deque[str | bytes]] = {}
        self._loop: asyncio.AbstractEventLoop | None = None
        self.address = ""

    def send(self, message: str | bytes) -> None:
        """Send a message to all clients, from any thread; it returns at once."""
        if self._loop is not None:
            with suppress(RuntimeError):  # the server has ended
                self._loop.call_soon_threadsafe(self._share, message)

    @contextmanager
    def serve(self, place: socket.socket) -> Iterator[None]:
        """Serve at a socket until the end of the block."""
        host, port = place.getsockname()[:2]
        self.address = f"{f'[{host}]' if ':' in host else host}:{port}"
        with run_in_background(self._run(place)) as self._loop:
            yield

    async def _run(self, place: socket.socket) -> None:
        from websockets.asyncio.server import serve

        origins = [re.compile(f"{LOCAL}|https?://{re.escape(self.address)}"), None]
        quiet = logging.getLogger("lipmotion.websockets")
        quiet.disabled = True  # clients that break off are none of the user's business
        server = await serve(
            self._serve_client,
            sock=place,
            process_request=self._process,
            origins=origins,  # None: what is no browser
            compression=None,
            open_timeout=REPLY_S,
            close_timeout=CLOSE_S,
            max_size=MAX_BYTES,
            server_header=None,
            logger=quiet,
        )
        try:
            await asyncio.Future()
        finally:
            for _ in range(round(CLOSE_S / 0.02)):  # until all clients have taken what was sent
                if not any(self._clients.values()):
                    break
                await asyncio.sleep(0.02)
            server.close()
            await asyncio.wait([asyncio.ensure_future(server.wait_closed())], timeout=CLOSE_S)

    async def _process(self, connection: ServerConnection, request: Request) -> Response | None:
        if self._reply is None or request.headers.get("upgrade", "").lower() == "websocket":
            return None
        return await self._reply(connection, request)

    async def _serve_client(self, connection: ServerConnection) -> None:
        from websockets.exceptions import ConnectionClosed

        waiting = asyncio.Event()
        self._clients[waiting] = deque([self._greeting] if self._greeting else [], QUEUED)
        waiting.set()
        sender = asyncio.ensure_future(self._pass_on(connection, waiting))
        self._joined()
        try:
            async for message in connection:
                self._received(message)
        except ConnectionClosed:
            pass
        finally:
            del self._clients[waiting]
            sender.cancel()

    async def _pass_on(self, connection: ServerConnection, waiting: asyncio.Event) -> None:
        from websockets.exceptions import ConnectionClosed

        messages = self._clients[waiting]
        with suppress(ConnectionClosed):
            while True:
                await waiting.wait()
                waiting.clear()
                while messages:
                    await connection.send(messages.popleft())

    def _share(self, message: str | bytes) -> None:
        for waiting, messages in self._clients.items():
            messages.append(message)
            waiting.set()


@contextmanager
def open_server(to: str, port: int, server: Server | None = None) -> Iterator[Server]:
    """Give a server that listens where ``--to`` says, at ``port`` unless it says another one.

    Raises InputError: no such address, or it is taken. MissingDependencyError: websockets is not installed.
    """
    check_websockets(to)
    server = server or Server()
    host, number = read_address(to, port)
    try:
        place = socket.create_server((host, number), family=socket.AF_INET6 if ":" in host else socket.AF_INET)
    except (OSError, UnicodeError) as error:
        raise InputError(f"--to {to}: {host}:{number} is taken, or not of this machine ({error})") from error
    with closing(place), server.serve(place):
        yield server


@contextmanager
def run_in_background(work: Coroutine[Any, Any, None]) -> Iterator[asyncio.AbstractEventLoop]:
    """Let a coroutine work in a thread of its own, until the end of the block, where it is cancelled."""
    loop = asyncio.new_event_loop()
    task = loop.create_task(work)

    def run() -> None:
        with closing(loop):
            with suppress(asyncio.CancelledError):
                loop.run_until_complete(task)
            others = asyncio.all_tasks(loop)  # of clients that hang
            for other in others:
                other.cancel()
            last = loop.create_task(asyncio.sleep(0))  # in which sockets are closed
            loop.run_until_complete(asyncio.wait({*others, last}))

    thread = Thread(target=run, name="live", daemon=True)
    thread.start()
    try:
        yield loop
    finally:
        with suppress(RuntimeError):  # it has ended by itself
            loop.call_soon_threadsafe(task.cancel)
        thread.join(3 * CLOSE_S)


def check_websockets(to: str) -> None:
    """Raise MissingDependencyError unless websockets is installed."""
    try:
        import websockets.asyncio.server  # noqa: F401
    except ImportError as error:
        raise MissingDependencyError(
            f"--to {to} needs websockets ({error}); install it: {install_command('live')}"
        ) from error


def to_pcm_16(samples: Any) -> bytes:
    """Return samples as ``Stream.push`` takes them as integers of 16 bits, little-endian, of one channel."""
    return np.rint(np.clip(mono_samples(samples), -1, 1) * 32767).astype("<i2").tobytes()
