"""``lipmotion experiment unit-sets|learning-curve|folds|xieliu2007|engines``: train and compare systems on a corpus."""

from __future__ import annotations

import argparse

from lipmotion.cli.verbs import engines, folds, learning_curve, unit_sets, xieliu2007


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb and its experiments to the parser of the command line."""
    parser = verbs.add_parser("experiment", help="train and compare systems on a corpus, as in the papers")
    actions = parser.add_subparsers(title="experiments", required=True, metavar="EXPERIMENT")
    for experiment in (unit_sets, learning_curve, folds, xieliu2007, engines):
        experiment.add(actions)
