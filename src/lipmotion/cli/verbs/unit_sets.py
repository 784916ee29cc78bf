"""``lipmotion experiment unit-sets``: Table 1 of Hofer 2008, on a corpus."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from lipmotion.cli.arguments.experiment_options import add_experiment_arguments, run_experiment
from lipmotion.cli.arguments.options import list_or_all

if TYPE_CHECKING:
    from lipmotion.corpora.store import Corpus
    from lipmotion.experiments.runner import ExperimentSettings


def add(actions: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the experiment to ``lipmotion experiment``."""
    parser = actions.add_parser("unit-sets", help="which unit set predicts closings of the mouth (Hofer 2008, Table 1)")
    parser.add_argument("--split", default="test", help="compare on train, val, test or all (default: test)")
    parser.add_argument("--closures", action="store_true", help="pin the lips closed in every p, b and m")
    add_experiment_arguments(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``experiment.unit_sets`` and print its table."""
    from lipmotion.experiments.hofer2008.unit_sets import table, unit_sets

    def experiment(corpus: Corpus, settings: ExperimentSettings) -> dict[str, Any]:
        return unit_sets(corpus, split=list_or_all(options.split), closures=options.closures, settings=settings)

    run_experiment(options, experiment, table)
