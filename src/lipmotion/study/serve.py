"""Serving of a study over HTTP, by uvicorn."""

from __future__ import annotations

import socket
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

from lipmotion.errors import InputError, MissingDependencyError
from lipmotion.extensions import install_command
from lipmotion.study.manifest import check_videos, read_study
from lipmotion.study.store import StudyStore

HOST, PORT = "127.0.0.1", 8000
MOST_CONNECTIONS = 1000
IDLE_S = 20
"""How long a connection without requests is kept open."""


def serve_study(
    folder: Path, *, host: str = HOST, port: int = PORT, started: Callable[[str], object] | None = None
) -> None:
    """Let raters take part in a study, until the process is stopped.

    host    : address to listen at; the default can be reached from this machine alone
    port    : 0: any that is free
    started : called with the address of the page once raters can come
    Every answer is on the disk before the rater's page learns that it is stored. A stopped study goes on where it was.
    Raises InputError: no study, a video is missing or has changed, or the address cannot be listened at.
    Raises MissingDependencyError: a package of the extra ``study`` is not installed.
    """
    try:
        import starlette  # noqa: F401
        import uvicorn
    except ImportError as error:
        raise MissingDependencyError(
            f"serving a study needs Starlette and uvicorn ({error}); install them: {install_command('study')}"
        ) from error
    from lipmotion.study.application import study_application

    study = read_study(folder)
    videos = check_videos(study, folder)
    with _listening(host, port) as place, closing(StudyStore(folder)) as store:
        config = uvicorn.Config(
            study_application(study, videos, store),
            lifespan="off",
            access_log=False,  # no addresses of raters are kept
            log_level="warning",
            server_header=False,
            limit_concurrency=MOST_CONNECTIONS,
            timeout_keep_alive=IDLE_S,
            timeout_graceful_shutdown=5,
            ws="none",
        )
        shown = f"[{host}]" if ":" in host else host
        if started:
            started(f"http://{shown}:{place.getsockname()[1]}/")
        uvicorn.Server(config).run([place])


def _listening(host: str, port: int) -> socket.socket:
    """Return a socket that connections can come to. Raises InputError: the address is taken, or not of this machine."""
    if not 0 <= port <= 65_535:
        raise InputError(f"the port is {port}, required 0 to 65535; give another --port")
    try:
        place = socket.create_server((host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET)
    except (OSError, UnicodeError) as error:
        raise InputError(f"{host}:{port} cannot be listened at ({error}); give another --port or --host") from error
    return place
