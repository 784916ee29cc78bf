"""``lipmotion corpus prompts``: sentences to record, by phonetic coverage."""

from __future__ import annotations

import argparse

from lipmotion.cli.arguments.declared import add_options
from lipmotion.cli.arguments.paths import add_input
from lipmotion.cli.terminal.output import print_error, print_line
from lipmotion.pipeline.job import Request


def add(actions: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the action to ``lipmotion corpus``."""
    parser = actions.add_parser("prompts", help="print sentences to record, those that cover most sounds first")
    parser.add_argument("--count", type=int, default=50, metavar="N", help="at most N sentences (default: 50)")
    sentences = "choose from the sentences of this file, one per line"
    add_input(parser, "--text", what="text", metavar="FILE", help=sentences)
    covered = "do not count what this corpus covers already"
    add_input(parser, "--have", what="corpus", metavar="CORPUS", help=covered)
    add_options(parser, Request, "lexicon")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``prompts`` and print the sentences, each with the phones and diphones covered so far."""
    from lipmotion.corpora.store import Corpus
    from lipmotion.pipeline.corpus.prompts import prompts
    from lipmotion.units import Lexicon

    have = Corpus.open(options.have) if options.have else None
    lexicon = Lexicon.from_file(options.lexicon) if options.lexicon else None
    selection = prompts(options.text, count=options.count, have=have, lexicon=lexicon)
    for number, prompt in enumerate(selection.chosen, 1):
        covered = f"phones {prompt.phones:2}/{selection.phones}  diphones {prompt.diphones:4}/{selection.diphones}"
        print_line(f"{number:4}  {covered}  {prompt.text}")
    last = selection.chosen[-1] if selection.chosen else None
    covered = f"{last.diphones / selection.diphones:.0%} of all their diphones" if last else "they add nothing"
    print_line(f"{len(selection.chosen)} of {selection.sentences} sentences: {covered}")
    if selection.left_out:
        words = sorted(set(selection.left_out.values()))
        some = ", ".join(words[:10]) + (", ..." if len(words) > 10 else "")
        print_error(f"warning: left out {len(selection.left_out)} sentences for their words: {some}")
