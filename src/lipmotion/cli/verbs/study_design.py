"""``lipmotion study design``: make a study from conditions and sentences."""

from __future__ import annotations

import argparse

from lipmotion.cli.arguments.declared import add_options, part_of
from lipmotion.cli.arguments.options import add_machine_readable
from lipmotion.cli.arguments.paths import add_input, add_output
from lipmotion.printable import printable
from lipmotion.study.answers import MOS, PAIRED, RANKING

KINDS = {
    PAIRED: "which of two videos is better: every pair of conditions in both orders (Hofer 2008)",
    MOS: "five-point scales: every video alone (Xie & Liu 2007)",
    RANKING: "sliders from 0 to 100: all conditions of a sentence on one page",
}


def add(actions: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the action to ``lipmotion study``."""
    from lipmotion.study.settings import StudySettings

    parser = actions.add_parser("design", help="make a study: videos, trials and a page for raters")
    kinds = parser.add_mutually_exclusive_group(required=True)
    for kind, says in KINDS.items():
        kinds.add_argument(f"--{kind}", dest="kind", action="store_const", const=kind, help=says)
    source = "a model, a job file, or a folder of videos or motion; or 'recording' alone; once for each condition"
    parser.add_argument(
        "--condition", action="append", required=True, default=[], metavar="NAME=SOURCE", help=source, dest="conditions"
    )
    recordings = "recordings, or folders of them; the names of the files are those of the sentences"
    add_input(parser, "--sentence", what="recording", nargs="+", required=True, metavar="FILE|FOLDER", help=recordings)
    add_output(parser, "-o", "--output", is_folder=True, required=True, metavar="STUDY")
    add_options(parser, StudySettings)
    add_machine_readable(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``design_study``; report what was made."""
    from lipmotion.cli.terminal.progress import reporting
    from lipmotion.study.design import design_study
    from lipmotion.study.settings import StudySettings

    with reporting(options) as report:
        study = design_study(
            options.output,
            options.kind,
            options.conditions,
            options.sentence,
            part_of(options, StudySettings()),
            monitor=report.receive,
        )
        counts = {"videos": len(study.videos), "trials": len(study.trials)}
        said = f"{options.output}: {counts['videos']} videos, {counts['trials']} trials for each rater"
        report.finish(printable(said), study=str(options.output), **counts)
