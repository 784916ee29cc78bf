"""``lipmotion studio``: a page of this machine alone, on which motion is seen, edited, approved and exported."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from lipmotion.cli.arguments.options import add_verb
from lipmotion.cli.terminal.printing import flush_output, print_line

TOKEN_BYTES = 24
NAMES = ("127.0.0.1", "localhost")  # what browsers on this machine may call the server; it listens at the first


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    add_verb(verbs, __package__, "studio", run)


def run(options: argparse.Namespace) -> None:
    """Let a project be worked on in a browser, until the process is stopped; print the address, which holds a token.

    Raises InputError: no such file, no project that can be read, or the port is taken. ExportError: another process
    works on the project. MissingDependencyError: a package of the extra ``studio`` is not installed.
    """
    import webbrowser
    from contextlib import closing
    from dataclasses import replace
    from secrets import token_urlsafe
    from threading import Thread

    from lipmotion.errors import InputError
    from lipmotion.storage.files import sound_reference
    from lipmotion_studio.web.listening import check_installed, open_socket, serve

    check_installed("the studio", "studio")
    if options.recordings is not None and not options.recordings.is_dir():
        raise InputError(f"{options.recordings}: no such folder; give a folder of videos of one person")
    from lipmotion_studio.application import Access, create_application
    from lipmotion_studio.folder import PROJECT, open_folder
    from lipmotion_studio.studio import Studio, load_known_model

    def prepare() -> None:
        """Load what the first edit will need, while the page is opened."""
        from lipmotion.kernels.compiler import numba_works
        from lipmotion_faces.head.stage import make_figure_mesh

        numba_works()
        make_figure_mesh()

    def announce(address: str) -> None:
        print_line(f"the studio is at {address}#{token} (Ctrl-C ends; every edit is on the disk)")
        flush_output()
        if not options.no_browser:
            webbrowser.open(f"{address}#{token}")

    with open_socket(NAMES[0], options.port) as place, open_folder(options.source, options.output) as folder:

        def refer(path: Path) -> str:
            return sound_reference(path.absolute(), folder.path.absolute() / PROJECT)

        files = {name: getattr(options, name) for name in ("model", "recordings")}
        changes: dict[str, Any] = {name: refer(path) for name, path in files.items() if path}
        if added := {path.stem: refer(path) for path in (*options.character, *options.face)}:
            changes["characters"] = {**folder.project.characters, **added}
        if changes:
            folder.change(lambda now: replace(now, **changes))
        against = load_known_model(options.against) if options.against else None
        token = token_urlsafe(TOKEN_BYTES)
        hosts = frozenset(f"{name}:{place.getsockname()[1]}" for name in NAMES)
        with closing(Studio(folder, against=against)) as studio:
            Thread(target=prepare, name="prepare", daemon=True).start()
            serve(create_application(studio, Access(token, hosts)), place, started=announce)
