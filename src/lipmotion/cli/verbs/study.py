"""``lipmotion study design|serve|export|analyse|forget``: people watch videos and judge them."""

from __future__ import annotations

import argparse

from lipmotion.cli.verbs import study_analyse, study_design, study_export, study_forget, study_serve


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb and its actions to the parser of the command line."""
    parser = verbs.add_parser("study", help="show videos to people, and find out what they see")
    actions = parser.add_subparsers(title="actions", required=True, metavar="ACTION")
    for action in (study_design, study_serve, study_export, study_analyse, study_forget):
        action.add(actions)
