"""``lipmotion study design|serve|export|analyse|forget``: people watch videos and judge them."""

from __future__ import annotations

import argparse

from lipmotion.cli.arguments.declared import add_input, add_options, add_output, pick_part
from lipmotion.cli.arguments.options import add_figures_arguments, add_machine_readable, report_figures
from lipmotion.cli.terminal.printing import flush_output, print_line
from lipmotion.printable import printable
from lipmotion_studio.study.answers import MOS, PAIRED

KINDS = {
    PAIRED: "which of two videos is better: every pair of conditions in both orders (Hofer 2008)",
    MOS: "five-point scales: every video alone (Xie & Liu 2007)",
}


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb and its actions to the parser of the command line."""
    from lipmotion_studio.study.settings import StudySettings

    parser = verbs.add_parser("study", help="show videos to people, and find out what they see")
    actions = parser.add_subparsers(title="actions", required=True, metavar="ACTION")

    design = actions.add_parser("design", help="make a study: videos, trials and a page for raters")
    kinds = design.add_mutually_exclusive_group(required=True)
    for kind, meaning in KINDS.items():
        kinds.add_argument(f"--{kind}", dest="kind", action="store_const", const=kind, help=meaning)
    source = "a model, a job file, or a folder of videos or motion; or 'recording' alone; once for each condition"
    design.add_argument(
        "--condition", action="append", required=True, default=[], metavar="NAME=SOURCE", help=source, dest="conditions"
    )
    recordings = "recordings, or folders of them; the names of the files are those of the sentences"
    add_input(design, "--sentence", what="recording", nargs="+", required=True, metavar="FILE|FOLDER", help=recordings)
    add_output(design, "-o", "--output", is_folder=True, required=True, metavar="STUDY")
    add_options(design, StudySettings)
    add_machine_readable(design)
    design.set_defaults(run=run_design)

    serve = actions.add_parser("serve", help="show a study to raters as a web page, and store their answers")
    add_input(serve, "study", what="study", metavar="STUDY")
    host = "address to listen at (default: 127.0.0.1, which only this machine reaches; see docs/study.md)"
    serve.add_argument("--host", default="127.0.0.1", help=host)
    serve.add_argument("--port", type=int, default=8000, help="0: any that is free (default: 8000)")
    name = "name by which raters reach the server through another one, as study.example.org; may be repeated"
    serve.add_argument("--name", action="append", default=[], metavar="HOST", help=name)
    serve.set_defaults(run=run_serve)

    export = actions.add_parser("export", help="write the answers as CSV, one row for each judgement")
    add_input(export, "study", what="study", metavar="STUDY")
    add_output(export, "-o", "--output", required=True, metavar="FILE.csv")
    export.add_argument("--rater", metavar="NAME", help="the answers of this rater alone, as r007 (default: all)")
    export.set_defaults(run=run_export)

    analyse = actions.add_parser("analyse", help="print what the answers of a study say, and how sure it is")
    add_input(analyse, "answers", what="table of answers", metavar="ANSWERS.csv", help="of lipmotion study export")
    relative = "condition to which improvement is relative (default: that with the lowest mean)"
    analyse.add_argument("--baseline", metavar="CONDITION", help=relative)
    planned = "probability with which a planned study shall tell a difference (default: 0.8)"
    analyse.add_argument("--power", type=float, default=0.8, metavar="P", help=planned)
    count = "sentences of a planned study (default: as many as in this one)"
    analyse.add_argument("--sentences", type=int, metavar="N", help=count)
    add_figures_arguments(analyse, lexicon=False)
    analyse.set_defaults(run=run_analyse)

    forget = actions.add_parser("forget", help="delete all answers of one rater")
    add_input(forget, "study", what="study", metavar="STUDY")
    forget.add_argument("rater", help="name of the rater in the exported answers, as r007")
    forget.set_defaults(run=run_forget)


def run_design(options: argparse.Namespace) -> None:
    """Call ``design_study``; report what was made."""
    from lipmotion.cli.terminal.progress import report_progress
    from lipmotion_studio.study.design import design_study
    from lipmotion_studio.study.settings import StudySettings

    with report_progress(options) as report:
        study = design_study(
            options.output,
            options.kind,
            options.conditions,
            options.sentence,
            pick_part(options, StudySettings()),
            monitor=report.receive,
        )
        counts = {"videos": len(study.videos), "trials": len(study.trials)}
        message = f"{options.output}: {counts['videos']} videos, {counts['trials']} trials for each rater"
        report.finish(printable(message), study=str(options.output), **counts)


def run_serve(options: argparse.Namespace) -> None:
    """Let raters take part in a study, until the process is stopped; print the address of the page.

    Every answer is on the disk before the rater's page learns that it is stored. A stopped study goes on where it was.
    Raises InputError: no study, a video is missing or has changed, or the address cannot be listened at.
    Raises MissingDependencyError: a package of the extra ``study`` is not installed.
    """
    from contextlib import closing

    from lipmotion_studio.study.manifest import check_videos, read_study
    from lipmotion_studio.study.store import StudyStore
    from lipmotion_studio.web.listening import check_installed, open_socket, serve

    check_installed("serving a study", "study")
    from lipmotion_studio.study.application import create_application

    def announce(address: str) -> None:
        print_line(f"raters begin at {address} (Ctrl-C ends; answers are kept in {options.study})")
        flush_output()

    study = read_study(options.study)
    videos = check_videos(study, options.study)
    with open_socket(options.host, options.port) as place, closing(StudyStore(options.study)) as store:
        application = create_application(study, videos, store, options.name)
        serve(application, place, host=options.host, started=announce)


def run_export(options: argparse.Namespace) -> None:
    """Call ``export_answers``; print how many there are."""
    from lipmotion_studio.study.store import export_answers

    print_line(f"{options.output}: {export_answers(options.study, options.output, options.rater)} answers")


def run_analyse(options: argparse.Namespace) -> None:
    """Call ``analyse_study`` and print its tables."""
    from lipmotion_studio.study.analysis.analyse import analyse_study, format_analysis

    report_figures(
        options,
        lambda *_: analyse_study(
            options.answers, baseline=options.baseline, power=options.power, sentences=options.sentences
        ),
        format_analysis,
    )


def run_forget(options: argparse.Namespace) -> None:
    """Call ``forget_rater``; print how many answers there were."""
    from lipmotion_studio.study.store import forget_rater

    count = forget_rater(options.study, options.rater)
    print_line(f"{options.rater}: {count} answers deleted; files that were exported before still have them")
