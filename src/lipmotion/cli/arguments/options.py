"""Arguments of verbs from tables, options that several verbs have, and figures that a verb computes."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lipmotion.cli.arguments.declared import add_input, add_options, add_output, is_pipe
from lipmotion.cli.terminal.printing import print_line, print_lines
from lipmotion.cli.terminal.progress import Report, describe_outcome, report_progress
from lipmotion.errors import InputError, LipMotionError
from lipmotion.extensions import find_version
from lipmotion.pipeline.job import Job, check_outputs, is_for_several, list_recordings, open_face, plan_outputs, run
from lipmotion.pipeline.request import Request
from lipmotion.printable import printable
from lipmotion.storage.files import atomic_file, check_target, create_folders
from lipmotion.storage.json_text import as_json, replace_nan
from lipmotion.storage.sources import read_shipped_table
from lipmotion.types.progress import Item, Monitor, sub_monitor

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


KINDS: dict[str, dict[str, Any]] = {
    **{kind: {"action": action} for kind, action in {"flag": "store_true", "off": "store_false"}.items()},
    **{kind: {"nargs": sign} for kind, sign in {"optional": "?", "any": "*", "many": "+"}.items()},
    "append": {"action": "append"},
    "repeated": {"action": "append", "default": []},
    "whole": {"type": int},
    "number": {"type": float},
    "numbers": {"type": numbers},
    "word": {"type": str},
    "text": {"type": str, "default": ""},
    "names": {"type": lambda text: text.split(",")},
    "systems": {"type": lambda text: text.split(";")},
    **{name: {name: True} for name in ("required", "force", "keeps_work", "replaceable")},
}
"""Kinds of arguments in tables, and what they mean for ``add_argument``, ``add_input`` and ``add_output``."""


def add_verb(
    verbs: argparse._SubParsersAction[argparse.ArgumentParser], package: str, verb: str, run: Callable[..., None]
) -> argparse.ArgumentParser:
    """Return the parser of a verb, or of an action of one, with what ``arguments.csv`` of a package lists.

    Its help stands in the row without a name.
    """
    rows = read_shipped_table(package, "arguments.csv")
    text = next(row["help"] for row in rows if row["verb"] == verb and not row["name"])
    parser = verbs.add_parser(verb.rpartition(" ")[2], help=text)
    add_arguments(parser, package, verb)
    parser.set_defaults(run=run)
    return parser


def add_arguments(parser: argparse.ArgumentParser, package: str, verb: str) -> None:
    """Add the arguments of a verb, as ``arguments.csv`` of a package lists them.

    A row may say what input it names (``reads``, a noun), or that it names a file or a folder to be written. Its kind
    has words of ``KINDS``, or the values that are allowed, as ``rest|natural``.
    """
    for row in read_shipped_table(package, "arguments.csv"):
        if row["verb"] != verb or not row["name"]:
            continue
        given: dict[str, Any] = {name: row[name] for name in ("metavar", "default", "dest", "help") if row[name]}
        for kind in row["kind"].split():
            given |= KINDS[kind] if kind in KINDS else {"choices": kind.split("|")}
        if row["reads"]:
            add_input(parser, *row["name"].split(), what=row["reads"], **given)
        elif row["writes"]:
            add_output(parser, *row["name"].split(), is_folder=row["writes"] == "folder", **given)
        else:
            parser.add_argument(*row["name"].split(), **given)


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


def animate_one_by_one(job: Job, paths: Sequence[Path], options: argparse.Namespace, report: Report) -> bool:
    """Run a job for each of several recordings, or for all of a folder, or where the output is a folder.

    Each recording is reported; at the end the paths that were written are printed. The words and phones in files beside
    the recordings are used, as a corpus and a batch use them. Faces and characters are opened once.
    Returns False, and does nothing, where there is one recording and its outputs are files.
    Raises ExportError: outputs that are not for several recordings, or that clash.
    Raises InputError: a transcript, units or edits, which belong to one recording; or a pipe.
    Raises the error of the highest exit code among those that occurred, with the number of recordings that failed.
    """
    from lipmotion.pipeline.model import load_model

    if len(paths) == 1 and not (paths[0].is_dir() or any(map(is_for_several, job.outputs.files))):
        return False
    if piped := next(filter(is_pipe, paths), None):
        raise InputError(f"{piped}: what comes through a pipe has no name; give it alone: -o FILE.json")
    recordings = list_recordings(paths)
    alone = {name: getattr(job.request, name) for name in ("transcript", "units", "edits")}
    for name, value in alone.items():
        if value is not None and len(recordings) > 1:
            raise InputError(f"--{name} belongs to one recording, and there are {len(recordings)}; animate each alone")
    planned = plan_outputs(recordings, job.outputs.files, job.outputs.kinds)
    face = open_face(job.outputs)
    jobs = [job.of(recording, tuple(files)) for recording, files in zip(recordings, planned, strict=True)]
    with create_folders({Path(file).parent for files in planned for file in files}):
        for one, recording in zip(jobs, recordings, strict=True):
            check_outputs(one, face, recording)
    model = load_model(job.request.model)
    written: list[str] = []
    failures: list[tuple[int, str, Exception]] = []
    for number, each in enumerate(jobs):
        name = str(each.request.recording)
        part = sub_monitor(report.receive, number / len(jobs), (number + 1) / len(jobs))
        try:
            run(each, face=face, model=model, words_beside=True, workers=count_workers(options), monitor=part)
            written += each.outputs.files
            report.receive(Item(name, "animated"))
        except Exception as error:
            known = describe_outcome(error)
            if known is None:
                raise
            failures.append((known[0], name, error))
            report.receive(Item(name, "skipped", known[1]))
    if not failures:
        report.finish("\n".join(map(printable, written)), files=written)
        return True
    if written and not options.machine_readable:
        print_lines("\n".join(map(printable, written)))
    _, speech, worst = max(failures, key=lambda failure: failure[0])
    kind = type(worst) if isinstance(worst, LipMotionError) else LipMotionError
    raise kind(f"{len(failures)} of {len(jobs)} recordings were not animated, {speech} for one") from worst
