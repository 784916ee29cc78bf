"""Outputs of the verbs that generate motion: motion files and videos."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lipmotion.cli.arguments.curve_arguments import (
    add_character_arguments,
    chosen_curves,
    open_character,
)
from lipmotion.cli.arguments.delivery import add_delivery_arguments, delivery_of
from lipmotion.cli.arguments.faces import add_face_arguments, film_options
from lipmotion.cli.arguments.options import worker_count
from lipmotion.cli.arguments.paths import add_output
from lipmotion.cli.arguments.staging import add_staging_arguments, staging_of

if TYPE_CHECKING:
    from lipmotion.cli.terminal.progress import Report
    from lipmotion.pipeline.model import Model
    from lipmotion.types import Audio, Generation

RECOGNITION = 0.3
"""The share of the work that is recognition, where a video is drawn, too."""


def add_result_arguments(parser: argparse.ArgumentParser, files: str, *, required: bool = True) -> None:
    """Add the outputs, and what is written to them: rate and channels of motion, frame rate and face of videos.

    files    : the suffixes that are possible, for the help
    required : whether there must be an output
    """
    outputs: dict[str, Any] = {"type": str, "nargs": "+", "action": "extend", "required": required}
    outputs |= {} if required else {"default": []}
    add_output(parser, "-o", "--output", force=True, help=files, **outputs)
    parser.add_argument(
        "--rate", type=float, metavar="HZ", help="frames per second of motion files (default: --fps, or 100)"
    )
    parser.add_argument("--channels", metavar="NAME,NAME", help="write only these to motion files: opening,width,...")
    rate = "frames per second of videos (default: 25; of filmed faces, those of the footage)"
    parser.add_argument("--fps", type=float, help=rate)
    articulation = "add tongue, lip_tuck, protrusion, spread, lip_press, teeth to motion files"
    parser.add_argument("--articulation", action="store_true", help=articulation)
    add_face_arguments(parser)
    add_character_arguments(parser)
    add_staging_arguments(parser)
    add_delivery_arguments(parser)


def check_results(options: argparse.Namespace, speech: Path | None = None) -> None:
    """Raise ExportError or InputError if an output cannot be written; replace the name of a face by the face.

    A face and a character that are open already stay so: several recordings share them.
    speech : the recording (None: there will be a sound that is in no file)
    """
    from lipmotion.pipeline.outputs.output import OutputSettings, checked_outputs

    open_faces(options)
    settings = OutputSettings(
        options.face,
        speech,
        sounded=speech is None,
        rate_hz=rate_of(options),
        fps=options.fps,
        film=film_options(options),
        staging=staging_of(options),
        delivery=delivery_of(options),
    )
    checked_outputs(options.output, settings)


def open_faces(options: argparse.Namespace) -> None:
    """Replace the name of a face by the face, or by the character that was asked for; once."""
    from lipmotion.pipeline.outputs.shown_faces import shown_face

    if getattr(options, "driven", None) is None:
        open_character(options)
    options.face = shown_face(options.face)


def write_results(
    options: argparse.Namespace,
    result: Generation,
    speech: Path | Audio | None,
    model: Model | None,
    report: Report,
    temporary: bool = False,
) -> None:
    """Write generated motion to the outputs.

    speech    : the recording, or the sound; None: there is none, and no output needs it
    report    : receives the progress of videos
    temporary : whether the recording is a file that will be gone
    """
    from lipmotion.pipeline.outputs.motion_files import with_articulation
    from lipmotion.pipeline.outputs.write import write
    from lipmotion.types.progress import sub_monitor

    delivery = delivery_of(options)
    write(
        with_articulation(result) if options.articulation else result,
        options.output,
        speech=speech,
        model=model,
        channels=options.channels.split(",") if options.channels is not None else None,
        curves=chosen_curves(options),
        rate_hz=rate_of(options),
        fps=options.fps,
        face=options.face,
        film=film_options(options),
        staging=staging_of(options),
        delivery=delivery,
        temporary=temporary,
        monitor=sub_monitor(report.receive, RECOGNITION, 1.0),
    )


def work_of(options: argparse.Namespace, report: Report) -> dict[str, Any]:
    """Return how ``animate`` works for the outputs: processes, monitor, and what it loads meanwhile.

    Recognition is the whole work, or its first part where a video is drawn, too; what draws it is loaded meanwhile.
    """
    from lipmotion.pipeline.outputs.drawn_video import shows_face
    from lipmotion.types.progress import sub_monitor

    draws = any(shows_face(Path(output)) for output in options.output)
    return {
        "workers": worker_count(options),
        "monitor": sub_monitor(report.receive, 0.0, RECOGNITION if draws else 1.0),
        "meanwhile": options.face.load if draws else None,
    }


def rate_of(options: argparse.Namespace) -> float | None:
    """Return the frame rate of motion files: that of ``--rate``, else that of ``--fps``, else None: the model's."""
    rate_hz: float | None = options.fps if options.rate is None else options.rate
    return rate_hz
