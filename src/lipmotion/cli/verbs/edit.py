"""``lipmotion edit``: write down what is changed of generated motion, to be replayed by ``animate`` and ``render``."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from lipmotion.cli.arguments.declared import add_options, part_of
from lipmotion.cli.arguments.options import add_machine_readable
from lipmotion.cli.arguments.paths import add_input
from lipmotion.pipeline.job import Request
from lipmotion.printable import printable

if TYPE_CHECKING:
    from lipmotion.pipeline.edit_files import EditFile


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = verbs.add_parser("edit", help="change words, phones, curves of a recording's motion, in a file of edits")
    parser.add_argument("file", type=Path, metavar="FILE", help="file of edits, .json or .toml")
    sentence = "'phone 12 ends 1.24', 'word 3 is blue', 'pin jawOpen 0.1 at 1.2', ... (docs/edit.md)"
    parser.add_argument("edits", nargs="*", metavar="EDIT", help=sentence)
    add_input(parser, "--of", what="recording", metavar="RECORDING", help="begin a file of edits of this recording")
    known = ("transcript", "lexicon", "model", "recogniser", "speaker", "pauses", "asymmetry")
    add_options(parser, Request, *known)
    parser.add_argument("--undo", type=int, default=0, metavar="N", help="take back the last N edits first")
    parser.add_argument("--list", action="store_true", help="print the edits, and the phones with their numbers")
    add_machine_readable(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Read or begin the file, add the edits, try them out, and write it."""
    from lipmotion.cli.terminal.progress import reporting
    from lipmotion.errors import InputError
    from lipmotion.pipeline.edit_files import read_edits, write_edits
    from lipmotion.pipeline.edits import Edits

    with reporting(options) as report:
        if options.of is None and not options.file.exists():
            raise InputError(f"{options.file}: no such file; begin one: lipmotion edit {options.file} --of RECORDING")
        if options.of is not None and options.file.exists():
            raise InputError(f"{options.file}: exists; add edits without --of, or delete it to begin again")
        file = _begun(options) if options.of is not None else read_edits(options.file)
        before = file.edits.steps
        if not 0 <= options.undo <= len(before):
            raise InputError(f"--undo {options.undo}, required 0 to {len(before)}: there are no more edits")
        edits = Edits(before[: len(before) - options.undo]).then(*options.edits)
        session = file.session()
        units = session.generated(edits).units if edits.steps else session.units()
        if options.of is not None or edits.steps != before:
            write_edits(replace(file, edits=edits), options.file)
        lines = [f"{number:4} {sentence}" for number, sentence in enumerate(edits.sentences, 1)]
        if options.list:
            lines.append("")
            spans = enumerate(units, 1)
            lines += [f"{n:4} {s.start_s:8.3f} {s.end_s:8.3f}  {s.label.phone:4} {s.label.word}" for n, s in spans]
        phones = [[span.start_s, span.end_s, span.label.phone, span.label.word] for span in units]
        text = "\n".join(map(printable, lines)) if lines else printable(str(options.file))
        report.finish(text, files=[str(options.file)], edits=list(edits.sentences), phones=phones)


def _begun(options: argparse.Namespace) -> EditFile:
    """Return a file without edits of the recording, whose phones are recognised or aligned now."""
    from lipmotion.pipeline.edit_files import begun
    from lipmotion.pipeline.understand.read_request import read_request

    asked = part_of(options, Request(), recording=options.of)
    return begun(read_request(asked), options.of, asked.model, asked.lexicon)
