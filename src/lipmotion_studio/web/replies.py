"""Replies of pages that lipmotion serves: the headers of all of them, and those to errors."""

from __future__ import annotations

import logging
import sqlite3
from collections.abc import Callable, Container, Mapping
from functools import partial
from typing import Any

from starlette import responses
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from lipmotion.errors import ExportError, LipMotionError
from lipmotion.storage.json_text import as_json, nan_as_null

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
            return as_json(nan_as_null(content), ensure_ascii=False).encode()


class SecurityHeaders:
    """Adds headers to every reply, of errors too."""

    def __init__(self, application: ASGIApp, headers: Mapping[str, str] = HEADERS) -> None:
        self._application = application
        self._headers = [(name.encode(), value.encode()) for name, value in headers.items()]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on."""

        async def secured(message: Message) -> None:
            if message["type"] == "http.response.start":
                message = {**message, "headers": [*message.get("headers", ()), *self._headers]}
            await send(message)

        await self._application(scope, receive, secured)


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


def foreign_refusal(
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


async def _refused(_: Request, error: Exception) -> Response:
    status, headers = getattr(error, "status_code", 400), getattr(error, "headers", None)
    return JSONResponse({"error": str(getattr(error, "detail", ""))}, status, {**FRESH, **(headers or {})})


async def failed(status: int, _: Request, error: Exception) -> Response:
    """Return the reply to an error that was raised on purpose."""
    if status == UNAVAILABLE:
        LOG.warning("%s", error)
        return JSONResponse({"error": "cannot be stored now; try again"}, status, FRESH)
    return JSONResponse({"error": str(error)}, status, FRESH)


UNAVAILABLE = 503
ERRORS: dict[type[Exception], Callable[[Request, Any], Any]] = {
    HTTPException: _refused,
    LipMotionError: partial(failed, 422),
    **dict.fromkeys((ExportError, OSError, MemoryError, sqlite3.Error), partial(failed, UNAVAILABLE)),
}
"""What is replied to errors that are raised on purpose, and to a full disk or memory: JSON, ``{"error": text}``."""


def json_reply(content: Any, status: int = 200) -> Response:
    """Return content as a reply of JSON."""
    return JSONResponse(content, status, FRESH)
