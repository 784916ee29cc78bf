"""``lipmotion experiment engines``: all engines on the same recordings."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from lipmotion.cli.arguments.experiment_options import add_experiment_arguments, run_experiment
from lipmotion.cli.arguments.options import list_or_all
from lipmotion.cli.arguments.paths import add_output

if TYPE_CHECKING:
    from lipmotion.corpora.store import Corpus
    from lipmotion.experiments.runner import ExperimentSettings


def add(actions: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the experiment to ``lipmotion experiment``."""
    parser = actions.add_parser("engines", help="all engines in one table")
    parser.add_argument("--split", default="val", help="compare on val or test (default: val)")
    kept = "the engines' models: what is not there yet is trained and kept (default: train all, keep none)"
    add_output(parser, "--models", is_folder=True, metavar="FOLDER", help=kept)
    add_experiment_arguments(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``experiment.engines`` and print its table."""
    from lipmotion.experiments.engines.engine_comparison import engines
    from lipmotion.experiments.engines.text import table

    def experiment(corpus: Corpus, settings: ExperimentSettings) -> dict[str, Any]:
        return engines(corpus, split=list_or_all(options.split), models=options.models, settings=settings)

    run_experiment(options, experiment, table)
