"""Outputs of the verbs that generate motion: motion files and videos."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lipmotion.cli.paths import add_input, add_output

if TYPE_CHECKING:
    from lipmotion.pipeline.model import Model
    from lipmotion.types import Audio, Generation


def add_result_arguments(parser: argparse.ArgumentParser, files: str, *, required: bool = True) -> None:
    """Add the outputs, and what is written to them: rate and channels of motion, frame rate and face of videos.

    files    : the suffixes that are possible, for the help
    required : whether there must be an output
    """
    outputs: dict[str, Any] = {"type": str, "nargs": "+", "action": "extend", "required": required}
    outputs |= {} if required else {"default": []}
    add_output(parser, "-o", "--output", force=True, help=files, **outputs)
    parser.add_argument("--rate", type=float, metavar="HZ", help="frames per second of motion files (default: 100)")
    parser.add_argument("--channels", metavar="NAME,NAME", help="write only these to motion files: opening,width,...")
    rate = "frames per second of videos (default: 25; of filmed faces, those of the footage)"
    parser.add_argument("--fps", type=float, help=rate)
    face = "face that videos show: portrait, or a filmed face (default: portrait)"
    drawn: dict[str, Any] = {"type": str, "default": "portrait", "metavar": "NAME|FILE.face", "help": face}
    add_input(parser, "--face", what="face", replaceable=True, **drawn)
    footage = "footage of the same person into which a filmed face is stitched (default: the one in its file)"
    add_input(parser, "--background", what="background", metavar="VIDEO", help=footage)
    follows = "what the jaw of a filmed face follows: motion, energy or none (default: motion)"
    parser.add_argument("--jaw", choices=["motion", "energy", "none"], default="motion", help=follows)


def check_results(options: argparse.Namespace, speech: Path | None = None) -> None:
    """Raise ExportError or InputError if an output cannot be written; replace the name of a face by the face.

    speech : the recording (None: there will be a sound that is in no file)
    """
    from lipmotion.pipeline.animate import check_outputs, opened_face

    options.face = opened_face(options.face)
    checked = {"rate_hz": options.rate, "fps": options.fps, "face": options.face}
    check_outputs(options.output, speech, **checked, with_sound=speech is None)


def write_results(options: argparse.Namespace, result: Generation, speech: Path | Audio, model: Model) -> None:
    """Write generated motion to the outputs.

    speech : the recording, or the sound
    """
    from lipmotion.pipeline.animate import write
    from lipmotion.pipeline.film.video import FilmOptions

    write(
        result,
        options.output,
        speech=speech,
        model=model,
        channels=options.channels.split(",") if options.channels is not None else None,
        rate_hz=options.rate,
        fps=options.fps,
        face=options.face,
        film=FilmOptions(background=options.background, jaw=options.jaw),
    )
