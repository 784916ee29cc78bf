"""``lipmotion experiment learning-curve``: quality of models over the amount of training data."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from lipmotion.cli.arguments.experiment_options import add_experiment_arguments, run_experiment, unfinished_parts
from lipmotion.cli.arguments.options import list_or_all, numbers
from lipmotion.cli.arguments.paths import add_input

if TYPE_CHECKING:
    from lipmotion.corpora.store import Corpus
    from lipmotion.experiments.runner import ExperimentSettings


def add(actions: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the experiment to ``lipmotion experiment``."""
    parser = actions.add_parser("learning-curve", help="quality of models trained on the first N recordings")
    order = "names of recordings, one per line (default: the training list, shuffled with seed 0)"
    add_input(parser, "--order", what="list", replaceable=True, metavar="FILE", help=order)
    sizes = "numbers of recordings to train on (default: 20,50,100,200 and all)"
    parser.add_argument("--sizes", type=numbers, metavar="N,N,...", help=sizes)
    parser.add_argument("--split", default="test", help="compare on val or test (default: test)")
    add_experiment_arguments(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``experiment.learning_curve``, print its table; with ``--output``, a second run goes on after a stop."""
    from lipmotion.corpora.splits import read_names
    from lipmotion.experiments.learning_curve import learning_curve, table

    def experiment(corpus: Corpus, settings: ExperimentSettings) -> dict[str, Any]:
        order = read_names(options.order) if options.order else None
        split = list_or_all(options.split)
        with unfinished_parts(options) as work:
            return learning_curve(corpus, order=order, sizes=options.sizes, split=split, work=work, settings=settings)

    run_experiment(options, experiment, table)
