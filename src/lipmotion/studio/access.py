"""Who may ask: this machine, from the page itself, with the token."""

from __future__ import annotations

import hmac
from dataclasses import dataclass
from hashlib import sha256
from urllib.parse import parse_qs

from starlette.types import ASGIApp, Receive, Scope, Send

from lipmotion.web.replies import FRESH, JSONResponse

TOKEN_HEADER = "x-lipmotion-token"  # noqa: S105 # its name
API = "/api"
KEY_DIGITS = 32


@dataclass(frozen=True)
class Access:
    """What a request must bring.

    token : of this run of the server
    hosts : what browsers call the server: names with the port, in lower case
    """

    token: str
    hosts: frozenset[str]

    def key(self, path: str) -> str:
        """Return the key that allows to load one address: for elements of a page, which bring no headers."""
        return hmac.new(self.token.encode(), path.encode(), sha256).hexdigest()[:KEY_DIGITS]

    def with_key(self, path: str) -> str:
        """Return an address with its key."""
        return f"{path}?key={self.key(path)}"

    def refusal(self, method: str, path: str, query: bytes, headers: dict[str, str]) -> tuple[int, str] | None:
        """Return why a request is refused, with a status; None: it is not.

        headers : by their names in lower case
        """
        host, origin = headers.get("host", "").lower(), headers.get("origin")
        if host not in self.hosts or (origin is not None and origin.lower() != f"http://{host}"):
            return 403, "only the page of this server may ask"
        if headers.get("sec-fetch-site", "none") not in ("none", "same-origin") and path != "/":
            return 403, "only the page of this server may ask"
        if path != API and not path.startswith(f"{API}/"):
            return None
        if hmac.compare_digest(headers.get(TOKEN_HEADER, "").encode(), self.token.encode()):
            return None
        given = parse_qs(query.decode("latin-1")).get("key", [""])[0] if method in ("GET", "HEAD") else ""
        if hmac.compare_digest(given.encode(), self.key(path).encode()):
            return None
        return 401, "the token is missing, or that of an earlier run; open the address that lipmotion studio printed"


class Guard:
    """Lets through what has access."""

    def __init__(self, application: ASGIApp, access: Access) -> None:
        self._application, self._access = application, access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Reply to a request, or refuse it."""
        if scope["type"] == "http":
            headers = {name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]}
            refusal = self._access.refusal(scope["method"], scope["path"], scope["query_string"], headers)
            if refusal is not None:
                reply = JSONResponse({"error": refusal[1]}, refusal[0], FRESH)
                await reply(scope, receive, send)
                return
        await self._application(scope, receive, send)
