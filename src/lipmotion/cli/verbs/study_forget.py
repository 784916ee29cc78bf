"""``lipmotion study forget``: delete what one rater has answered."""

from __future__ import annotations

import argparse

from lipmotion.cli.arguments.paths import add_input
from lipmotion.cli.terminal.printing import print_line


def add(actions: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the action to ``lipmotion study``."""
    parser = actions.add_parser("forget", help="delete all answers of one rater")
    add_input(parser, "study", what="study", metavar="STUDY")
    parser.add_argument("rater", help="name of the rater in the exported answers, as r007")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``forget_rater``; print how many answers there were."""
    from lipmotion.study.collected import forget_rater

    count = forget_rater(options.study, options.rater)
    print_line(f"{options.rater}: {count} answers deleted; files that were exported before still have them")
