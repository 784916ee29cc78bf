"""``lipmotion train``: a corpus to a model."""

from __future__ import annotations

import argparse
from pathlib import Path

from lipmotion.cli.options import add_machine_readable


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb."""
    parser = verbs.add_parser("train", help="train a model on a prepared corpus; again, to go on after a stop")
    parser.add_argument("corpus", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="MODEL")
    parser.add_argument("--split", default="train", help="train, val, test or all (default: train)")
    parser.add_argument("--lexicon", type=Path, metavar="FILE", help="pronunciations: WORD PHONE PHONE ... a line")
    add_machine_readable(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``lipmotion.train`` and ``lipmotion.save_model``."""
    from lipmotion.cli.progress import reporting
    from lipmotion.corpora.store import Corpus
    from lipmotion.files import unfinished_work
    from lipmotion.pipeline.model import save_model
    from lipmotion.pipeline.train import train
    from lipmotion.units import Lexicon

    split = None if options.split == "all" else options.split
    with reporting(options) as report:
        corpus = Corpus.open(options.corpus)
        lexicon = Lexicon.from_file(options.lexicon) if options.lexicon else None
        with unfinished_work(options.output) as work:
            model, result = train(corpus, split=split, lexicon=lexicon, monitor=report.hear, work=work)
            save_model(model, options.output)
        used, minutes = len(result.used), model.about["minutes"]
        text = f"{options.output}: {used} utterances, {minutes} minutes, {len(result.skipped)} skipped"
        text += f"\nuse it: lipmotion animate SPEECH -o FILE --model {options.output}"
        report.finish(text, model=str(options.output), used=used, minutes=minutes, skipped=len(result.skipped))
