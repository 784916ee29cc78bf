"""``lipmotion studio``: a page on which motion is seen, edited, approved and exported."""

from __future__ import annotations

import argparse
from pathlib import Path

from lipmotion.cli.arguments.declared import add_input, add_output
from lipmotion.cli.terminal.progress import flush_output, print_line


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = verbs.add_parser("studio", help="see, edit, approve and export motion on a page of this machine")
    source = "a recording, a folder or a list of recordings, or a project; NAME.studio: made if it is not there "
    source += "(default: an empty project)"
    add_input(parser, "source", what="recording", nargs="?", metavar="FILE|FOLDER|PROJECT", help=source)
    project = "folder of a new project (default: beside the source, its name and .studio)"
    add_output(parser, "-o", "--output", metavar="PROJECT", help=project)
    model = "trained model of the project from now on (default: the one that ships with the package)"
    add_input(parser, "--model", what="model", metavar="FILE", help=model)
    character = "your own character, as a face of the project: FILE.glb .vrm .obj (repeatable)"
    add_input(parser, "--character", what="character", action="append", default=[], metavar="FILE", help=character)
    recordings = "folder of videos that a voice or a face can be made of on the page (docs/studio.md)"
    add_input(parser, "--recordings", what="folder of recordings", metavar="FOLDER", help=recordings)
    face = "a filmed face, as a face of the project: FILE.face (repeatable)"
    add_input(parser, "--face", what="face", action="append", default=[], metavar="FILE", help=face)
    against = "another model, whose motion is compared with the project's on the page"
    add_input(parser, "--against", what="model", metavar="FILE", help=against)
    parser.add_argument("--port", type=int, default=0, help="0: any that is free (default: 0)")
    parser.add_argument("--no-browser", action="store_true", help="print the address, and open no browser")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``serve_studio``; print the address of the page, and open it."""
    import webbrowser

    from lipmotion_studio.serve import serve_studio

    def announce(address: str) -> None:
        print_line(f"the studio is at {address} (Ctrl-C ends; every edit is on the disk)")
        flush_output()
        if not options.no_browser:
            webbrowser.open(address)

    characters: dict[str, Path] = {path.stem: path for path in (*options.character, *options.face)}
    given = {"out": options.output, "model": options.model, "port": options.port}
    given |= {"recordings": options.recordings, "against": options.against}
    serve_studio(options.source, characters=characters, started=announce, **given)
