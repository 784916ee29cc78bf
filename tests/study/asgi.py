"""Requests to an ASGI application in this process, without a server and without a client library."""

import asyncio
import json
from collections.abc import Callable
from typing import Any, NamedTuple

Application = Callable[..., Any]


class Reply(NamedTuple):
    """Status, headers by their names in lower case, and body of a reply."""

    status: int
    headers: dict[str, str]
    body: bytes

    @property
    def content(self) -> Any:
        return json.loads(self.body)


def ask(application: Application, path: str, content: Any = None, **more: Any) -> Reply:
    """Send one request and return the reply; ``content`` is sent as JSON, bytes as they are; more: as ``answered``."""
    return asyncio.run(answered(application, path, content, **more))


async def answered(
    application: Application,
    path: str,
    content: Any = None,
    *,
    method: str = "",
    token: str = "",
    headers: dict[str, str] | None = None,
) -> Reply:
    """Return the reply to a request: several may be on their way at the same time."""
    body = content if isinstance(content, bytes) else b"" if content is None else json.dumps(content).encode()
    sent = {"content-type": "application/json"} if content is not None else {}
    sent |= {"authorization": f"Bearer {token}"} if token else {}
    sent = {"host": "127.0.0.1"} | sent | (headers or {})
    scope = {
        "type": "http", "asgi": {"version": "3.0", "spec_version": "2.4"}, "http_version": "1.1",
        "method": method or ("GET" if content is None else "POST"), "scheme": "http", "path": path.partition("?")[0],
        "raw_path": path.partition("?")[0].encode(), "query_string": path.partition("?")[2].encode(), "root_path": "",
        "headers": [(name.encode(), value.encode("latin-1")) for name, value in sent.items()], "server": ("test", 80),
        "client": ("test", 1),
    }  # fmt: skip
    messages: list[dict[str, Any]] = []
    waiting = [{"type": "http.request", "body": body, "more_body": False}]

    async def receive() -> dict[str, Any]:
        return waiting.pop() if waiting else {"type": "http.disconnect"}

    async def send(message: dict[str, Any]) -> None:
        messages.append(message)

    await application(scope, receive, send)
    start = next(message for message in messages if message["type"] == "http.response.start")
    parts = [message.get("body", b"") for message in messages if message["type"] == "http.response.body"]
    return Reply(start["status"], {k.decode(): v.decode() for k, v in start["headers"]}, b"".join(parts))
