"""``lipmotion animate``: generate lip motion from speech, as motion files and videos."""

from __future__ import annotations

import argparse
import sys

from lipmotion.cli.arguments.declared import (
    add_job_file,
    add_options,
    add_outputs,
    add_pipe_format,
    is_pipe,
    pick_part,
    read_pipe,
    write_pipe,
)
from lipmotion.cli.arguments.options import add_execution, count_workers
from lipmotion.cli.terminal.printing import print_error
from lipmotion.cli.terminal.progress import report_progress
from lipmotion.pipeline.job import run as run_job
from lipmotion.pipeline.request import Request
from lipmotion.printable import printable


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = verbs.add_parser("animate", help="turn speech into lip motion or an animated face")
    add_options(parser, Request)
    add_outputs(parser, "FILE.mp4 .webm .mov %%05d.png .json .csv .vtt, ... (docs/formats.md); -")
    for add_more in (add_job_file, add_pipe_format, add_execution):
        add_more(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Run the job of a recording; print the paths that were written."""
    with report_progress(options) as report:
        piped = is_pipe(options.speech)
        with read_pipe(options.speech) as speech, write_pipe(options) as (files, pipe):
            job = pick_part(options, options.start).of(speech, files)
            done = run_job(job, temporary=piped, workers=count_workers(options), monitor=report.receive)
        written = [] if pipe else list(files)
        report.finish("\n".join(map(printable, written)), files=written)
    note = done.outlook.text if done.outlook is not None else ""
    if note and not options.machine_readable and sys.stderr is not None and sys.stderr.isatty():
        print_error(note)
