"""``lipmotion addon``: the add-on for another program, as a file that it installs."""

from __future__ import annotations

import argparse
from pathlib import Path

from lipmotion.cli.arguments.paths import add_output
from lipmotion.cli.terminal.printing import print_line


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = verbs.add_parser("addon", help="write the add-on for Blender, which keys characters from motion files")
    parser.add_argument("program", metavar="PROGRAM", help="blender")
    add_output(parser, "-o", "--output", type=Path, required=True, metavar="FILE.zip", help="the file to install")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Write the add-on; print its path."""
    from lipmotion.formats.blender import write_addon

    write_addon(options.program, options.output)
    print_line(options.output)
