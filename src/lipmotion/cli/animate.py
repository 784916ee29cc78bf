"""``lipmotion animate``: speech to motion files and videos."""

from __future__ import annotations

import argparse
from typing import Any

from lipmotion.cli.output import say
from lipmotion.cli.paths import add_output
from lipmotion.cli.speech import add_speech_arguments, speech_arguments


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb."""
    parser = verbs.add_parser("animate", help="turn speech into lip motion or an animated face")
    add_speech_arguments(parser)
    several: dict[str, Any] = {"type": str, "nargs": "+", "action": "extend", "required": True}
    add_output(parser, "-o", "--output", force=True, help="FILE.mp4 .json .csv .npz, or several", **several)
    parser.add_argument("--rate", type=float, metavar="HZ", help="frames per second of motion files (default: 100)")
    parser.add_argument("--channels", metavar="NAME,NAME", help="write only these to motion files: opening,width,...")
    parser.add_argument("--fps", type=float, default=25.0, help="frames per second of videos (default: 25)")
    beliefs = "draw what the chains of a coupled model believe over time"
    add_output(parser, "--posteriors", metavar="FILE.png", help=beliefs)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``lipmotion.animate`` and ``lipmotion.write``."""
    from lipmotion.pipeline.animate import animate, check_outputs, write
    from lipmotion.pipeline.posteriors import animate_with_posteriors, check_picture, write_posteriors

    check_outputs(options.output, options.speech, rate_hz=options.rate, fps=options.fps)
    if options.posteriors:
        check_picture(options.posteriors, options.speech)
    told = speech_arguments(options)
    channels = options.channels.split(",") if options.channels is not None else None
    if options.posteriors:
        result, beliefs = animate_with_posteriors(options.speech, **told)
        write_posteriors(options.posteriors, result, beliefs)
    else:
        result = animate(options.speech, **told)
    about = {"speech": options.speech, "model": told["model"], "channels": channels}
    write(result, options.output, rate_hz=options.rate, fps=options.fps, **about)
    for path in [*options.output, *filter(None, [options.posteriors])]:
        say(path)
