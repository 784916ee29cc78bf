"""``lipmotion study design|serve|export|analyse|forget``: people watch videos and judge them."""

from __future__ import annotations

import argparse

from lipmotion.cli.arguments.declared import add_options, part_of
from lipmotion.cli.arguments.figures import add_figures_arguments, report_figures
from lipmotion.cli.arguments.options import add_machine_readable
from lipmotion.cli.arguments.paths import add_input, add_output
from lipmotion.cli.terminal.printing import flush_output, print_line
from lipmotion.printable import printable
from lipmotion_studio.study.answers import MOS, PAIRED, RANKING

KINDS = {
    PAIRED: "which of two videos is better: every pair of conditions in both orders (Hofer 2008)",
    MOS: "five-point scales: every video alone (Xie & Liu 2007)",
    RANKING: "sliders from 0 to 100: all conditions of a sentence on one page",
}


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb and its actions to the parser of the command line."""
    parser = verbs.add_parser("study", help="show videos to people, and find out what they see")
    actions = parser.add_subparsers(title="actions", required=True, metavar="ACTION")
    for action in (_add_design, _add_serve, _add_export, _add_analyse, _add_forget):
        action(actions)


def _add_design(actions: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    from lipmotion_studio.study.settings import StudySettings

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
    parser.set_defaults(run=run_design)


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
            part_of(options, StudySettings()),
            monitor=report.receive,
        )
        counts = {"videos": len(study.videos), "trials": len(study.trials)}
        said = f"{options.output}: {counts['videos']} videos, {counts['trials']} trials for each rater"
        report.finish(printable(said), study=str(options.output), **counts)


def _add_serve(actions: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = actions.add_parser("serve", help="show a study to raters as a web page, and store their answers")
    add_input(parser, "study", what="study", metavar="STUDY")
    host = "address to listen at (default: 127.0.0.1, which only this machine reaches; see docs/study.md)"
    parser.add_argument("--host", default="127.0.0.1", help=host)
    parser.add_argument("--port", type=int, default=8000, help="0: any that is free (default: 8000)")
    name = "name by which raters reach the server through another one, as study.example.org; may be repeated"
    parser.add_argument("--name", action="append", default=[], metavar="HOST", help=name)
    parser.set_defaults(run=run_serve)


def run_serve(options: argparse.Namespace) -> None:
    """Call ``serve_study``; print the address of the page."""
    from lipmotion_studio.study.serve import serve_study

    def started(address: str) -> None:
        print_line(f"raters begin at {address} (Ctrl-C ends; answers are kept in {options.study})")
        flush_output()

    serve_study(options.study, host=options.host, port=options.port, names=options.name, started=started)


def _add_export(actions: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = actions.add_parser("export", help="write the answers as CSV, one row for each judgement")
    add_input(parser, "study", what="study", metavar="STUDY")
    add_output(parser, "-o", "--output", required=True, metavar="FILE.csv")
    parser.add_argument("--rater", metavar="NAME", help="the answers of this rater alone, as r007 (default: all)")
    parser.set_defaults(run=run_export)


def run_export(options: argparse.Namespace) -> None:
    """Call ``export_answers``; print how many there are."""
    from lipmotion_studio.study.collected import export_answers

    print_line(f"{options.output}: {export_answers(options.study, options.output, options.rater)} answers")


def _add_analyse(actions: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = actions.add_parser("analyse", help="print what the answers of a study say, and how sure it is")
    add_input(parser, "answers", what="table of answers", metavar="ANSWERS.csv", help="of lipmotion study export")
    relative = "condition to which improvement is relative (default: that with the lowest mean)"
    parser.add_argument("--baseline", metavar="CONDITION", help=relative)
    planned = "probability with which a planned study shall tell a difference (default: 0.8)"
    parser.add_argument("--power", type=float, default=0.8, metavar="P", help=planned)
    count = "sentences of a planned study (default: as many as in this one)"
    parser.add_argument("--sentences", type=int, metavar="N", help=count)
    add_figures_arguments(parser, lexicon=False)
    parser.set_defaults(run=run_analyse)


def run_analyse(options: argparse.Namespace) -> None:
    """Call ``analyse_study`` and print its tables."""
    from lipmotion_studio.study.analysis.analyse import analyse_study
    from lipmotion_studio.study.analysis.analysis_table import analysis_table

    report_figures(
        options,
        lambda *_: analyse_study(
            options.answers, baseline=options.baseline, power=options.power, sentences=options.sentences
        ),
        analysis_table,
    )


def _add_forget(actions: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    parser = actions.add_parser("forget", help="delete all answers of one rater")
    add_input(parser, "study", what="study", metavar="STUDY")
    parser.add_argument("rater", help="name of the rater in the exported answers, as r007")
    parser.set_defaults(run=run_forget)


def run_forget(options: argparse.Namespace) -> None:
    """Call ``forget_rater``; print how many answers there were."""
    from lipmotion_studio.study.collected import forget_rater

    count = forget_rater(options.study, options.rater)
    print_line(f"{options.rater}: {count} answers deleted; files that were exported before still have them")
