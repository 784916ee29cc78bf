"""``lipmotion batch``: many recordings to motion files, videos or cues, with a report."""

from __future__ import annotations

import argparse
from pathlib import Path

from lipmotion.cli.arguments.delivery import add_delivery_arguments, delivery_of
from lipmotion.cli.arguments.options import add_machine_readable
from lipmotion.cli.arguments.paths import add_input, add_output
from lipmotion.cli.arguments.speech import add_recognition_arguments, style_of
from lipmotion.cli.arguments.staging import add_staging_arguments, staging_of
from lipmotion.printable import printable


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = verbs.add_parser("batch", help="turn thousands of recordings into lip motion, with a report")
    listed = "a folder of recordings, or a list: a path a line, or a table with columns file,transcript,output,speaker"
    add_input(parser, "source", what="list or folder of recordings", metavar="LIST|DIR", help=listed)
    add_output(parser, "--out", is_folder=True, required=True, metavar="DIR", help="folder of the outputs")
    kinds = "what animate writes (json csv livelink.csv glb mp4 ...) and cues.tsv .xml .json .dat (default: json)"
    parser.add_argument("--to", default="json", metavar="KIND,KIND", help=kinds)
    parser.add_argument("--jobs", type=int, metavar="N", help="number of processes (default: one per core)")
    parser.add_argument("--cluster", default="", metavar="ADDRESS", help="Dask scheduler, as tcp://HOST:8786")
    add_recognition_arguments(parser)
    parser.add_argument("--rate", type=float, metavar="HZ", help="rate of motion files (default: --fps, or 100)")
    parser.add_argument("--fps", type=float, help="frames per second of videos (default: 25) and of cues (24)")
    parser.add_argument("--channels", metavar="NAME,NAME", help="write only these to motion files: opening,width,...")
    curves = "what motion files hold: arkit, visemes, fap, or the controls of a rig (FILE.csv)"
    parser.add_argument("--curves", default="", metavar="SET", help=curves)
    articulation = "add tongue, lip_tuck, protrusion, spread, lip_press, teeth to motion files"
    parser.add_argument("--articulation", action="store_true", help=articulation)
    face = "face of videos: woman, man, cartoon, head, FILE.svg (default: portrait, the woman)"
    add_input(parser, "--face", what="face", type=str, default="portrait", metavar="NAME|FILE", help=face)
    parser.add_argument("--background", default="", metavar="COLOUR", help="of that face: transparent, or as #40a0ff")
    for add_arguments in (add_staging_arguments, add_delivery_arguments, add_machine_readable):
        add_arguments(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``batch``; print how many lines were done, and the report. Raises InputError: some lines failed."""
    from lipmotion.cli.arguments.results import rate_of
    from lipmotion.cli.terminal.progress import reporting
    from lipmotion.errors import InputError
    from lipmotion.pipeline.batch import BatchSettings, batch

    named = {
        name: getattr(options, name) or "" for name in ("recogniser", "speaker", "model", "lexicon", "face", "curves")
    }
    files = {name: str(Path(text).absolute()) if Path(text).is_file() else str(text) for name, text in named.items()}
    settings = BatchSettings(
        kinds=tuple(options.to.split(",")),
        channels=tuple(options.channels.split(",")) if options.channels else (),
        articulation=options.articulation,
        rate_hz=rate_of(options),
        fps=options.fps,
        staging=staging_of(options),
        delivery=delivery_of(options),
        **(style_of(options) | files),
    )
    with reporting(options) as report:
        found = batch(
            options.source, options.out, settings, jobs=options.jobs, cluster=options.cluster, monitor=report.receive
        )
        if found.failed:
            raise InputError(f"{found.text}; the reasons are in {found.csv}; mend them and run the same command again")
        figures = {"done": found.done, "kept": found.kept, "report": [str(found.csv), str(found.html)]}
        report.finish(printable(f"{found.text}; report: {found.html}"), **figures)
