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
from lipmotion.cli.arguments.options import add_execution, add_verb, animate_one_by_one, count_workers
from lipmotion.cli.terminal.printing import print_error
from lipmotion.cli.terminal.progress import report_progress
from lipmotion.pipeline.job import run as run_job
from lipmotion.pipeline.request import Outputs, Request
from lipmotion.printable import printable


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = add_verb(verbs, __package__, "animate", run)
    many = {"nargs": "+", "help": "audio or video file, -: standard input; several, or a folder"}
    add_options(parser, Request, recording=many)
    add_outputs(parser, "FILE.mp4 .webm .mov %%05d.png .json .csv .vtt, ... (docs/formats.md); FOLDER/; -")
    add_options(parser, Outputs, "kinds")
    for add_more in (add_job_file, add_pipe_format, add_execution):
        add_more(parser)


def run(options: argparse.Namespace) -> None:
    """Run the job of each recording; print the paths that were written."""
    note = ""
    recordings = options.speech if isinstance(options.speech, list) else [options.speech]
    with report_progress(options) as report:
        request = pick_part(options, options.start.request, recording=recordings[0])
        job = pick_part(options, options.start, request=request)
        if animate_one_by_one(job, recordings, options, report):
            return
        piped = is_pipe(recordings[0])
        with read_pipe(recordings[0]) as speech, write_pipe(options) as (files, pipe):
            job = job.of(speech, files)
            done = run_job(job, temporary=piped, workers=count_workers(options), monitor=report.receive)
            note = done.outlook.text if done.outlook is not None else ""
        written = [] if pipe else list(files)
        report.finish("\n".join(map(printable, written)), files=written)
    if note and not options.machine_readable and sys.stderr is not None and sys.stderr.isatty():
        print_error(note)
