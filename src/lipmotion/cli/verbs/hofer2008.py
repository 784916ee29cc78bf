"""``lipmotion experiment hofer2008``: Table 1 of Hofer 2008 by its own system, on a corpus."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from lipmotion.cli.arguments.experiment_options import add_experiment_arguments, run_experiment, unfinished_parts
from lipmotion.cli.arguments.options import list_or_all

if TYPE_CHECKING:
    from lipmotion.corpora.store import Corpus
    from lipmotion.experiments.runner import ExperimentSettings


def add(actions: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the experiment to ``lipmotion experiment``."""
    parser = actions.add_parser(
        "hofer2008", help="which unit set predicts closings of the mouth, by the paper's own system (Table 1)"
    )
    parser.add_argument("--split", default="test", help="compare on test, val, train or all (default: test)")
    add_experiment_arguments(parser, quick="one or two Gaussians a state")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``experiment.hofer2008`` and print its tables; with ``--output``, a second run goes on where one stopped."""
    from lipmotion.experiments.hofer2008.table1 import FULL, QUICK, hofer2008
    from lipmotion.experiments.hofer2008.table1_text import table

    def experiment(corpus: Corpus, settings: ExperimentSettings) -> dict[str, Any]:
        with unfinished_parts(options) as work:
            chosen = QUICK if options.quick else FULL
            return hofer2008(corpus, chosen, split=list_or_all(options.split), work=work, settings=settings)

    run_experiment(options, experiment, table)
