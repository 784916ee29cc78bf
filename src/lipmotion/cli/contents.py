"""``lipmotion corpus info``: what is in a corpus, and whether its sound and lips are in step."""

from __future__ import annotations

import argparse

from lipmotion.cli.output import say
from lipmotion.cli.paths import add_input


def add(actions: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the action to ``lipmotion corpus``."""
    parser = actions.add_parser("info", help="say what is in a corpus")
    add_input(parser, "corpus", what="corpus")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Print what ``lipmotion.Corpus`` says of itself, and how late its sound is."""
    from lipmotion.corpora.store import Corpus
    from lipmotion.pipeline.corpus.sync import offsets

    corpus = Corpus.open(options.corpus)
    for name, value in (*corpus.summary().items(), *(("offset", line) for line in offsets(corpus).lines())):
        say(f"{name:12} {value}")
