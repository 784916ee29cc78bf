"""``lipmotion render``: draw motion of a file, edited or imported, or write it in another form."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from lipmotion.cli.arguments.options import add_machine_readable
from lipmotion.cli.arguments.paths import add_input
from lipmotion.cli.arguments.pipes import add_pipe_format, written_pipe
from lipmotion.cli.arguments.results import add_result_arguments, check_results, write_results
from lipmotion.printable import printable

if TYPE_CHECKING:
    from lipmotion.cli.terminal.progress import Report


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = verbs.add_parser("render", help="draw edited or imported motion, or write it in another form")
    motion = "motion file: .json .csv .npz, or another that can be read; of channels 'opening' or blendshapes"
    add_input(parser, "motion", what="motion file", replaceable=True, help=motion)
    sound = "the sound of videos (default: none; the video is silent)"
    add_input(parser, "--sound", what="recording", metavar="FILE", help=sound)
    phones = "phones in time for motion without them: they move tongue and lips where the channels do not"
    add_input(parser, "--units", what="units file", replaceable=True, metavar="FILE", help=phones)
    add_result_arguments(parser, "FILE.mp4 .webm .mov %%05d.png .json .csv .npz .TextGrid .vtt, ... (docs/formats.md)")
    add_pipe_format(parser)
    add_machine_readable(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Read the motion and call ``lipmotion.write``; print the paths that were written."""
    from lipmotion.cli.terminal.progress import reporting

    with reporting(options) as report:
        with written_pipe(options) as pipe:
            _render(options, report)
        written = [] if pipe else options.output
        report.finish("\n".join(map(printable, written)), files=written)


def _render(options: argparse.Namespace, report: Report) -> None:
    import numpy as np

    from lipmotion.pipeline.outputs.drawn_video import shows_face
    from lipmotion.pipeline.outputs.motion_input import as_long_as, read_generation
    from lipmotion.speech.sound.audio_files import read_audio
    from lipmotion.types import Audio

    check_results(options, options.sound)
    generation = read_generation(options.motion, options.units)
    sound = options.sound
    if sound is not None:
        generation = as_long_as(generation, read_audio(sound).duration_s)
    elif any(map(shows_face, map(Path, options.output))):
        samples = round(float(generation.motion.time_s[-1]) * SILENT_HZ)
        sound = Audio(np.zeros(samples, np.float32), SILENT_HZ)
    write_results(options, generation, sound, None, report)


SILENT_HZ = 16_000
"""Rate of the silence of videos without a sound."""
