"""Serving of an application over HTTP, by uvicorn, and the files of its page."""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from lipmotion.errors import InputError, MissingDependencyError
from lipmotion.extensions import install_command
from lipmotion.pipeline.batch.report import insert_colours
from lipmotion.storage.sources import read_shipped_table

if TYPE_CHECKING:
    from importlib.resources.abc import Traversable

    from starlette.types import ASGIApp

HOST = "127.0.0.1"


def check_installed(purpose: str, extra: str) -> None:
    """Raise MissingDependencyError if Starlette or uvicorn is not installed; ``extra`` brings them."""
    try:
        import starlette  # noqa: F401
        import uvicorn  # noqa: F401
    except ImportError as error:
        raise MissingDependencyError(
            f"{purpose} needs Starlette and uvicorn ({error}); install them: {install_command(extra)}"
        ) from error


def serve(
    application: ASGIApp, place: socket.socket, *, host: str = HOST, started: Callable[[str], object] | None = None
) -> None:
    """Serve an application until the process is stopped, fairly to all clients; ``started`` gets the page's address."""
    import uvicorn

    from lipmotion_studio.web.connections import IDLE_S, PunctualConnection

    config = uvicorn.Config(
        application,
        lifespan="off",
        access_log=False,  # no addresses of visitors are kept
        log_level="warning",
        server_header=False,
        http=PunctualConnection,
        timeout_keep_alive=IDLE_S,
        timeout_graceful_shutdown=5,
        ws="none",
    )
    if started:
        started(f"http://{f'[{host}]' if ':' in host else host}:{place.getsockname()[1]}/")
    uvicorn.Server(config).run([place])


def open_socket(host: str, port: int) -> socket.socket:
    """Return a socket that connections can come to. Raises InputError: the address is taken, or not of this machine."""
    if not 0 <= port <= 65_535:
        raise InputError(f"the port is {port}, required 0 to 65535; give another --port")
    try:
        place = socket.create_server((host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET)
    except (OSError, UnicodeError) as error:
        raise InputError(f"{host}:{port} cannot be listened at ({error}); give another --port or --host") from error
    return place


KINDS = {row["suffix"]: row["kind"] for row in read_shipped_table("lipmotion_studio.web", "kinds.csv")}
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
                content = insert_colours(content.decode("utf-8")).encode()
            yield f"{before}{each.name}", (content, kind)
