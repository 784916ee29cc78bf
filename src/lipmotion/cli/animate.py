"""``lipmotion animate``: generate lip motion from speech, as motion files and videos."""

from __future__ import annotations

import argparse
from typing import Any

from lipmotion.cli.options import add_workers, worker_count
from lipmotion.cli.output import print_line, print_note
from lipmotion.cli.paths import add_output
from lipmotion.cli.speech import add_speech_arguments, request_and_model


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = verbs.add_parser("animate", help="turn speech into lip motion or an animated face")
    add_speech_arguments(parser)
    outputs: dict[str, Any] = {"type": str, "nargs": "+", "action": "extend", "required": True}
    add_output(parser, "-o", "--output", force=True, help="FILE.mp4 .json .csv .npz .TextGrid, or several", **outputs)
    parser.add_argument("--rate", type=float, metavar="HZ", help="frames per second of motion files (default: 100)")
    parser.add_argument("--channels", metavar="NAME,NAME", help="write only these to motion files: opening,width,...")
    parser.add_argument("--fps", type=float, default=25.0, help="frames per second of videos (default: 25)")
    posteriors = "draw the posterior probabilities of the chains' units over time (coupled models)"
    add_output(parser, "--posteriors", metavar="FILE.png", help=posteriors)
    parser.add_argument("--face", default="portrait", metavar="NAME", help="face that videos show (default: portrait)")
    add_workers(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``lipmotion.animate`` and ``lipmotion.write``; print the paths that were written."""
    from lipmotion.pipeline.animate import animate, check_outputs, write
    from lipmotion.pipeline.posteriors import animate_with_posteriors, check_picture, write_posteriors

    check_outputs(options.output, options.speech, rate_hz=options.rate, fps=options.fps, face=options.face)
    if options.posteriors:
        check_picture(options.posteriors, options.speech)
    request, model = request_and_model(options)
    channels = options.channels.split(",") if options.channels is not None else None
    if options.posteriors:
        result, posteriors = animate_with_posteriors(request, model=model)
        write_posteriors(options.posteriors, result, posteriors)
    else:
        result = animate(request, model=model, workers=worker_count(options))
    write(
        result,
        options.output,
        speech=options.speech,
        model=model,
        channels=channels,
        rate_hz=options.rate,
        fps=options.fps,
        face=options.face,
    )
    for path in [*options.output, *filter(None, [options.posteriors])]:
        print_line(path)
    if result.outlook is not None:
        print_note(result.outlook.text)
