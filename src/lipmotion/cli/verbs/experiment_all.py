"""``lipmotion experiment all``: all experiments on a corpus, and one page of what they found."""

from __future__ import annotations

import argparse
from typing import Any

from lipmotion.cli.arguments.declared import add_options
from lipmotion.cli.arguments.options import add_execution, worker_count
from lipmotion.cli.arguments.paths import add_input, add_output
from lipmotion.pipeline.job import Request
from lipmotion.printable import printable


def add(actions: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the experiment to ``lipmotion experiment``."""
    parser = actions.add_parser("all", help="the papers' experiments and ours, and one page of what they found")
    add_input(parser, "corpus", what="corpus")
    report = "folder of the report; run it again to go on after a stop"
    add_output(parser, "-o", "--output", is_folder=True, required=True, metavar="REPORT", help=report)
    only = "these alone: hofer2008, xieliu2007, minnis2000, engines, learning-curve, folds (default: all)"
    parser.add_argument("--only", type=lambda text: text.split(","), metavar="NAME,NAME", help=only)
    parser.add_argument("--quick", action="store_true", help="20 recordings, small models: see that it runs")
    add_options(parser, Request, "lexicon")
    add_execution(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``experiment_report``; print what was found, and the page. Raises the error of an experiment that failed."""
    from lipmotion.cli.terminal.progress import reporting
    from lipmotion.corpora.store import Corpus
    from lipmotion.experiments.report.report import experiment_report, told
    from lipmotion.experiments.runner import ExperimentSettings
    from lipmotion.units import Lexicon

    with reporting(options) as report:
        lexicon = Lexicon.from_file(options.lexicon) if options.lexicon else None
        settings = ExperimentSettings(lexicon=lexicon, workers=worker_count(options), monitor=report.receive)
        found = experiment_report(
            Corpus.open(options.corpus), options.output, only=options.only, quick=options.quick, settings=settings
        )
        lines = [f"{name}: {verdict}" for name, verdict in found.verdicts.items()]
        lines += [f"{name}: {reason}" for name, reason in found.left_out.items()]
        lines += [f"{name}: failed: {told(error)}" for name, error in found.failed.items()]
        is_done = not (found.made or found.failed)
        lines.append(f"{'nothing was left to do; ' if is_done else ''}report: {found.page}")
        figures: dict[str, Any] = {"report": str(found.page), "verdicts": dict(found.verdicts)}
        figures |= {"left_out": dict(found.left_out), "made": list(found.made)}
        if not (found.failed and options.machine_readable):  # the last event is that of the failure
            report.finish("\n".join(map(printable, lines)), **figures)
        if found.failed:
            raise next(iter(found.failed.values()))
