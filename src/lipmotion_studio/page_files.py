"""Files of the page, by their addresses: all that lie in the folder ``page`` of the package."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from importlib.resources import files
from importlib.resources.abc import Traversable

from lipmotion.formats.web_page import colour_code

FIRST = "studio.html"
"""The page itself."""
KINDS = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".mjs": "text/javascript; charset=utf-8",
    ".json": "application/json",
    ".svg": "image/svg+xml",
    ".png": "image/png",
    ".txt": "text/plain; charset=utf-8",
    ".md": "text/plain; charset=utf-8",
    ".woff2": "font/woff2",
    ".wasm": "application/wasm",
}
"""What files are served as, by their suffixes; others are not served."""


@dataclass(frozen=True)
class PageFile:
    """The content of a file, and what it is served as."""

    content: bytes
    kind: str


def page_files() -> dict[str, PageFile]:
    """Return the files of the page by their addresses, without the first slash; that of the page itself is empty."""
    found = dict(_found(files("lipmotion_studio") / "page", ""))
    return found | ({"": found[FIRST]} if FIRST in found else {})


def _found(folder: Traversable, before: str) -> Iterator[tuple[str, PageFile]]:
    if not folder.is_dir():
        return
    for each in folder.iterdir():
        kind = KINDS.get(f".{each.name.rpartition('.')[2].lower()}")
        if each.is_dir():
            yield from _found(each, f"{before}{each.name}/")
        elif kind is not None:
            content = each.read_bytes()
            if each.name.endswith(".css"):
                content = colour_code(content.decode("utf-8")).encode()
            yield f"{before}{each.name}", PageFile(content, kind)
