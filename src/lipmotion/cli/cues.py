"""``lipmotion cues``: speech to held mouth shapes for 2D animation."""

from __future__ import annotations

import argparse
from contextlib import nullcontext
from typing import Any

from lipmotion.cli.output import flush_output, say, say_lines
from lipmotion.cli.paths import add_output
from lipmotion.cli.speech import add_speech_arguments, speech_arguments
from lipmotion.cli.status import status_lines


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb."""
    parser = verbs.add_parser("cues", help="turn speech into mouth shapes for 2D animation (Rhubarb, Moho, OpenToonz)")
    add_speech_arguments(parser)
    add = parser.add_argument
    several: dict[str, Any] = {"nargs": "+", "action": "extend", "default": []}
    add_output(parser, "-o", "--output", force=True, help="FILE.tsv .xml .json .dat", **several)
    add("-f", "--format", choices=("tsv", "xml", "json", "dat"), help="(default: the suffix; tsv without a file)")
    add("--fps", type=float, default=24.0, help="frames per second of the animation (default: 24)")
    add("--hold", type=int, metavar="FRAMES", help="least length of a shape (default: as two frames at 24)")
    add("--shapes", default="GHX", help="optional shapes that the character has (default: GHX; none: '')")
    add("--machine-readable", "--machineReadable", action="store_true", help="status as JSON lines on standard error")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``lipmotion.animate``, ``lipmotion.cues`` and ``lipmotion.write_cues``."""
    from lipmotion.pipeline.animate import animate
    from lipmotion.pipeline.cues import check_cue_options, check_cue_outputs, cue_text, cues, write_cues

    with status_lines(options) if options.machine_readable else nullcontext(lambda _: None) as done:
        check_cue_options(options.fps, options.hold, options.shapes)
        check_cue_outputs(options.output, options.speech, options.format)
        done(0.0)
        told = speech_arguments(options)
        done(0.1)
        result = animate(options.speech, **told)
        done(0.9)
        sheet = cues(result, fps=options.fps, hold_frames=options.hold, shapes=options.shapes)
        write_cues(sheet, options.output, speech=options.speech, form=options.format)
        done(1.0)
        for path in options.output:
            say(path)
        if not options.output:
            say_lines(cue_text(sheet, speech=options.speech, form=options.format or "tsv").removesuffix("\n"))
        flush_output()
