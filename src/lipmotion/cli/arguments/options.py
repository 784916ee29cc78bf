"""Options that several verbs have, and figures that a verb computes."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from lipmotion.cli.arguments.declared import add_options, add_output
from lipmotion.cli.terminal.printing import print_line
from lipmotion.cli.terminal.progress import report_progress
from lipmotion.extensions import find_version
from lipmotion.pipeline.request import Request
from lipmotion.storage.files import atomic_file, check_target
from lipmotion.storage.json_text import as_json, replace_nan
from lipmotion.types.progress import Monitor

if TYPE_CHECKING:
    from lipmotion.units import Lexicon


class Version(argparse.Action):
    """Prints the version, and a text behind it; it is looked up only when the option is given."""

    def __call__(self, *_: object) -> None:  # noqa: D102
        print_line(f"lipmotion {find_version()}{self.const or ''}")
        sys.exit(0)


def add_machine_readable(parser: argparse.ArgumentParser) -> None:
    """Add ``--machine-readable`` (docs/long-work.md)."""
    parser.add_argument("--machine-readable", action="store_true", help="print only JSON objects, one per line")


def add_workers(parser: argparse.ArgumentParser) -> None:
    """Add ``--workers``."""
    parser.add_argument("--workers", type=int, help="number of processes (default: one per core)")


def add_execution(parser: argparse.ArgumentParser) -> None:
    """Add ``--workers`` and ``--machine-readable``."""
    add_workers(parser)
    add_machine_readable(parser)


def count_workers(options: argparse.Namespace) -> int:
    """Return the number of processes of ``--workers``; by default, that of the processor's cores."""
    from lipmotion.pipeline.workers import process_count

    return process_count(options.workers)


def list_or_all(split: str) -> str | None:
    """Return the name of the list that ``--split`` selects; None: all recordings."""
    return None if split == "all" else split


def numbers(text: str) -> list[int]:
    """Return the whole numbers of a text like ``1,2,4``. Raises ArgumentTypeError: not such a text."""
    try:
        return [int(part) for part in text.split(",")]
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r}; required: numbers with commas between them") from error


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
    from lipmotion.units import Lexicon

    with report_progress(options) as report:
        if options.output:
            check_target(options.output)
        file = getattr(options, "lexicon", None)
        figures = compute(Lexicon.from_file(file) if file else None, report.receive)
        if options.output:
            with atomic_file(options.output) as unfinished:
                unfinished.write_text(as_json(replace_nan(figures), indent=1) + "\n", encoding="utf-8")
        report.finish(table(figures), figures=figures)
