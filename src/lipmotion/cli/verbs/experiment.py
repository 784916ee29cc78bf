"""``lipmotion experiment``: train and compare systems on a corpus, one experiment a module."""

from __future__ import annotations

import argparse

from lipmotion.cli.verbs import engines, experiment_all, folds, hofer2008, learning_curve, minnis2000, xieliu2007


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb and its experiments to the parser of the command line."""
    parser = verbs.add_parser("experiment", help="train and compare systems on a corpus, as in the papers")
    actions = parser.add_subparsers(title="experiments", required=True, metavar="EXPERIMENT")
    for experiment in (hofer2008, learning_curve, folds, xieliu2007, minnis2000, engines, experiment_all):
        experiment.add(actions)
