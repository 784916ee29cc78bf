"""``lipmotion study analyse``: what the answers of a study say."""

from __future__ import annotations

import argparse

from lipmotion.cli.arguments.figures import add_figures_arguments, report_figures
from lipmotion.cli.arguments.paths import add_input


def add(actions: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the action to ``lipmotion study``."""
    parser = actions.add_parser("analyse", help="print what the answers of a study say, and how sure it is")
    add_input(parser, "answers", what="table of answers", metavar="ANSWERS.csv", help="of lipmotion study export")
    relative = "condition to which improvement is relative (default: that with the lowest mean)"
    parser.add_argument("--baseline", metavar="CONDITION", help=relative)
    planned = "probability with which a planned study shall tell a difference (default: 0.8)"
    parser.add_argument("--power", type=float, default=0.8, metavar="P", help=planned)
    count = "sentences of a planned study (default: as many as in this one)"
    parser.add_argument("--sentences", type=int, metavar="N", help=count)
    add_figures_arguments(parser, lexicon=False)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``analyse_study`` and print its tables."""
    from lipmotion.study.analysis.analyse import analyse_study
    from lipmotion.study.analysis.analysis_table import analysis_table

    report_figures(
        options,
        lambda *_: analyse_study(
            options.answers, baseline=options.baseline, power=options.power, sentences=options.sentences
        ),
        analysis_table,
    )
