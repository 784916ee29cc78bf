"""``lipmotion study``: studies in which people watch videos and judge them."""

from __future__ import annotations

import argparse

from lipmotion.cli.verbs import study_analyse


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb and its actions to the parser of the command line."""
    parser = verbs.add_parser("study", help="let people watch videos and judge them")
    actions = parser.add_subparsers(title="actions", required=True, metavar="ACTION")
    study_analyse.add(actions)
