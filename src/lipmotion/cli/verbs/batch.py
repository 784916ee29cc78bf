"""``lipmotion batch``: many recordings to motion files, videos or cues, with a report."""

from __future__ import annotations

import argparse
from typing import Any

from lipmotion.cli.arguments.declared import add_detail, add_job_file, add_options, pick_part
from lipmotion.cli.arguments.options import add_machine_readable, add_verb
from lipmotion.cli.terminal.progress import report_progress
from lipmotion.errors import InputError
from lipmotion.pipeline.request import Outputs, Request
from lipmotion.printable import printable
from lipmotion.types.delivery import Delivery, Staging
from lipmotion.types.progress import Item


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = add_verb(verbs, __package__, "batch", run)
    kinds = "what animate writes (json csv glb mp4 ...) and cues.tsv .xml .json .dat .pgo .spine.json (default: json)"
    add_options(parser, Outputs, "kinds", kinds={"help": kinds})
    add_options(parser, Request, "recogniser", "model", "lexicon", "language", "speaker", "pauses", "asymmetry")
    changed: dict[str, Any] = {
        "rate_hz": {"help": "rate of motion files (default: --fps, or 100)"},
        "fps": {"help": "frames per second of videos (default: 25) and of cues (24)"},
        "background": {"metavar": "COLOUR", "help": "of that face: transparent, or as #40a0ff"},
    }
    add_options(
        parser, Outputs, "rate_hz", "fps", "channels", "curves", "articulation", "face", "background", **changed
    )
    add_options(parser, Staging)
    add_options(parser, Delivery)
    add_detail(parser)
    add_job_file(parser)
    add_machine_readable(parser)


def run(options: argparse.Namespace) -> None:
    """Call ``batch`` or, with ``--check``, ``check``; print what was done. Raises InputError: some lines failed."""
    from lipmotion.pipeline.batch import batch, check

    with report_progress(options) as report:
        job, monitor = pick_part(options, options.start), report.receive
        if options.check:
            checked = check(options.source, job, jobs=options.jobs, monitor=monitor)
            if not checked.findings:
                report.finish(printable(checked.text), lines=checked.lines)
                return
            if not options.machine_readable:
                report.finish(checked.table)
            for each in checked.findings if options.machine_readable else ():
                report.receive(Item(each.name, each.kind, each.text))
            raise InputError(checked.text)
        if options.out is None:
            raise InputError("no folder of the outputs is given; add --out DIR, or --check to write nothing")
        how = {"jobs": options.jobs, "cluster": options.cluster, "marks": options.marks}
        done = batch(options.source, options.out, job, monitor=monitor, **how)
        if done.failed:
            raise InputError(f"{done.text}; the reasons are in {done.csv}; mend them and run the same command again")
        figures = {"done": done.done, "kept": done.kept, "report": [str(done.csv), str(done.html)]}
        report.finish(printable(f"{done.text}; report: {done.html}"), **figures)
