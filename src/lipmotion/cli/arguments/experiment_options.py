"""Arguments and execution that the experiments of ``lipmotion experiment`` have in common."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lipmotion.cli.arguments.figures import add_figures_arguments, report_figures
from lipmotion.cli.arguments.options import add_workers, worker_count
from lipmotion.cli.arguments.paths import add_input

if TYPE_CHECKING:
    from lipmotion.corpora.store import Corpus
    from lipmotion.experiments.runner import ExperimentSettings
    from lipmotion.types import Monitor
    from lipmotion.units import Lexicon


def add_experiment_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the corpus, ``--workers``, and the options of ``add_figures_arguments``."""
    add_input(parser, "corpus", what="corpus")
    add_workers(parser)
    add_figures_arguments(parser)


def run_experiment(
    options: argparse.Namespace,
    experiment: Callable[[Corpus, ExperimentSettings], dict[str, Any]],
    table: Callable[[dict[str, Any]], str],
) -> None:
    """Call ``experiment(corpus, settings)`` and print its table."""
    from lipmotion.corpora.store import Corpus
    from lipmotion.experiments.runner import ExperimentSettings

    def compute(lexicon: Lexicon | None, monitor: Monitor) -> dict[str, Any]:
        settings = ExperimentSettings(lexicon=lexicon, workers=worker_count(options), monitor=monitor)
        return experiment(Corpus.open(options.corpus), settings)

    report_figures(options, compute, table)


def unfinished_parts(options: argparse.Namespace) -> AbstractContextManager[Path | None]:
    """Return the folder of finished parts, from which a second run of an experiment goes on; None without an output."""
    from lipmotion.storage.files import unfinished_work

    return unfinished_work(options.output) if options.output else nullcontext()
