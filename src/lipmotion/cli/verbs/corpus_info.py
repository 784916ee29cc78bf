"""``lipmotion corpus info``: what a corpus contains, and the offset between its sound and its lips."""

from __future__ import annotations

import argparse

from lipmotion.cli.arguments.paths import add_input
from lipmotion.cli.terminal.printing import print_line


def add(actions: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the action to ``lipmotion corpus``."""
    parser = actions.add_parser("info", help="print what a corpus contains")
    add_input(parser, "corpus", what="corpus")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Print the summary of ``lipmotion.Corpus``, and by how much its sound is late."""
    from lipmotion.corpora.store import Corpus
    from lipmotion.pipeline.corpus.sync import offsets

    corpus = Corpus.open(options.corpus)
    for name, value in (*corpus.summary().items(), *(("offset", line) for line in offsets(corpus).lines())):
        print_line(f"{name:12} {value}")
