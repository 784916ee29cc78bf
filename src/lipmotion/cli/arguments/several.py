"""Several recordings in one command: each by itself; what fails does not stop the others."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from lipmotion.cli.arguments.pipes import is_pipe
from lipmotion.cli.terminal.outcome import outcome
from lipmotion.cli.terminal.output import print_lines
from lipmotion.printable import printable

if TYPE_CHECKING:
    from lipmotion.cli.terminal.progress import Report

KINDS = "json"


def add_kinds_argument(parser: argparse.ArgumentParser) -> None:
    """Add ``--to``: what is written into a folder of outputs."""
    help_text = "what is written into an output folder, as json,mp4 (default: json)"
    parser.add_argument("--to", default=KINDS, metavar="KIND,KIND", help=help_text)


def animated_one_by_one(
    options: argparse.Namespace, report: Report, animate_one: Callable[[argparse.Namespace, Report], object]
) -> bool:
    """Call a function for the options of each recording, if there are several or the output is a folder.

    Each recording is reported; at the end the paths that were written are printed.
    Returns False, and does nothing, where there is one recording and its outputs are files.
    Raises ExportError: outputs that are not for several recordings, or that clash.
    Raises InputError: a transcript, units or a picture of posteriors, which belong to one recording; or a pipe.
    Raises the error of the highest exit code among those that occurred, with the number of recordings that failed.
    """
    from lipmotion.errors import InputError
    from lipmotion.pipeline.understand.recordings import is_for_several, recordings_of

    if len(options.speech) == 1 and not (options.speech[0].is_dir() or any(map(is_for_several, options.output))):
        return False
    for speech in options.speech:
        if is_pipe(speech):
            raise InputError(
                f"{speech}: what comes through a pipe has no name for a file in a folder; animate it alone, with the "
                "name of a file: -o FILE.json"
            )
    _animate_each(_one_by_one(options, recordings_of(options.speech)), report, animate_one)
    return True


def _one_by_one(options: argparse.Namespace, recordings: Sequence[Path]) -> list[argparse.Namespace]:
    """Return the options of each recording, its outputs instead of folders and templates; make the folders.

    Words and phones in files beside a recording are used, where none are given, as a corpus and a batch use them.
    Faces and characters are opened once, for all recordings. What cannot be leaves no new folders.
    """
    from lipmotion.cli.arguments.results import check_results, open_faces
    from lipmotion.errors import InputError
    from lipmotion.pipeline.understand.recordings import planned_outputs
    from lipmotion.storage.files import made_folders

    for name in ("transcript", "units", "posteriors"):
        if getattr(options, name) is not None and len(recordings) > 1:
            raise InputError(f"--{name} belongs to one recording, and there are {len(recordings)}; animate each alone")
    planned = planned_outputs(recordings, options.output, options.to.split(","))
    open_faces(options)
    shared = {**vars(options), "words_beside": True}
    pairs = zip(recordings, planned, strict=True)
    jobs = [argparse.Namespace(**{**shared, "speech": speech, "output": files}) for speech, files in pairs]
    with made_folders({Path(file).parent for files in planned for file in files}):
        for job in jobs:
            check_results(job, job.speech)
    return jobs


def _animate_each(
    jobs: Sequence[argparse.Namespace], report: Report, animate_one: Callable[[argparse.Namespace, Report], object]
) -> None:
    from lipmotion.errors import LipMotionError
    from lipmotion.types.progress import Item

    written: list[str] = []
    failures: list[tuple[int, Path, Exception]] = []
    for number, job in enumerate(jobs):
        try:
            animate_one(job, _Part(report, number / len(jobs), (number + 1) / len(jobs)))
            written += job.output
            report.receive(Item(str(job.speech), "animated"))
        except Exception as error:
            known = outcome(error)
            if known is None:
                raise
            failures.append((known[0], job.speech, error))
            report.receive(Item(str(job.speech), "skipped", known[1]))
    if not failures:
        report.finish("\n".join(map(printable, written)), files=written)
        return
    if written and not jobs[0].machine_readable:
        print_lines("\n".join(map(printable, written)))
    _, speech, worst = max(failures, key=lambda failure: failure[0])
    kind = type(worst) if isinstance(worst, LipMotionError) else LipMotionError
    raise kind(f"{len(failures)} of {len(jobs)} recordings were not animated, {speech} for one") from worst


class _Part:
    """The report of one recording among several; its progress is a part of theirs, and the result comes at the end."""

    def __init__(self, report: Report, start: float, stop: float) -> None:
        from lipmotion.types.progress import sub_monitor

        self.receive = sub_monitor(report.receive, start, stop)
        self.warn = report.warn

    def finish(self, text: str, **figures: object) -> None:
        """Do nothing: the result is that of all recordings."""
