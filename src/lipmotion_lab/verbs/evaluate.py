"""``lipmotion evaluate``: compare generated with recorded motion on held-out recordings."""

from __future__ import annotations

import argparse
from typing import Any

from lipmotion.cli.arguments.declared import add_options
from lipmotion.cli.arguments.options import add_figures_arguments, list_or_all, report_figures
from lipmotion.cli.arguments.paths import add_input
from lipmotion.pipeline.request import Request


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = verbs.add_parser("evaluate", help="compare generated with recorded motion")
    add_input(parser, "model", what="model", replaceable=True)
    add_input(parser, "corpus", what="corpus")
    parser.add_argument("--split", default="test", help="train, val, test or all (default: test)")
    parser.add_argument("--speaker", action="append", default=[], metavar="NAME", help="only this speaker (repeatable)")
    add_options(parser, Request, "recogniser")
    add_figures_arguments(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``lipmotion.evaluate`` and print its figures."""
    from lipmotion.corpora.store import Corpus, Selection
    from lipmotion.measures.evaluation_table import figures_table
    from lipmotion.pipeline.model import load_model
    from lipmotion.types import Monitor
    from lipmotion.units import Lexicon
    from lipmotion_lab.evaluation.evaluate import evaluate

    selection = Selection(list_or_all(options.split), tuple(options.speaker))

    def compute(lexicon: Lexicon | None, monitor: Monitor) -> dict[str, Any]:
        return evaluate(
            load_model(options.model),
            Corpus.open(options.corpus),
            selection=selection,
            lexicon=lexicon,
            recogniser=options.recogniser,
            monitor=monitor,
        )

    report_figures(options, compute, figures_table)
