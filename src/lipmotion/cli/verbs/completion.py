"""``lipmotion completion``: the script by which a shell completes the command line."""

from __future__ import annotations

import argparse

from lipmotion.cli.arguments.shell_completion import SHELLS, script
from lipmotion.cli.terminal.printing import print_lines


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = verbs.add_parser("completion", help="print the script by which a shell completes verbs and options")
    parser.add_argument("shell", choices=tuple(SHELLS), help="bash and zsh: eval it; fish: | source")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Print the script."""
    from lipmotion.cli.command_line import parser

    print_lines(script(options.shell, parser()).removesuffix("\n"))
