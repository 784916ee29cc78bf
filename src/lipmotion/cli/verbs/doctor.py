"""``lipmotion doctor``: what is installed, what is missing, and whether the main path works."""

from __future__ import annotations

import argparse

from lipmotion.cli.arguments.options import add_machine_readable
from lipmotion.cli.terminal.printing import print_line


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = verbs.add_parser("doctor", help="print what is installed, what missing parts would bring, and what fails")
    add_machine_readable(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Print what is found, one line for each part. Raises LipMotionError, of exit code 1: something is broken."""
    from lipmotion.cli.installation.doctor import doctor
    from lipmotion.cli.terminal.progress import report_progress
    from lipmotion.errors import LipMotionError
    from lipmotion.types.progress import Item

    broken = []
    with report_progress(options) as report:
        for each in doctor():
            if options.machine_readable:
                report.receive(Item(each.name, each.state, each.text))
            else:
                print_line(f"{each.state:7} {each.name:20} {each.text}")
            broken += [each.name] if each.state == "broken" else []
        if broken:
            raise LipMotionError(f"broken: {', '.join(broken)}; what to do is said above")
        report.finish("all that is needed works", broken=broken)
