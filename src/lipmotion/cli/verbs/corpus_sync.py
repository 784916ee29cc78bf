"""``lipmotion corpus sync``: correct the offset between sound and lips of a corpus."""

from __future__ import annotations

import argparse

from lipmotion.cli.arguments.paths import add_input
from lipmotion.cli.terminal.printing import print_line


def add(actions: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the action to ``lipmotion corpus``."""
    parser = actions.add_parser("sync", help="correct the offset between sound and lips of a corpus")
    add_input(parser, "corpus", what="corpus")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``lipmotion.pipeline.corpus.sync.sync``; print by how much the sound was moved."""
    from lipmotion.corpora.store import Corpus
    from lipmotion.pipeline.corpus.sync import sync

    corpus = Corpus.open(options.corpus)
    moved = sync(corpus)
    for collection, late_s in moved.items():
        print_line(f"{collection or corpus.path}: sound moved by {-1000 * late_s:+.0f} ms")
    if not moved:
        print_line(f"{corpus.path}: nothing moved: the sound is in step, or its offset could not be measured")
