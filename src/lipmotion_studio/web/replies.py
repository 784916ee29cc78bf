"""Requests to pages that lipmotion serves, whose bodies are bounded in size and in time, and replies to them."""

from __future__ import annotations

import asyncio
import io
import logging
import sqlite3
from collections.abc import Callable, Container, Mapping
from functools import partial
from typing import IO, Any

from starlette import responses
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from lipmotion.errors import ExportError, LipMotionError
from lipmotion.storage.json_text import as_json, from_json, replace_nan

LOG = logging.getLogger("lipmotion")
HEADERS = {
    "content-security-policy": "default-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'; "
    "object-src 'none'",
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "x-frame-options": "DENY",
    "cross-origin-resource-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
    "permissions-policy": "camera=(), microphone=(), geolocation=()",
}
FRESH = {"cache-control": "no-store"}


class JSONResponse(responses.JSONResponse):
    """JSON as a reply: null for what is no number, half a character escaped; whatever the content, browsers read it."""

    def render(self, content: Any) -> bytes:  # noqa: D102
        try:
            return as_json(content, ensure_ascii=False).encode()
        except ExportError:
            return as_json(replace_nan(content), ensure_ascii=False).encode()


class SecurityHeaders:
    """Adds headers to every reply, of errors too."""

    def __init__(self, application: ASGIApp, headers: Mapping[str, str] = HEADERS) -> None:
        self._application = application
        self._headers = [(name.encode(), value.encode()) for name, value in headers.items()]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on."""

        async def send_secured(message: Message) -> None:
            if message["type"] == "http.response.start":
                message = {**message, "headers": [*message.get("headers", ()), *self._headers]}
            await send(message)

        await self._application(scope, receive, send_secured)


class Guard:
    """Lets through what is not refused.

    refusal : returns for method, path, query and headers (by their names in lower case) why a request is refused, with
              a status; None: it is not
    """

    def __init__(self, application: ASGIApp, refusal: Callable[..., tuple[int, str] | None]) -> None:
        self._application, self._refusal = application, refusal

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Reply to a request, or refuse it."""
        if scope["type"] == "http":
            headers = {name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]}
            refusal = self._refusal(scope["method"], scope["path"], scope["query_string"], headers)
            if refusal is not None:
                reply = JSONResponse({"error": refusal[1]}, refusal[0], FRESH)
                await reply(scope, receive, send)
                return
        await self._application(scope, receive, send)


def refuse_foreign(
    path: str, headers: Mapping[str, str], is_own: Callable[[str], bool], names: Container[str] = ()
) -> tuple[int, str] | None:
    """Return why a request is refused that another site's page sends, or that came by a foreign name; None: it is not.

    headers : by their names in lower case
    is_own  : whether the ``Host`` that a request names is this server
    names   : of this server at another that passes requests on, which may be those of a page's origin
    """
    host, origin = headers.get("host", "").lower(), headers.get("origin", "").lower()
    page = origin.partition("://")[2] if origin.startswith(("http://", "https://")) else origin
    if not is_own(host) or (page and page != host and page not in names):
        return 403, "only the page of this server may ask"
    if headers.get("sec-fetch-site", "none") not in ("none", "same-origin") and path != "/":
        return 403, "only the page of this server may ask"
    return None


async def _reply_refused(_: Request, error: Exception) -> Response:
    status, headers = getattr(error, "status_code", 400), getattr(error, "headers", None)
    return JSONResponse({"error": str(getattr(error, "detail", ""))}, status, {**FRESH, **(headers or {})})


async def reply_failed(status: int, _: Request, error: Exception) -> Response:
    """Return the reply to an error that was raised on purpose."""
    if status == UNAVAILABLE:
        LOG.warning("%s", error)
        return JSONResponse({"error": "cannot be stored now; try again"}, status, FRESH)
    return JSONResponse({"error": str(error)}, status, FRESH)


UNAVAILABLE = 503
ERRORS: dict[type[Exception], Callable[[Request, Any], Any]] = {
    HTTPException: _reply_refused,
    LipMotionError: partial(reply_failed, 422),
    **dict.fromkeys((ExportError, OSError, MemoryError, sqlite3.Error), partial(reply_failed, UNAVAILABLE)),
}
"""What is replied to errors that are raised on purpose, and to a full disk or memory: JSON, ``{"error": text}``."""


def reply_json(content: Any, status: int = 200) -> Response:
    """Return content as a reply of JSON."""
    return JSONResponse(content, status, FRESH)


MAX_JSON_BYTES = 1 << 14
BODY_S = 10.0  # how long the body of a request may take to arrive


async def read_json(request: Request, largest: int = MAX_JSON_BYTES) -> Any:
    """Return the JSON that a request brings. Raises HTTPException: something else, too much, or too slowly."""
    if request.headers.get("content-type", "").partition(";")[0].strip().lower() != "application/json":
        raise HTTPException(415, "required application/json")  # which no other site's page can send unasked
    body = io.BytesIO()
    await write_body(request, body, largest, BODY_S)
    try:
        return from_json(body.getvalue().decode("utf-8"))
    except ValueError as error:
        raise HTTPException(400, "not JSON in UTF-8") from error


async def write_body(request: Request, file: IO[bytes], largest: int, within_s: float) -> None:
    """Write the body of a request into a file. Raises HTTPException: over ``largest`` bytes, too slow, broken off."""

    async def write() -> None:
        size = 0
        async for part in request.stream():
            size += len(part)
            if size > largest:
                raise HTTPException(413, f"required at most {largest} bytes", {"connection": "close"})
            file.write(part)

    try:
        await asyncio.wait_for(write(), within_s)
    except (TimeoutError, asyncio.TimeoutError) as error:
        raise HTTPException(408, "the request came too slowly") from error
    except ClientDisconnect as error:
        raise HTTPException(400, "the request broke off") from error
