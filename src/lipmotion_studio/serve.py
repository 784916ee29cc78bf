"""Serving of the studio over HTTP, for this machine alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from secrets import token_urlsafe
from threading import Thread
from typing import Any

from lipmotion.errors import InputError
from lipmotion.storage.files import sound_reference
from lipmotion_studio.web.listening import HOST, check_installed, open_socket, serve

TOKEN_BYTES = 24
NAMES = (HOST, "localhost")
"""What browsers on this machine may call the server."""


def serve_studio(  # noqa: PLR0913
    source: Path | None = None,
    *,
    out: Path | None = None,
    model: Path | None = None,
    characters: Mapping[str, Path] | None = None,
    recordings: Path | None = None,
    against: Path | None = None,
    port: int = 0,
    started: Callable[[str], object] | None = None,
) -> None:
    """Let a project be worked on in a browser of this machine, until the process is stopped.

    source     : a recording, a folder or a list of recordings, or a project; None: an empty project
    out        : folder of a new project; None: beside the source
    model      : of the project from now on; None: as it is
    characters : further ones of the project, and filmed faces, by their names
    recordings : folder of recordings that a voice or a face can be made of; None: as it is
    against    : a model with which the project's is compared on the page; None: none
    port       : 0: any that is free
    started    : called with the address of the page, which holds a token, once it can be opened
    Raises InputError: no such file, no project that can be read, or the port is taken. ExportError: another process
    works on the project. MissingDependencyError: a package of the extra ``studio`` is not installed.
    """
    check_installed("the studio", "studio")
    if recordings is not None and not recordings.is_dir():
        raise InputError(f"{recordings}: no such folder; give a folder of videos of one person")
    from lipmotion_studio.application import create_application
    from lipmotion_studio.folder import PROJECT, open_folder
    from lipmotion_studio.requests import Access
    from lipmotion_studio.studio import Studio, load_known_model

    def prepare() -> None:
        """Load what the first edit will need, while the page is opened."""
        from lipmotion.kernels.compiler import numba_works
        from lipmotion_faces.head.stage import make_figure_mesh

        numba_works()
        make_figure_mesh()

    with open_socket(HOST, port) as place, open_folder(source, out) as folder:
        file = folder.path.absolute() / PROJECT
        changes: dict[str, Any] = {}
        if characters:
            added = {name: sound_reference(path.absolute(), file) for name, path in characters.items()}
            changes["characters"] = {**folder.project.characters, **added}
        if model:
            changes["model"] = sound_reference(model.absolute(), file)
        if recordings:
            changes["recordings"] = sound_reference(recordings.absolute(), file)
        if changes:
            folder.change(lambda now: replace(now, **changes))
        other = load_known_model(against) if against else None
        token = token_urlsafe(TOKEN_BYTES)
        hosts = frozenset(f"{name}:{place.getsockname()[1]}" for name in NAMES)
        with closing(Studio(folder, against=other)) as studio:
            Thread(target=prepare, name="prepare", daemon=True).start()
            application = create_application(studio, Access(token, hosts))
            serve(application, place, started=lambda address: started(f"{address}#{token}") if started else None)
