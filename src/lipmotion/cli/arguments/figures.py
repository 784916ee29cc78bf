"""Figures that a verb computes: their options, their file and their table."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lipmotion.cli.arguments.declared import add_options
from lipmotion.cli.arguments.options import add_machine_readable, add_workers, worker_count
from lipmotion.cli.arguments.paths import add_input, add_output
from lipmotion.pipeline.job import Request

if TYPE_CHECKING:
    from lipmotion.corpora.store import Corpus
    from lipmotion.experiments.runner import ExperimentSettings
    from lipmotion.types import Monitor
    from lipmotion.units import Lexicon


def add_experiment_arguments(parser: argparse.ArgumentParser, *, quick: str = "") -> None:
    """Add the corpus, ``--workers``, and the options of ``add_figures_arguments``.

    quick : what is small with ``--quick``, beside the recordings; without it there is no such option
    """
    add_input(parser, "corpus", what="corpus")
    if quick:
        help_text = f"see that it runs: 20 recordings to train on, at most 6 to compare, {quick}"
        parser.add_argument("--quick", action="store_true", help=help_text)
    add_workers(parser)
    add_figures_arguments(parser)


def run_experiment(
    options: argparse.Namespace,
    experiment: Callable[[Corpus, ExperimentSettings], dict[str, Any]],
    table: Callable[[dict[str, Any]], str],
) -> None:
    """Call ``experiment(corpus, settings)``, print its table, and give its figures with their stamp.

    With ``--quick`` the corpus is ``runner.quick_part``, the same recordings for all experiments.
    """
    from lipmotion.corpora.store import Corpus
    from lipmotion.experiments.runner import ExperimentSettings, quick_part
    from lipmotion.experiments.stamp import Stamp

    def compute(lexicon: Lexicon | None, monitor: Monitor) -> dict[str, Any]:
        stamp = Stamp()
        settings = ExperimentSettings(lexicon=lexicon, workers=worker_count(options), monitor=monitor)
        corpus = Corpus.open(options.corpus)
        if getattr(options, "quick", False):
            corpus = quick_part(corpus, settings.seed)
        figures = experiment(corpus, settings)
        return {"stamp": stamp.content(["lipmotion", *options.words], corpus, settings)} | figures

    report_figures(options, compute, table)


def unfinished_parts(options: argparse.Namespace) -> AbstractContextManager[Path | None]:
    """Return the folder of finished parts, from which a second run of an experiment goes on; None without an output."""
    from lipmotion.storage.files import unfinished_work

    return unfinished_work(options.output) if options.output else nullcontext()


Figures = dict[str, Any]


def add_figures_arguments(parser: argparse.ArgumentParser, *, lexicon: bool = True) -> None:
    """Add ``--output`` and ``--machine-readable``; and ``--lexicon``, unless it is not wanted."""
    if lexicon:
        add_options(parser, Request, "lexicon")
    add_output(parser, "-o", "--output", force=True, metavar="FILE.json", help="also write all figures to this file")
    add_machine_readable(parser)


def report_figures(
    options: argparse.Namespace,
    compute: Callable[[Lexicon | None, Monitor], Figures],
    table: Callable[[Figures], str],
) -> None:
    """Call ``compute(lexicon, monitor)``, write its figures, and print their table."""
    from lipmotion.cli.terminal.progress import reporting
    from lipmotion.storage.files import check_target, whole_file
    from lipmotion.storage.json_text import as_json, nan_as_null
    from lipmotion.units import Lexicon

    with reporting(options) as report:
        if options.output:
            check_target(options.output)
        file = getattr(options, "lexicon", None)
        figures = compute(Lexicon.from_file(file) if file else None, report.receive)
        if options.output:
            with whole_file(options.output) as unfinished:
                unfinished.write_text(as_json(nan_as_null(figures), indent=1) + "\n")
        report.finish(table(figures), figures=figures)
