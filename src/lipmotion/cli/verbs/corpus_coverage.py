"""``lipmotion corpus coverage``: the phones, diphones and triphones that a corpus lacks."""

from __future__ import annotations

import argparse

from lipmotion.cli.arguments.declared import add_options
from lipmotion.cli.arguments.paths import add_input
from lipmotion.cli.terminal.output import print_error, print_json, print_line
from lipmotion.pipeline.job import Request

LINES = 12


def add(actions: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the action to ``lipmotion corpus``."""
    parser = actions.add_parser("coverage", help="print which sounds a corpus lacks, and what is nearest to them")
    add_input(parser, "corpus", what="corpus")
    sentences = "the sentences whose sounds are needed, one per line (default: those of lipmotion corpus prompts)"
    add_input(parser, "--text", what="text", metavar="FILE", help=sentences)
    add_options(parser, Request, "lexicon")
    most = f"at most N lines each of phones, diphones and triphones (default: {LINES})"
    parser.add_argument("--count", type=int, default=LINES, metavar="N", help=most)
    parser.add_argument("--json", action="store_true", help="print one JSON object, with everything that is missing")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``coverage`` and print it."""
    from lipmotion.corpora.store import Corpus
    from lipmotion.pipeline.corpus.coverage import coverage, coverage_document, coverage_lines
    from lipmotion.units import Lexicon

    lexicon = Lexicon.from_file(options.lexicon) if options.lexicon else None
    found = coverage(Corpus.open(options.corpus), options.text, lexicon=lexicon)
    if options.json:
        print_json(coverage_document(found))
    else:
        for line in coverage_lines(found, max(options.count, 0)):
            print_line(line)
    if found.left_out and not options.json:
        print_error(f"warning: left out {len(found.left_out)} sentences for their words (--json has them)")
    if found.unknown and not options.json:
        print_error(f"warning: {found.unknown} utterances without known words or phones were not counted")
