"""``lipmotion render``: draw motion of a file, edited or imported, or write it in another form."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from lipmotion.cli.arguments.declared import add_options, add_outputs, part_of
from lipmotion.cli.arguments.options import add_machine_readable
from lipmotion.cli.arguments.paths import add_input
from lipmotion.cli.arguments.pipes import add_pipe_format, written_pipe
from lipmotion.pipeline.job import Job, Request
from lipmotion.printable import printable

if TYPE_CHECKING:
    from lipmotion.pipeline.opened_job import OpenedJob
    from lipmotion.types import Monitor


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = verbs.add_parser("render", help="draw edited or imported motion, or write it in another form")
    motion = "motion file: .json .csv .npz, or another that can be read; of channels 'opening' or blendshapes"
    add_input(parser, "motion", what="motion file", replaceable=True, help=motion)
    sound = "the sound of videos (default: none; the video is silent)"
    add_input(parser, "--sound", what="recording", metavar="FILE", help=sound)
    phones = "phones in time for motion without them: they move tongue and lips where the channels do not"
    add_options(parser, Request, "units", units={"help": phones})
    add_outputs(parser, "FILE.mp4 .webm .mov %%05d.png .json .csv .npz .TextGrid .vtt, ... (docs/formats.md)")
    add_pipe_format(parser)
    add_machine_readable(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Read the motion and call ``lipmotion.write``; print the paths that were written."""
    from lipmotion.cli.terminal.progress import reporting
    from lipmotion.pipeline.opened_job import opened

    with reporting(options) as report:
        with written_pipe(options) as (files, pipe):
            job = opened(part_of(options, Job()).of(options.sound, files))
            _render(job, options.motion, report.receive)
        written = [] if pipe else list(files)
        report.finish("\n".join(map(printable, written)), files=written)


def _render(job: OpenedJob, motion: Path, monitor: Monitor) -> None:
    import numpy as np

    from lipmotion.pipeline.outputs.drawn_video import VideoOutput
    from lipmotion.pipeline.outputs.motion_input import as_long_as, read_generation
    from lipmotion.speech.sound.audio_files import read_audio
    from lipmotion.types import Audio

    sound: Path | Audio | None = job.job.request.recording
    planned = job.checked(sound)
    generation = read_generation(motion, job.job.request.units)
    if isinstance(sound, Path):
        generation = as_long_as(generation, read_audio(sound).duration_s)
    elif any(isinstance(output, VideoOutput) for output in planned):
        samples = round(float(generation.motion.time_s[-1]) * SILENT_HZ)
        sound = Audio(np.zeros(samples, np.float32), SILENT_HZ)
    job.write(generation, sound, monitor=monitor)


SILENT_HZ = 16_000
"""Rate of the silence of videos without a sound."""
