"""``lipmotion compare``, ``evaluate`` and ``league``: figures of motion, of a model, of rivals."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from lipmotion.cli.arguments.declared import add_input, add_options
from lipmotion.cli.arguments.options import (
    add_figures_arguments,
    add_machine_readable,
    add_verb,
    list_or_all,
    report_figures,
)
from lipmotion.pipeline.request import Request

ADAPTERS = "LIPMOTION_LEAGUE"  # variable of the environment: the folder of adapters


def add_compare(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = add_verb(verbs, __package__, "compare", run_compare)
    what = "motion file (.json .csv .npz, or another that can be read), or video of a face"
    add_input(parser, "reference", what="recording", help=what)
    add_input(parser, "others", what="recording", nargs="+", metavar="OTHER", help="the same, compared with it")
    add_figures_arguments(parser, lexicon=False)


def run_compare(options: argparse.Namespace) -> None:
    """Call ``lipmotion.compare`` and print its figures."""
    from lipmotion_lab.compare import compare
    from lipmotion_lab.evaluation.table import format_comparison

    report_figures(
        options, lambda _, monitor: compare(options.reference, *options.others, monitor=monitor), format_comparison
    )


def add_evaluate(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = add_verb(verbs, __package__, "evaluate", run_evaluate)
    add_options(parser, Request, "recogniser")
    add_figures_arguments(parser)


def run_evaluate(options: argparse.Namespace) -> None:
    """Call ``lipmotion.evaluate`` and print its figures."""
    from lipmotion.corpora import Corpus, Selection
    from lipmotion.pipeline.model import load_model
    from lipmotion_lab.evaluation.evaluate import evaluate
    from lipmotion_lab.evaluation.table import format_figures

    report_figures(
        options,
        lambda lexicon, monitor: evaluate(
            load_model(options.model),
            Corpus.open(options.corpus),
            selection=Selection(list_or_all(options.split), tuple(options.speaker)),
            lexicon=lexicon,
            recogniser=options.recogniser,
            monitor=monitor,
        ),
        format_figures,
    )


def add_league(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = add_verb(verbs, __package__, "league", run_league)
    where = f"folder of adapters, extras/league of the sources (default: that of {ADAPTERS})"
    add_input(
        parser, "--adapters", what="folder of adapters", default=os.environ.get(ADAPTERS, "extras/league"), help=where
    )
    add_machine_readable(parser)


def run_league(options: argparse.Namespace) -> None:
    """Call ``run_rivals``, write its page, and print its table."""
    from lipmotion.cli.terminal.progress import report_progress
    from lipmotion.corpora import Corpus
    from lipmotion.storage.locks import lock_folder
    from lipmotion_lab.league import describe_league, read_rivals, run_rivals, write_league

    corpus, choosing = Corpus.open(options.recordings), options.choose and Corpus.open(options.choose)
    read_rivals(Path(options.adapters), options.only)  # no folder is made for what cannot be run
    with report_progress(options) as report, lock_folder(options.output):
        league = run_rivals(
            corpus,
            Path(options.adapters),
            options.output / "work",
            choosing=choosing,
            only=options.only,
            sync_s=options.sync / 1000,
            limit_s=options.limit,
            monitor=report.receive,
        )
        figures = write_league(league, options.output)
        report.finish(describe_league(league).as_text(), figures=figures)
