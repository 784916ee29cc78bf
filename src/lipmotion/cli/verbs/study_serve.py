"""``lipmotion study serve``: the page on which raters answer."""

from __future__ import annotations

import argparse

from lipmotion.cli.arguments.paths import add_input
from lipmotion.cli.terminal.printing import flush_output, print_line


def add(actions: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the action to ``lipmotion study``."""
    parser = actions.add_parser("serve", help="show a study to raters as a web page, and store their answers")
    add_input(parser, "study", what="study", metavar="STUDY")
    host = "address to listen at (default: 127.0.0.1, which only this machine reaches; see docs/study.md)"
    parser.add_argument("--host", default="127.0.0.1", help=host)
    parser.add_argument("--port", type=int, default=8000, help="0: any that is free (default: 8000)")
    name = "name by which raters reach the server through another one, as study.example.org; may be repeated"
    parser.add_argument("--name", action="append", default=[], metavar="HOST", help=name)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``serve_study``; print the address of the page."""
    from lipmotion.study.serve import serve_study

    def started(address: str) -> None:
        print_line(f"raters begin at {address} (Ctrl-C ends; answers are kept in {options.study})")
        flush_output()

    serve_study(options.study, host=options.host, port=options.port, names=options.name, started=started)
