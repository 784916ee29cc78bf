"""``lipmotion corpus prepare|info|sync|offset|prompts|coverage``: make a corpus of recordings, correct it."""

from __future__ import annotations

import argparse

from lipmotion.cli.arguments.options import add_machine_readable, add_workers
from lipmotion.cli.arguments.paths import add_input, add_output
from lipmotion.cli.verbs import corpus_coverage, corpus_info, corpus_offset, corpus_prompts, corpus_sync


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb and its actions to the parser of the command line."""
    parser = verbs.add_parser("corpus", help="prepare recordings for training")
    actions = parser.add_subparsers(title="actions", required=True, metavar="ACTION")
    prepare = actions.add_parser("prepare", help="make a corpus of recordings")
    layouts = "folder of videos, or of sounds with motion; or one video (docs/corpora.md)"
    add_input(prepare, "recordings", what="folder of recordings", help=layouts)
    add_output(prepare, "-o", "--output", is_folder=True, required=True, metavar="CORPUS")
    add_workers(prepare)
    prepare.add_argument("--no-crops", dest="crops", action="store_false", help="do not store mouth pictures")
    late = "the sound of every recording is MS milliseconds late against its motion (default: in step, or found)"
    prepare.add_argument("--offset-ms", type=float, metavar="MS", help=late)
    add_machine_readable(prepare)
    prepare.set_defaults(run=run_prepare)
    corpus_info.add(actions)
    corpus_sync.add(actions)
    corpus_offset.add(actions)
    corpus_prompts.add(actions)
    corpus_coverage.add(actions)


def run_prepare(options: argparse.Namespace) -> None:
    """Call ``lipmotion.prepare``; report what was prepared, kept and skipped."""
    from lipmotion.cli.terminal.progress import reporting
    from lipmotion.pipeline.corpus.prepare import prepare

    with reporting(options) as report:
        done = prepare(
            options.recordings,
            options.output,
            workers=options.workers,
            crops=options.crops,
            offset_ms=options.offset_ms,
            monitor=report.receive,
        )
        report.finish(str(done), corpus=str(done.corpus), kind=done.kind, **done.counts)
