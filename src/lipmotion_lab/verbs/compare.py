"""``lipmotion compare``: how far motion files or videos are from a reference."""

from __future__ import annotations

import argparse

from lipmotion.cli.arguments.options import add_figures_arguments, report_figures
from lipmotion.cli.arguments.paths import add_input


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = verbs.add_parser("compare", help="compare motion files or videos with a reference")
    what = "motion file (.json .csv .npz, or another that can be read), or video of a face"
    add_input(parser, "reference", what="recording", help=what)
    add_input(parser, "others", what="recording", nargs="+", metavar="OTHER", help="the same, compared with it")
    add_figures_arguments(parser, lexicon=False)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``lipmotion.compare`` and print its figures."""
    from lipmotion.measures.evaluation_table import comparison_table
    from lipmotion_lab.compare import compare

    report_figures(
        options, lambda _, monitor: compare(options.reference, *options.others, monitor=monitor), comparison_table
    )
