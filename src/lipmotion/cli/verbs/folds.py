"""``lipmotion experiment folds``: cross-validation on the training list."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from lipmotion.cli.arguments.experiment_options import add_experiment_arguments, run_experiment, unfinished_parts

if TYPE_CHECKING:
    from lipmotion.corpora.store import Corpus
    from lipmotion.experiments.runner import ExperimentSettings


def add(actions: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the experiment to ``lipmotion experiment``."""
    parser = actions.add_parser(
        "folds", help="cross-validation: generate each part of the training list by a model of the others"
    )
    parser.add_argument("--by-speaker", action="store_true", help="leave whole speakers out: strangers to the model")
    count = "number of parts (default: 5; by speaker: one each)"
    parser.add_argument("--folds", type=int, metavar="K", help=count)
    add_experiment_arguments(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``experiment.folds``, print its table; with ``--output``, a second run goes on after a stop."""
    from lipmotion.experiments.folds import folds, table

    def experiment(corpus: Corpus, settings: ExperimentSettings) -> dict[str, Any]:
        with unfinished_parts(options) as work:
            return folds(corpus, count=options.folds, by_speaker=options.by_speaker, work=work, settings=settings)

    run_experiment(options, experiment, table)
