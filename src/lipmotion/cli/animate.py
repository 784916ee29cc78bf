"""``lipmotion animate``: speech to motion files and videos."""

from __future__ import annotations

import argparse
from pathlib import Path


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb."""
    parser = verbs.add_parser("animate", help="turn speech into lip motion or an animated face")
    parser.add_argument("speech", type=Path, help="audio or video file")
    parser.add_argument(
        "-o", "--output", nargs="+", action="extend", required=True, help="FILE.mp4 .json .csv .npz, or several"
    )
    parser.add_argument("--transcript", metavar="TEXT|FILE", help="what is said, if known")
    parser.add_argument("--lexicon", type=Path, metavar="FILE", help="pronunciations: WORD PHONE PHONE ... a line")
    parser.add_argument("--units", type=Path, metavar="FILE", help="phones of an earlier .json or .npz, edited or not")
    parser.add_argument("--model", type=Path, help="trained model (default: the one that ships with the package)")
    parser.add_argument("--rate", type=float, metavar="HZ", help="frames per second of motion files (default: 100)")
    parser.add_argument("--channels", metavar="NAME,NAME", help="write only these to motion files: opening,width,...")
    parser.add_argument("--fps", type=float, default=25.0, help="frames per second of videos (default: 25)")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``lipmotion.animate`` and ``lipmotion.write``."""
    from lipmotion.cli.texts import text_or_file
    from lipmotion.export.base import read_motion
    from lipmotion.pipeline.animate import animate, check_outputs, write
    from lipmotion.pipeline.model import load_model
    from lipmotion.units import Lexicon

    check_outputs(options.output, options.speech, rate_hz=options.rate, fps=options.fps)
    transcript = text_or_file(options.transcript) if options.transcript is not None else None
    lexicon = Lexicon.from_file(options.lexicon) if options.lexicon else None
    model = load_model(options.model)
    units = read_motion(options.units)[1] if options.units else None
    channels = options.channels.split(",") if options.channels else None
    result = animate(options.speech, transcript=transcript, units=units, model=model, lexicon=lexicon)
    about = {"speech": options.speech, "model": model, "channels": channels}
    write(result, options.output, rate_hz=options.rate, fps=options.fps, **about)
    for path in options.output:
        print(path)
