"""``lipmotion experiment minnis2000``: the unit selection of Minnis & Breen 2000, as printed and with each addition."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from lipmotion.cli.arguments.experiment_options import add_experiment_arguments, run_experiment, unfinished_parts
from lipmotion.cli.arguments.paths import add_output

if TYPE_CHECKING:
    from lipmotion.corpora.store import Corpus
    from lipmotion.experiments.runner import ExperimentSettings


def add(actions: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the experiment to ``lipmotion experiment``."""
    parser = actions.add_parser("minnis2000", help="unit selection as Minnis & Breen 2000 print it, and each addition")
    kept = "keep the model there, so that a run that was stopped goes on and a second one does not train"
    add_output(parser, "--models", is_folder=True, metavar="FOLDER", help=kept)
    add_experiment_arguments(parser, quick="few epochs; the model is not kept")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``experiment.minnis2000`` and print its table; with ``--output``, a second run goes on where one stopped."""
    from lipmotion.experiments.minnis_breen2000.minnis2000 import minnis2000
    from lipmotion.experiments.minnis_breen2000.text import table

    def experiment(corpus: Corpus, settings: ExperimentSettings) -> dict[str, Any]:
        with unfinished_parts(options) as work:
            return minnis2000(corpus, models=options.models, quick=options.quick, work=work, settings=settings)

    run_experiment(options, experiment, table)
