"""Files of pages, as they are served."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.resources.abc import Traversable

from lipmotion.formats.web_page import colour_code

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


def read_page(folder: Traversable, before: str = "") -> Iterator[tuple[str, tuple[bytes, str]]]:
    """Yield the files of the page: address, without the first slash, content, and what it is served as."""
    for each in folder.iterdir():
        kind = KINDS.get(f".{each.name.rpartition('.')[2].lower()}")
        if each.is_dir():
            yield from read_page(each, f"{before}{each.name}/")
        elif kind is not None:
            content = each.read_bytes()
            if each.name.endswith(".css"):
                content = colour_code(content.decode("utf-8")).encode()
            yield f"{before}{each.name}", (content, kind)
