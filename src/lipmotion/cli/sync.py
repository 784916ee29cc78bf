"""``lipmotion corpus sync``: sound and lips of a corpus put in step."""

from __future__ import annotations

import argparse

from lipmotion.cli.output import say
from lipmotion.cli.paths import add_input


def add(actions: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the action to ``lipmotion corpus``."""
    parser = actions.add_parser("sync", help="move the sound of a corpus to where the lips are")
    add_input(parser, "corpus", what="corpus")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``lipmotion.pipeline.corpus.sync.sync``."""
    from lipmotion.corpora.store import Corpus
    from lipmotion.pipeline.corpus.sync import sync

    corpus = Corpus.open(options.corpus)
    moved = sync(corpus)
    for collection, late_s in moved.items():
        say(f"{collection or corpus.path}: sound moved by {-1000 * late_s:+.0f} ms")
    if not moved:
        say(f"{corpus.path}: nothing to move: the sound is in step, or it is not known how late it is")
