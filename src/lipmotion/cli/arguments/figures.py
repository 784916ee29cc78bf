"""Figures that a verb computes: their options, their file and their table."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from lipmotion.cli.arguments.declared import add_options
from lipmotion.cli.arguments.options import add_machine_readable
from lipmotion.cli.arguments.paths import add_output
from lipmotion.pipeline.request import Request

if TYPE_CHECKING:
    from lipmotion.types import Monitor
    from lipmotion.units import Lexicon


Figures = dict[str, Any]


def add_figures_arguments(parser: argparse.ArgumentParser, *, lexicon: bool = True) -> None:
    """Add ``--output`` and ``--machine-readable``; and ``--lexicon``, unless it is not wanted."""
    if lexicon:
        add_options(parser, Request, "lexicon")
    add_output(parser, "-o", "--output", force=True, metavar="FILE.json", help="also write all figures to this file")
    add_machine_readable(parser)


def report_figures(
    options: argparse.Namespace, compute: Callable[[Lexicon | None, Monitor], Figures], table: Callable[[Figures], str]
) -> None:
    """Call ``compute(lexicon, monitor)``, write its figures, and print their table."""
    from lipmotion.cli.terminal.progress import report_progress
    from lipmotion.storage.files import atomic_file, check_target
    from lipmotion.storage.json_text import as_json, nan_as_null
    from lipmotion.units import Lexicon

    with report_progress(options) as report:
        if options.output:
            check_target(options.output)
        file = getattr(options, "lexicon", None)
        figures = compute(Lexicon.from_file(file) if file else None, report.receive)
        if options.output:
            with atomic_file(options.output) as unfinished:
                unfinished.write_text(as_json(nan_as_null(figures), indent=1) + "\n")
        report.finish(table(figures), figures=figures)
