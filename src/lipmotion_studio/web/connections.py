"""Connections of browsers that keep nobody else waiting: time limits, and room for new ones (needs uvicorn)."""

from __future__ import annotations

import asyncio
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

MAX_CONNECTIONS, MAX_OF_ONE = 800, 256
"""Connections at the same time, of all clients and of one: beyond these, those without a request are closed."""
HEADERS_S, IDLE_S, STALLED_S = 5.0, 20, 30.0
"""How long the headers of a request may take; a connection is kept after a reply; and a reply may wait for its client,
before that is asked to have taken ``MIN_BYTES_S`` meanwhile."""
MIN_BYTES_S = 4096.0
FIRST_READ_S = 0.1  # after which the request of a new connection has been read, where it came with it


class PunctualConnection(H11Protocol):
    """uvicorn's connection, closed where the client lets the server wait; of too many, what waits longest is closed."""

    _due: asyncio.TimerHandle | None = None
    _stalled: asyncio.TimerHandle | None = None
    idle_since_s, was_read = 0.0, False
    _waited_s, _taken = 0.0, 0
    _paused = (0.0, 0)

    @property
    def is_busy(self) -> bool:
        """Whether a request is being replied to."""
        return self.cycle is not None and not self.cycle.response_complete

    def connection_made(self, transport: Any) -> None:
        """Wait for the first request, and make room for the connection."""
        super().connection_made(transport)
        self.idle_since_s = self.loop.time()
        self._due = self.loop.call_later(HEADERS_S, self._end_if_idle)
        self.loop.call_later(FIRST_READ_S, self._make_room)

    def data_received(self, data: bytes) -> None:
        """Take a part of a request; the time of its headers begins with its first byte."""
        if self._due is None and not self.is_busy:
            self._due = self.loop.call_later(HEADERS_S, self._end_if_idle)
        super().data_received(data)
        if self.is_busy:
            self._stop_waiting()

    def on_response_complete(self) -> None:
        """Wait for the next request."""
        self.idle_since_s = self.loop.time()
        super().on_response_complete()
        if not self.is_busy and self.conn.trailing_data[0]:  # a part of the next one has come already
            self._due = self.loop.call_later(HEADERS_S, self._end_if_idle)

    def timeout_keep_alive_handler(self) -> None:
        """Close a connection that was kept."""
        self.transport.abort()  # what is left of a reply is not waited for

    def pause_writing(self) -> None:
        """Wait for a client that does not take its reply as fast as it is made."""
        super().pause_writing()
        self._paused = self.loop.time(), self.transport.get_write_buffer_size()
        self._stalled = self.loop.call_later(STALLED_S - self._waited_s, self._end_if_slow)

    def resume_writing(self) -> None:
        """Go on with a reply that is taken."""
        super().resume_writing()
        self._count_taken()
        if self._stalled is not None:
            self._stalled.cancel()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the connection."""
        self._stop_waiting()
        if self._stalled is not None:
            self._stalled.cancel()
        super().connection_lost(exc)

    def _stop_waiting(self) -> None:
        if self._due is not None:
            self._due.cancel()
        self._due = None

    def _count_taken(self) -> None:
        """Count what the client has taken while its reply waited, and how long that was."""
        since_s, before = self._paused
        self._paused = self.loop.time(), self.transport.get_write_buffer_size()
        self._waited_s += self._paused[0] - since_s
        self._taken += before - self._paused[1]

    def _end_if_slow(self) -> None:
        self._count_taken()
        if self._taken < MIN_BYTES_S * self._waited_s:
            self.transport.abort()
            return
        self._waited_s, self._taken = 0.0, 0
        self._stalled = self.loop.call_later(STALLED_S, self._end_if_slow)

    def _end_if_idle(self) -> None:
        if not self.is_busy:
            self.transport.abort()

    def _make_room(self) -> None:
        """Where there are too many connections, close one: idle longest, without a request first, not a new one."""
        self.was_read = True
        everybody: set[Any] = {*self.connections}
        own = [each for each in everybody if each.client and self.client and each.client[0] == self.client[0]]
        crowd = own if len(own) > MAX_OF_ONE else everybody if len(everybody) > MAX_CONNECTIONS else ()
        if self in crowd:
            idle = [each for each in crowd if each.was_read and not each.is_busy]
            min(idle, key=lambda each: (each.cycle is not None, each.idle_since_s), default=self).transport.abort()
