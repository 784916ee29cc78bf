"""``lipmotion face build|info``: make a filmed face of a person from footage, and describe one."""

from __future__ import annotations

import argparse

from lipmotion.cli.arguments.options import add_execution, add_verb
from lipmotion.cli.terminal.printing import print_line


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb and its actions to the parser of the command line."""
    parser = verbs.add_parser("face", help="make a video-realistic face from footage of a person")
    actions = parser.add_subparsers(title="actions", required=True, metavar="ACTION")
    build = add_verb(actions, __package__, "face build", run_build)
    add_execution(build)
    add_verb(actions, __package__, "face info", run_info)


def run_build(options: argparse.Namespace) -> None:
    """Call ``lipmotion.build_face`` and ``lipmotion.save_face``; report what was made."""
    from lipmotion.cli.terminal.progress import report_progress
    from lipmotion.errors import ExportError
    from lipmotion.storage.files import check_target
    from lipmotion_faces.film.build import build_face
    from lipmotion_faces.filmed.face import SUFFIX, save_face

    if options.output.suffix.lower() != SUFFIX:
        raise ExportError(f"{options.output}: a face is a file ending in {SUFFIX}; name it so")
    check_target(options.output)
    with report_progress(options) as report:
        face = build_face(
            options.footage,
            recordings=options.recordings,
            speaker=options.speaker,
            name=options.name,
            workers=options.workers,
            monitor=report.receive,
        )
        save_face(face, options.output)
        report.finish(_format_summary(face.summary | {"file": str(options.output)}), file=str(options.output))


def run_info(options: argparse.Namespace) -> None:
    """Print a description of a face."""
    from lipmotion_faces.filmed.face import load_face

    for line in _format_summary(load_face(options.face).summary).splitlines():
        print_line(line)


def _format_summary(summary: dict[str, str]) -> str:
    return "\n".join(f"{key:12} {value}" for key, value in summary.items())
