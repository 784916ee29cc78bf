"""``lipmotion edit``: write down what is changed of generated motion, to be replayed by ``animate`` and ``render``."""

from __future__ import annotations

import argparse

from lipmotion.cli.arguments.declared import add_options, pick_part
from lipmotion.cli.arguments.options import add_machine_readable, add_verb
from lipmotion.cli.terminal.progress import report_progress
from lipmotion.errors import InputError
from lipmotion.pipeline.request import Request
from lipmotion.printable import printable


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = add_verb(verbs, __package__, "edit", run)
    known = ("transcript", "lexicon", "language", "model", "recogniser", "speaker", "pauses", "manner", "asymmetry")
    add_options(parser, Request, *known)
    add_machine_readable(parser)


def run(options: argparse.Namespace) -> None:
    """Read or begin the file, add the edits, try them out, and write it."""
    from lipmotion.pipeline.analysis.read_request import read_request
    from lipmotion.pipeline.edit_files import create_edit_file, read_edits, write_edits
    from lipmotion.pipeline.session import Session
    from lipmotion.units import group_words

    with report_progress(options) as report:
        if options.of is None and not options.file.exists():
            raise InputError(f"{options.file}: no such file; begin one: lipmotion edit {options.file} --of RECORDING")
        if options.of is not None and options.file.exists():
            raise InputError(f"{options.file}: exists; add edits without --of, or delete it to begin again")
        requested = pick_part(options, Request(), recording=options.of)
        of = Session(read_request(requested), monitor=report.receive) if options.of is not None else None
        file = create_edit_file(requested, of)[0] if of is not None else read_edits(options.file)
        after = file.undo(options.undo).then(*options.sentences)
        session, edits = file.session(monitor=report.receive), after.edits
        units = session.generate(edits).units if edits.steps else session.units()
        if options.of is not None or options.undo or options.sentences:
            write_edits(after, options.file)
        lines = [f"{number:4} {sentence}" for number, sentence in enumerate(edits.sentences, 1)]
        if options.list:
            lines.append("")
            words = enumerate((span for span in group_words(units) if span.label), 1)
            word_at = {span.start_s: f"  word {number} {span.label}" for number, span in words}
            for number, span in enumerate(units, 1):
                row = f"{number:4} {span.start_s:8.3f} {span.end_s:8.3f}  {span.label.phone:4}"
                lines.append((row + word_at.pop(span.start_s, "")).rstrip())
        phones = [[span.start_s, span.end_s, span.label.phone, span.label.word] for span in units]
        text = "\n".join(map(printable, lines)) if lines else printable(str(options.file))
        report.finish(text, files=[str(options.file)], edits=list(edits.sentences), phones=phones)
