"""``lipmotion study design|serve|export|analyse|forget``: people watch videos and judge them."""

from __future__ import annotations

import argparse

from lipmotion.cli.arguments.declared import add_options, pick_part
from lipmotion.cli.arguments.options import add_arguments, add_figures_arguments, add_machine_readable, report_figures
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
    add_arguments(design, __package__, "design")
    add_options(design, StudySettings)
    add_machine_readable(design)
    design.set_defaults(run=run_design)
    for name, (run, text) in ACTIONS.items():
        action = actions.add_parser(name, help=text)
        add_arguments(action, __package__, name)
        action.set_defaults(run=run)
    add_figures_arguments(actions.choices["analyse"], lexicon=False)


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


ACTIONS = {
    "serve": (run_serve, "show a study to raters as a web page, and store their answers"),
    "export": (run_export, "write the answers as CSV, one row for each judgement"),
    "analyse": (run_analyse, "print what the answers of a study say, and how sure it is"),
    "forget": (run_forget, "delete all answers of one rater"),
}
"""What each action runs, and does; its arguments stand in ``arguments.csv``."""
