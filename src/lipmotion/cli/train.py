"""``lipmotion train``: a corpus to a model."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb."""
    parser = verbs.add_parser("train", help="train a model on a prepared corpus")
    parser.add_argument("corpus", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="MODEL")
    parser.add_argument("--split", default="train", help="train, val, test or all (default: train)")
    parser.add_argument("--speaker", action="append", default=[], metavar="NAME", help="this one only (repeatable)")
    parser.add_argument("--lexicon", type=Path, metavar="FILE", help="pronunciations: WORD PHONE PHONE ... a line")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``lipmotion.train`` and ``lipmotion.save_model``."""
    from lipmotion.corpora.store import Corpus
    from lipmotion.files import check_target
    from lipmotion.pipeline.model import save_model
    from lipmotion.pipeline.train import train
    from lipmotion.units import Lexicon

    check_target(options.output)
    split = None if options.split == "all" else options.split
    lexicon = Lexicon.from_file(options.lexicon) if options.lexicon else None
    chosen = {"split": split, "speakers": options.speaker}
    model, report = train(Corpus.open(options.corpus), **chosen, lexicon=lexicon, monitor=_show)
    save_model(model, options.output)
    for name, reason in report.skipped.items():
        print(f"lipmotion: warning: left out {name}: {reason}", file=sys.stderr)
    print(f"{options.output}: {len(report.used)} utterances, {model.about['minutes']} minutes")


def _show(step: str, value: float) -> None:
    print(f"{step:24} {value:10.3f}", file=sys.stderr)
