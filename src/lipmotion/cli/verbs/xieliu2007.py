"""``lipmotion experiment xieliu2007``: Table 3 of Xie & Liu 2007, on a corpus."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from lipmotion.cli.arguments.experiment_options import add_experiment_arguments, run_experiment, unfinished_parts
from lipmotion.cli.arguments.options import list_or_all, numbers
from lipmotion.cli.arguments.paths import add_input, add_output

if TYPE_CHECKING:
    from lipmotion.corpora.store import Corpus
    from lipmotion.experiments.runner import ExperimentSettings


def add(actions: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the experiment to ``lipmotion experiment``."""
    parser = actions.add_parser(
        "xieliu2007",
        help="which structure of chains predicts lips best, as printed and tuned (Xie & Liu 2007, Table 3)",
    )
    parser.add_argument("--split", default="test", help="compare on test, or another list (default: test)")
    order = "names of recordings, one per line (default: train, shuffled)"
    add_input(parser, "--order", what="list", replaceable=True, metavar="FILE", help=order)
    parser.add_argument(
        "--sizes", type=numbers, metavar="N,N,...", help="numbers of recordings to train on (default: all)"
    )
    systems = "these systems, separated by semicolons (default: those of the paper, and baselines)"
    parser.add_argument("--systems", type=lambda text: text.split(";"), metavar="NAME;NAME", help=systems)
    parser.add_argument("--visual", default="geometry", metavar="KIND", help="geometry, eigenlips or both")
    parser.add_argument("--transcripts", action="store_true", help="compare also with known transcripts")
    parser.add_argument("--noise", default="", metavar="KIND,KIND", help="compare also in noise: white, babble")
    parser.add_argument(
        "--snr",
        type=numbers,
        default=[20, 10, 5, 0],
        metavar="DB,...",
        help="signal-to-noise ratios (default: 20,10,5,0)",
    )
    talkers = "recordings of other people, for the babble"
    add_input(parser, "--talkers", what="folder of recordings", metavar="FOLDER", help=talkers)
    add_output(parser, "--plots", metavar="FOLDER", help="write pictures like Figs. 7, 10 and 11 there")
    add_experiment_arguments(parser, quick="the paper's systems, four of them also tuned; not with --order")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``experiment.xieliu2007`` and print its table."""
    from lipmotion.corpora.splits import read_names
    from lipmotion.errors import InputError
    from lipmotion.experiments.noise import NoiseConditions, read_talkers
    from lipmotion.experiments.xie_liu2007.six_systems import DEFAULT_OPTIONS, QUICK, xieliu2007
    from lipmotion.experiments.xie_liu2007.text import table

    if options.quick and options.order:
        raise InputError("--quick takes recordings of its own, and --order is a list of others; leave out one of them")

    def experiment(corpus: Corpus, settings: ExperimentSettings) -> dict[str, Any]:
        kinds = tuple(kind for kind in options.noise.split(",") if kind)
        talkers = tuple(read_talkers(options.talkers)) if options.talkers else ()
        few = QUICK if options.quick else DEFAULT_OPTIONS
        compared = replace(
            few,
            systems=options.systems or few.systems,
            visual=options.visual,
            transcripts=options.transcripts,
            noise=NoiseConditions(kinds, tuple(map(float, options.snr)), talkers),
        )
        with unfinished_parts(options) as work:
            return xieliu2007(
                corpus,
                compared,
                split=list_or_all(options.split),
                order=read_names(options.order) if options.order else None,
                sizes=options.sizes,
                plots=options.plots,
                work=work,
                settings=settings,
            )

    run_experiment(options, experiment, table)
