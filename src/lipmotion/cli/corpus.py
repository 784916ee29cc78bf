"""``lipmotion corpus prepare|info|sync|prompts``: recordings to a corpus, what is in one, sound and lips in step."""

from __future__ import annotations

import argparse
from pathlib import Path

from lipmotion.cli import prompts
from lipmotion.cli.options import add_machine_readable


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb."""
    parser = verbs.add_parser("corpus", help="prepare recordings for training")
    actions = parser.add_subparsers(title="actions", required=True, metavar="ACTION")
    prepare = actions.add_parser("prepare", help="make a corpus of a folder of recordings")
    prepare.add_argument("recordings", type=Path, help="folder of videos, or of sounds with motion (docs/corpora.md)")
    prepare.add_argument("-o", "--output", type=Path, required=True, metavar="CORPUS")
    prepare.add_argument("--workers", type=int, help="processes (default: one a core)")
    prepare.add_argument("--no-crops", dest="crops", action="store_false", help="do not keep mouth images")
    add_machine_readable(prepare)
    prepare.set_defaults(run=run_prepare)
    info = actions.add_parser("info", help="say what is in a corpus")
    info.add_argument("corpus", type=Path)
    info.set_defaults(run=run_info)
    sync = actions.add_parser("sync", help="move the sound of a corpus to where the lips are")
    sync.add_argument("corpus", type=Path)
    sync.set_defaults(run=run_sync)
    prompts.add(actions)


def run_prepare(options: argparse.Namespace) -> None:
    """Call ``lipmotion.prepare``."""
    from lipmotion.cli.progress import reporting
    from lipmotion.pipeline.prepare import prepare

    given = {"workers": options.workers, "crops": options.crops}
    with reporting(options) as report:
        done = prepare(options.recordings, options.output, **given, monitor=report.hear)
        report.finish(str(done), corpus=str(done.corpus), kind=done.kind, **done.counts)


def run_info(options: argparse.Namespace) -> None:
    """Print what ``lipmotion.Corpus`` says of itself, and how late its sound is."""
    from lipmotion.corpora.store import Corpus
    from lipmotion.pipeline.offset import offsets

    corpus = Corpus.open(options.corpus)
    for name, value in corpus.summary().items():
        print(f"{name:12} {value}")
    for line in offsets(corpus).lines():
        print(f"{'offset':12} {line}")


def run_sync(options: argparse.Namespace) -> None:
    """Call ``lipmotion.pipeline.offset.sync``."""
    from lipmotion.corpora.store import Corpus
    from lipmotion.pipeline.offset import sync

    corpus = Corpus.open(options.corpus)
    moved = sync(corpus)
    for collection, late_s in moved.items():
        print(f"{collection or corpus.path}: sound moved by {-1000 * late_s:+.0f} ms")
    if not moved:
        print(f"{corpus.path}: nothing to move: the sound is in step, or it is not known how late it is")
