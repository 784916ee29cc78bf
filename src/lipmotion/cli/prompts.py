"""``lipmotion corpus prompts``: sentences to record."""

from __future__ import annotations

import argparse

from lipmotion.cli.output import complain, say
from lipmotion.cli.paths import add_input
from lipmotion.cli.speech import add_lexicon_argument


def add(actions: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the action to ``lipmotion corpus``."""
    parser = actions.add_parser("prompts", help="print sentences to record, those that cover most sounds first")
    parser.add_argument("--count", type=int, default=50, metavar="N", help="at most so many (default: 50)")
    sentences = "choose from these, a sentence a line"
    add_input(parser, "--text", what="text", metavar="FILE", help=sentences)
    covered = "leave out what this corpus covers"
    add_input(parser, "--have", what="corpus", metavar="CORPUS", help=covered)
    add_lexicon_argument(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``prompts`` and print the sentences, each with what is covered after it."""
    from lipmotion.corpora.store import Corpus
    from lipmotion.pipeline.corpus.prompts import prompts
    from lipmotion.units import Lexicon

    have = Corpus.open(options.have) if options.have else None
    lexicon = Lexicon.from_file(options.lexicon) if options.lexicon else None
    found = prompts(options.text, count=options.count, have=have, lexicon=lexicon)
    for number, prompt in enumerate(found.chosen, 1):
        covered = f"phones {prompt.phones:2}/{found.phones}  diphones {prompt.diphones:4}/{found.diphones}"
        say(f"{number:4}  {covered}  {prompt.text}")
    last = found.chosen[-1] if found.chosen else None
    covered = f"{last.diphones / found.diphones:.0%} of all their diphones" if last else "they add nothing"
    say(f"{len(found.chosen)} of {found.sentences} sentences: {covered}")
    if found.left_out:
        words = sorted(set(found.left_out.values()))
        some = ", ".join(words[:10]) + (", ..." if len(words) > 10 else "")
        complain(f"warning: left out {len(found.left_out)} sentences for their words: {some}")
