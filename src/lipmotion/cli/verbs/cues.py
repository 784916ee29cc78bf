"""``lipmotion cues``: turn speech into held mouth shapes for 2D animation."""

from __future__ import annotations

import argparse
import os
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

from lipmotion.cli.arguments.declared import PIPE, add_options, add_output, is_pipe, pick_part, read_pipe
from lipmotion.cli.arguments.options import Version, add_verb
from lipmotion.cli.terminal.printing import flush_output, print_line, print_lines
from lipmotion.cli.terminal.progress import LEVELS, print_status_lines
from lipmotion.errors import shorten
from lipmotion.pipeline.request import Request
from lipmotion.storage.files import as_text
from lipmotion.storage.sources import Source, check_apart, is_file
from lipmotion.types.delivery import Delivery
from lipmotion.types.progress import Progress, sub_monitor

RECOGNISERS = {"pocketsphinx": "auto", "phonetic": "fast"}  # the recogniser that takes the place of each of Rhubarb's
VERSION = "; takes the options of Rhubarb Lip Sync version 1.14.0"
"""What programs look for that ask whether Rhubarb is there, and which."""
BLANK = b" \t\r\n\0\xef\xbb\xbf\xfe\xff"
NO_WORDS = re.compile(rb"\[[^\[\]]*\]|[^\w\x80-\xff]")  # sounds in brackets, and what is no letter
SHEET = re.compile(rb"\s*(\d+\.\d+\t|MohoSwitch1|lipsync version|<\?xml|{|\Z)")
"""How a file of cues begins, or an empty one."""


class _DatFrameRate(argparse.Action):
    """Sets the frame rate, and that shapes have their letters."""

    def __call__(self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, *given: Any) -> None:  # noqa: ARG002
        namespace.fps, namespace.letters = given[0], True


def _dialogue(path: str) -> str | None:
    """Return the path of a dialogue, which is never taken for the words; None: the file holds none."""
    if not is_file(Path(path)):
        raise argparse.ArgumentTypeError(f"no such file: {shorten(path)!r}; the words themselves: --transcript TEXT")
    with Path(path).open("rb") as file:
        return path if NO_WORDS.sub(b"", file.read(1 << 16).strip(BLANK)) else None


def _find_words(recording: Path) -> list[Source]:
    """Return the words beside a recording, which outputs replace by --force only; none: they are cues of it."""
    sibling = recording.parent / f"{recording.stem}.txt"
    if not is_file(sibling):
        return []
    with sibling.open("rb") as file:
        return [] if SHEET.match(file.read(64)) else [Source(sibling, "transcript", replaceable=True)]


def _name_file(text: str) -> Path:
    if text.endswith(("/", os.sep)):
        raise argparse.ArgumentTypeError(f"{text} is a folder; give the name of a file in it")
    return Path(text)


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = add_verb(verbs, __package__, "cues", run)
    add_options(parser, Request)
    add = parser.add_argument
    outputs: dict[str, Any] = {"nargs": "+", "action": "extend", "default": [], "type": _name_file}
    files = "FILE.tsv .xml .json .dat .pgo .spine.json, or several"
    add_output(parser, "-o", "--output", force=True, help=files, **outputs)
    kinds = ("tsv", "xml", "json", "dat", "pgo", "spine.json")
    text = "(default: that of the suffix; tsv on standard output)"
    add("-f", "--format", "--exportFormat", type=str.lower, choices=kinds, help=text)
    add("--fps", type=float, default=24.0, help="frames per second of the animation (default: 24)")
    add("--hold", type=int, metavar="FRAMES", help="minimum length of a shape (default: that of two frames at 24 fps)")
    add("--shapes", default="GHX", help="optional shapes that the character has (default: GHX; none: '')")
    add("--machine-readable", "--machineReadable", action="store_true", help="progress as JSON lines on standard error")
    hold = "hold every shape for at least N ms, as --hold FRAMES"
    add_options(parser, Delivery, but=("stepped", "key_tolerance"), min_hold_ms={"help": hold})
    group = parser.add_argument_group("options of Rhubarb")
    add = group.add_argument
    unset: dict[str, Any] = {"default": argparse.SUPPRESS}
    add("-d", "--dialogFile", metavar="FILE", dest="transcript", type=_dialogue, help="--transcript FILE", **unset)
    text = "--recogniser: pocketSphinx is auto, phonetic is fast"
    names, to_ours = "pocketSphinx|phonetic", (lambda name: RECOGNISERS.get(name.lower(), name))
    add("-r", "--recognizer", metavar=names, dest="recogniser", type=to_ours, help=text, **unset)
    add("--extendedShapes", metavar="GHX", dest="shapes", help="--shapes", **unset)
    text = "--fps, for every format; in .dat shapes have their letters then"
    add("--datFrameRate", metavar="FPS", dest="fps", action=_DatFrameRate, type=float, help=text, **unset)
    text = "Preston Blair's names in .dat, as without --datFrameRate"
    add("--datUsePrestonBlair", action="store_true", dest="blair", help=text)
    add_output(parser, "--logFile", metavar="FILE", dest="log_file", help="a file for warnings and errors")
    level: dict[str, Any] = {"type": str.lower, "choices": tuple(LEVELS), "metavar": "LEVEL"}
    add("--logLevel", dest="log_level", default="debug", help=f"of --logFile, from: {', '.join(LEVELS)}", **level)
    add("--consoleLevel", dest="console_level", default="warning", help="of messages on standard error", **level)
    add("--threads", metavar="N", type=int, help="without effect: one recording needs one")
    add("-q", "--quiet", action="store_true", help="without effect: warnings and errors alone are printed")
    add("-v", "--version", action=Version, nargs=0, const=VERSION, help="print the version")
    parser.set_defaults(letters=False)


def run(options: argparse.Namespace) -> None:
    """Call ``lipmotion.animate``, ``lipmotion.cues`` and ``lipmotion.write_cues``; print the cues or their paths."""
    from lipmotion.formats.cues import CUE_FORMATS
    from lipmotion.pipeline.analysis.read_request import read_request
    from lipmotion.pipeline.edit_files import edit_file
    from lipmotion.pipeline.generate.animate import animate
    from lipmotion.pipeline.model import load_model
    from lipmotion.pipeline.outputs.cues import check_cue_options, check_cue_outputs, cues, write_cues

    if options.output == [Path(PIPE)]:
        options.output = []  # they are printed
    with print_status_lines(options) as monitor, read_pipe(options.speech) as speech:
        if [path.suffix.lower() in {"", ".txt"} for path in options.output] == [True]:
            options.format = options.format or "tsv"  # as Rhubarb writes whatever the name is
        check_apart(options.output, _find_words(Path(options.speech)), force=options.force)
        delivery, requested = pick_part(options, Delivery()), pick_part(options, Request(), recording=speech)
        check_cue_options(options.fps, options.hold, options.shapes)
        check_cue_outputs(options.output, speech, options.format)
        monitor(Progress("loading the model", 0, 1, 0.0))
        request, model, edits = read_request(requested), load_model(requested.model), edit_file(requested.edits)
        result = animate(request, model=model, edits=edits, monitor=sub_monitor(monitor, 0.1, 0.9))
        delivery = edits.edits.delivery(delivery)
        sheet = cues(result, fps=options.fps, hold_frames=options.hold, shapes=options.shapes, delivery=delivery)
        sheet = replace(sheet, blair=options.blair or not options.letters)
        speech_path = "" if is_pipe(options.speech) else speech
        write_cues(sheet, options.output, speech=speech_path, form=options.format)
        monitor(Progress("writing the cues", 1, 1, 1.0))
        for path in options.output:
            print_line(path)
        if not options.output:
            text = CUE_FORMATS[options.format or "tsv"].text(sheet, as_text(speech_path))
            print_lines(text.removesuffix("\n"))
        flush_output()
