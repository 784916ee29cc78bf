"""Who may ask: this machine, from the page itself, with the token."""

from __future__ import annotations

import hmac
from dataclasses import dataclass
from hashlib import sha256
from urllib.parse import parse_qs

from lipmotion_studio.web.replies import foreign_refusal

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
        foreign = foreign_refusal(path, headers, self.hosts.__contains__)
        if foreign or (path != API and not path.startswith(f"{API}/")):
            return foreign
        if hmac.compare_digest(headers.get(TOKEN_HEADER, "").encode(), self.token.encode()):
            return None
        given = parse_qs(query.decode("latin-1")).get("key", [""])[0] if method in ("GET", "HEAD") else ""
        if hmac.compare_digest(given.encode(), self.key(path).encode()):
            return None
        return 401, "the token is missing, or that of an earlier run; open the address that lipmotion studio printed"
