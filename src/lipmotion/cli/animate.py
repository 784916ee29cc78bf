"""``lipmotion animate``: speech to motion files and videos."""

from __future__ import annotations

import argparse

from lipmotion.cli.speech import add_speech_arguments, speech_arguments


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb."""
    parser = verbs.add_parser("animate", help="turn speech into lip motion or an animated face")
    add_speech_arguments(parser)
    parser.add_argument(
        "-o", "--output", nargs="+", action="extend", required=True, help="FILE.mp4 .json .csv .npz, or several"
    )
    parser.add_argument("--rate", type=float, metavar="HZ", help="frames per second of motion files (default: 100)")
    parser.add_argument("--channels", metavar="NAME,NAME", help="write only these to motion files: opening,width,...")
    parser.add_argument("--fps", type=float, default=25.0, help="frames per second of videos (default: 25)")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``lipmotion.animate`` and ``lipmotion.write``."""
    from lipmotion.pipeline.animate import animate, check_outputs, write

    check_outputs(options.output, options.speech, rate_hz=options.rate, fps=options.fps)
    told = speech_arguments(options)
    channels = options.channels.split(",") if options.channels is not None else None
    result = animate(options.speech, **told)
    about = {"speech": options.speech, "model": told["model"], "channels": channels}
    write(result, options.output, rate_hz=options.rate, fps=options.fps, **about)
    for path in options.output:
        print(path)
