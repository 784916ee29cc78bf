"""``lipmotion corpus prepare|info|prompts``: recordings to a corpus, what is in one, what to record."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from lipmotion.cli import prompts


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb."""
    parser = verbs.add_parser("corpus", help="prepare recordings for training")
    actions = parser.add_subparsers(title="actions", required=True, metavar="ACTION")
    prepare = actions.add_parser("prepare", help="make a corpus of a folder of recordings")
    prepare.add_argument("recordings", type=Path, help="folder of videos, or of sounds with motion (docs/corpora.md)")
    prepare.add_argument("-o", "--output", type=Path, required=True, metavar="CORPUS")
    prepare.add_argument("--workers", type=int, help="processes (default: one a core)")
    prepare.add_argument("--no-crops", dest="crops", action="store_false", help="do not keep mouth images")
    prepare.set_defaults(run=run_prepare)
    info = actions.add_parser("info", help="say what is in a corpus")
    info.add_argument("corpus", type=Path)
    info.set_defaults(run=run_info)
    prompts.add(actions)


def run_prepare(options: argparse.Namespace) -> None:
    """Call ``lipmotion.prepare``."""
    from lipmotion.pipeline.prepare import prepare

    report = prepare(options.recordings, options.output, workers=options.workers, crops=options.crops)
    print(f"{report.corpus}: {len(report.prepared)} prepared, {len(report.kept)} kept ({report.kind})")
    for name, frames in report.unseen.items():
        print(f"lipmotion: note: {name}: no face in {frames} frames, interpolated", file=sys.stderr)
    for name, reason in report.failed.items():
        print(f"lipmotion: warning: left out {name}: {reason}", file=sys.stderr)


def run_info(options: argparse.Namespace) -> None:
    """Print what ``lipmotion.Corpus`` says of itself."""
    from lipmotion.corpora.store import Corpus

    for name, value in Corpus.open(options.corpus).summary().items():
        print(f"{name:12} {value}")
