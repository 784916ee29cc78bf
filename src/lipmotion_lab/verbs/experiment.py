"""``lipmotion experiment``: train and compare systems on a corpus."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from lipmotion.cli.arguments.declared import add_input, add_options
from lipmotion.cli.arguments.options import (
    add_arguments,
    add_execution,
    add_figures_arguments,
    add_workers,
    count_workers,
    list_or_all,
    report_figures,
)
from lipmotion.pipeline.request import Request
from lipmotion.printable import printable

if TYPE_CHECKING:
    from lipmotion.corpora import Corpus
    from lipmotion.types import Monitor
    from lipmotion.units import Lexicon
    from lipmotion_lab.runner import ExperimentSettings


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb and its experiments to the parser of the command line."""
    parser = verbs.add_parser("experiment", help="train and compare systems on a corpus, as in the papers")
    actions = parser.add_subparsers(title="experiments", required=True, metavar="EXPERIMENT")
    for name, (run_one, text) in EXPERIMENTS.items():
        action = actions.add_parser(name, help=text)
        add_arguments(action, __package__, name)
        add_input(action, "corpus", what="corpus")
        add_workers(action)
        add_figures_arguments(action)
        action.set_defaults(run=run_one)
    action = actions.add_parser("all", help="the papers' experiments and ours, and one page of what they found")
    add_arguments(action, __package__, "all")
    add_options(action, Request, "lexicon")
    add_execution(action)
    action.set_defaults(run=run_all)


def run_experiment(
    options: argparse.Namespace,
    experiment: Callable[..., dict[str, Any]],
    name: str,
    *,
    has_parts: bool = True,
    references: Sequence[str] = (),
) -> None:
    """Call ``experiment(corpus, work=…, settings=…)``, print what a report says of it, and give its figures.

    name : of the part of a report
    references : the systems that the others are compared with in ``--blocks``
    ``work`` is a folder of finished parts, from which a second run goes on; None without an output, and not
    ``has_parts``. With ``--quick`` the corpus is ``runner.take_quick_part``, the same recordings for all experiments.
    """
    from lipmotion.corpora import Corpus
    from lipmotion.storage.locks import keep_unfinished
    from lipmotion_lab.folds import cross_validate_blocks
    from lipmotion_lab.report.report import PARTS
    from lipmotion_lab.report.sections import build_blocks_section
    from lipmotion_lab.runner import ExperimentSettings, Stamp, take_quick_part

    blocks = getattr(options, "blocks", None)
    if blocks is not None:
        words = " ".join(map(str, options.words))
        experiment = partial(cross_validate_blocks, experiment, references=references, count=blocks, key=words)

    def compute(lexicon: Lexicon | None, monitor: Monitor) -> dict[str, Any]:
        stamp = Stamp()
        settings = ExperimentSettings(lexicon=lexicon, workers=count_workers(options), monitor=monitor)
        corpus = Corpus.open(options.corpus)
        if getattr(options, "quick", False):
            corpus = take_quick_part(corpus, settings.seed)
        with keep_unfinished(options.output) if options.output and has_parts else nullcontext() as work:
            figures = experiment(corpus, work=work, settings=settings)
        return {"stamp": stamp.collect(["lipmotion", *options.words], corpus, settings)} | figures

    section = PARTS[name].section if blocks is None else build_blocks_section
    report_figures(options, compute, lambda figures: section(figures).as_text())


def _run_hofer2008(options: argparse.Namespace) -> None:
    from lipmotion_lab.hofer2008 import FULL, QUICK, REFERENCE_SET, run_hofer2008

    usual = QUICK if options.quick else FULL
    chosen = replace(usual, channels=options.channels.replace(",", " "), states=options.states or usual.states)
    references = [f"{REFERENCE_SET}, {states} states" for states in chosen.states]
    experiment = partial(run_hofer2008, options=chosen, split=list_or_all(options.split))
    run_experiment(options, experiment, "hofer2008", references=references)


def _run_learning_curve(options: argparse.Namespace) -> None:
    from lipmotion_faces.corpus.source_recordings import read_names
    from lipmotion_lab.learning_curve import run_learning_curve

    def run(corpus: Corpus, **others: Any) -> dict[str, Any]:
        order = read_names(options.order) if options.order else None
        split, rival = list_or_all(options.split), options.rival
        return run_learning_curve(corpus, order=order, sizes=options.sizes, split=split, rival=rival, **others)

    run_experiment(options, run, "learning-curve")


def _run_folds(options: argparse.Namespace) -> None:
    from lipmotion_lab.folds import cross_validate

    run_experiment(options, partial(cross_validate, count=options.folds, by_speaker=options.by_speaker), "folds")


def _run_xieliu2007(options: argparse.Namespace) -> None:
    from lipmotion.errors import InputError
    from lipmotion.pipeline.training.other_speakers import synthesise_others
    from lipmotion_faces.corpus.source_recordings import read_names
    from lipmotion_lab.xie_liu2007.six_systems import DEFAULT_OPTIONS, QUICK, run_xieliu2007
    from lipmotion_lab.xie_liu2007.systems import BLSTM, REFERENCE_SYSTEM

    if options.quick and options.order:
        raise InputError("--quick takes recordings of its own, and --order is a list of others; leave out one of them")
    if options.blocks and (options.order or options.sizes or options.plots or options.visual != "geometry"):
        raise InputError("--blocks trains on all other blocks, by channels that all have; leave out other options")

    def run(corpus: Corpus, **others: Any) -> dict[str, Any]:
        usual = QUICK if options.quick else DEFAULT_OPTIONS
        compared = replace(
            usual,
            systems=options.systems or usual.systems,
            visual=options.visual,
            transcripts=options.transcripts,
            voices=tuple(synthesise_others(synthetic=options.voices, recordings=options.recordings)),
        )
        order = read_names(options.order) if options.order else None
        split, sizes, plots = list_or_all(options.split), options.sizes, options.plots
        return run_xieliu2007(corpus, compared, split=split, order=order, sizes=sizes, plots=plots, **others)

    run_experiment(options, run, "xieliu2007", references=(REFERENCE_SYSTEM, "ph-HMM", BLSTM))


def _run_minnis2000(options: argparse.Namespace) -> None:
    from lipmotion_lab.minnis2000 import PRINTED, run_minnis2000

    chosen = {"models": options.models, "quick": options.quick, "guided": options.guided}
    run_experiment(options, partial(run_minnis2000, **chosen), "minnis2000", references=(PRINTED,))


def _run_engines(options: argparse.Namespace) -> None:
    from lipmotion_lab.engine_comparison import compare_engines

    def run(corpus: Corpus, *, settings: ExperimentSettings, work: None) -> dict[str, Any]:  # noqa: ARG001
        return compare_engines(corpus, split=list_or_all(options.split), models=options.models, settings=settings)

    run_experiment(options, run, "engines", has_parts=False)


EXPERIMENTS: dict[str, tuple[Callable[[argparse.Namespace], None], str]] = {
    "hofer2008": (_run_hofer2008, "which unit set predicts closings of the mouth, by the paper's own system (Table 1)"),
    "learning-curve": (_run_learning_curve, "quality of models trained on the first N recordings"),
    "folds": (_run_folds, "cross-validation: generate each part of the training list by a model of the others"),
    "xieliu2007": (
        _run_xieliu2007,
        "which structure of chains predicts lips best, as printed and chosen on val (Xie & Liu 2007, Table 3)",
    ),
    "minnis2000": (_run_minnis2000, "unit selection as Minnis & Breen 2000 print it, and each addition"),
    "engines": (_run_engines, "all engines in one table"),
}
"""What each experiment runs, and what it finds; its arguments stand in ``arguments.csv``."""


def run_all(options: argparse.Namespace) -> None:
    """Call ``write_report``; print what was found, and the page. Raises the error of an experiment that failed."""
    from lipmotion.cli.terminal.progress import report_progress
    from lipmotion.corpora import Corpus
    from lipmotion.units import Lexicon
    from lipmotion_lab.report.report import describe_error, write_report
    from lipmotion_lab.runner import ExperimentSettings

    with report_progress(options) as report:
        lexicon = Lexicon.from_file(options.lexicon) if options.lexicon else None
        settings = ExperimentSettings(lexicon=lexicon, workers=count_workers(options), monitor=report.receive)
        result = write_report(
            Corpus.open(options.corpus), options.output, only=options.only, quick=options.quick, settings=settings
        )
        lines = [f"{name}: {verdict}" for name, verdict in result.verdicts.items()]
        lines += [f"{name}: {reason}" for name, reason in result.left_out.items()]
        lines += [f"{name}: failed: {describe_error(error)}" for name, error in result.failed.items()]
        is_done = not (result.made or result.failed)
        lines.append(f"{'nothing was left to do; ' if is_done else ''}report: {result.page}")
        figures: dict[str, Any] = {"report": str(result.page), "verdicts": dict(result.verdicts)}
        figures |= {"left_out": dict(result.left_out), "made": list(result.made)}
        if not (result.failed and options.machine_readable):  # the last event is that of the failure
            report.finish("\n".join(map(printable, lines)), **figures)
        if result.failed:
            raise next(iter(result.failed.values()))
