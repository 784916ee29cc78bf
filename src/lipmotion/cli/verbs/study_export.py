"""``lipmotion study export``: the answers of a study as a table."""

from __future__ import annotations

import argparse

from lipmotion.cli.arguments.paths import add_input, add_output
from lipmotion.cli.terminal.printing import print_line


def add(actions: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the action to ``lipmotion study``."""
    parser = actions.add_parser("export", help="write the answers as CSV, one row for each judgement")
    add_input(parser, "study", what="study", metavar="STUDY")
    add_output(parser, "-o", "--output", required=True, metavar="FILE.csv")
    parser.add_argument("--rater", metavar="NAME", help="the answers of this rater alone, as r007 (default: all)")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``export_answers``; print how many there are."""
    from lipmotion.study.collected import export_answers

    print_line(f"{options.output}: {export_answers(options.study, options.output, options.rater)} answers")
