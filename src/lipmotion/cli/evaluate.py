"""``lipmotion evaluate``: how good a model is on recordings it has not seen."""

from __future__ import annotations

import argparse
from pathlib import Path

from lipmotion.cli.options import add_machine_readable
from lipmotion.cli.speech import add_recogniser_argument


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb."""
    parser = verbs.add_parser("evaluate", help="compare generated with recorded motion")
    parser.add_argument("model", type=Path)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("--split", default="test", help="train, val, test or all (default: test)")
    parser.add_argument("--speaker", action="append", default=[], metavar="NAME", help="this one only (repeatable)")
    parser.add_argument("--lexicon", type=Path, metavar="FILE", help="pronunciations: WORD PHONE PHONE ... a line")
    add_recogniser_argument(parser)
    parser.add_argument("-o", "--output", type=Path, metavar="FILE.json", help="write all figures here as well")
    add_machine_readable(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``lipmotion.evaluate`` and print its figures."""
    import json

    from lipmotion.cli.progress import reporting
    from lipmotion.corpora.store import Corpus
    from lipmotion.files import check_target, whole_file
    from lipmotion.measures.report import table
    from lipmotion.pipeline.evaluate import evaluate
    from lipmotion.pipeline.model import load_model
    from lipmotion.units import Lexicon

    with reporting(options) as report:
        if options.output:
            check_target(options.output)
        lexicon = Lexicon.from_file(options.lexicon) if options.lexicon else None
        split = None if options.split == "all" else options.split
        chosen = {"split": split, "speakers": options.speaker, "lexicon": lexicon, "recogniser": options.recogniser}
        figures = evaluate(load_model(options.model), Corpus.open(options.corpus), **chosen, monitor=report.hear)
        if options.output:
            with whole_file(options.output) as unfinished:
                unfinished.write_text(json.dumps(figures, indent=1, allow_nan=False) + "\n")
        report.finish(table(figures), figures=figures)
