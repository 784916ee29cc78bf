"""``lipmotion completion``: the script by which a shell completes the command line."""

from __future__ import annotations

import argparse

from lipmotion.cli.terminal.printing import print_lines

SHELLS = ("bash", "zsh", "fish", "powershell")


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = verbs.add_parser("completion", help="print the script by which a shell completes verbs and options")
    parser.add_argument("shell", choices=SHELLS, help="bash and zsh: eval it; fish: | source")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Print the script."""
    import shtab

    from lipmotion.cli.command_line import parser

    whole = parser()
    _complete_files(whole)
    print_lines(shtab.complete(whole, shell=options.shell).removesuffix("\n"))


def _complete_files(parser: argparse.ArgumentParser) -> None:
    """Let every value that has no choices be a file."""
    import shtab

    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for part in action.choices.values():
                _complete_files(part)
        elif action.choices is None and action.nargs != 0:
            action.complete = shtab.FILE  # type: ignore[attr-defined] # where shtab looks for it
