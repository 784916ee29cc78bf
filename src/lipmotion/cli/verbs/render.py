"""``lipmotion render``: draw motion of a file, edited or imported, or write it in another form."""

from __future__ import annotations

import argparse
import logging
from dataclasses import replace
from pathlib import Path

from lipmotion.cli.arguments.declared import add_options, add_outputs, add_pipe_format, pick_part, write_pipe
from lipmotion.cli.arguments.options import add_machine_readable, add_verb
from lipmotion.cli.terminal.progress import report_progress
from lipmotion.errors import InputError
from lipmotion.extensions import load_provided
from lipmotion.pipeline.job import Job, check_outputs, open_face, write_job_outputs
from lipmotion.pipeline.job import run as run_job
from lipmotion.pipeline.request import Request
from lipmotion.printable import printable
from lipmotion.storage.sources import is_file

LOG = logging.getLogger("lipmotion")
SILENT_HZ = 16_000  # rate of the silence of videos without a sound


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = add_verb(verbs, __package__, "render", run)
    phones = "phones in time for motion without them: they move tongue and lips where the channels do not"
    add_options(parser, Request, "units", units={"help": phones})
    add_outputs(parser, "FILE.mp4 .webm .mov %%05d.png .json .csv .npz .TextGrid .vtt, ... (docs/formats.md)")
    add_pipe_format(parser)
    add_machine_readable(parser)


def run(options: argparse.Namespace) -> None:
    """Read the motion and call ``lipmotion.write``; print the paths that were written.

    The motion of a file of edits is generated again, and its outputs are written as ``animate`` does.
    """
    from lipmotion.pipeline.edit_files import is_edit_file, read_edits

    with report_progress(options) as report:
        with write_pipe(options) as (files, pipe):
            path = options.motion
            if is_edit_file(path):
                job, edits = pick_part(options, Job()).of(options.sound, files), read_edits(path)
                if job.request.recording or job.request.units:
                    raise InputError(f"{path}: names its recording and holds its phones; leave --sound and --units out")
                if edits.named.recording is None:
                    raise InputError(f"{path}: names no recording; give it: lipmotion animate RECORDING --edits {path}")
                run_job(replace(job, request=replace(edits.named, edits=path)), monitor=report.receive)
            else:
                job = pick_part(options, Job()).of(options.sound or _find_sound(path), files)
                import numpy as np

                from lipmotion.pipeline.outputs.motion_files import match_duration, read_generation
                from lipmotion.speech.sound.audio_files import read_audio
                from lipmotion.types import Audio

                sound, face = job.request.recording, open_face(job.outputs)
                planned = check_outputs(job, face, sound)
                generation = read_generation(path, job.request.units, options.motion_rate)
                if isinstance(sound, Path):
                    generation = match_duration(
                        generation, read_audio(sound).duration_s, keeps_rate=options.motion_rate is not None
                    )
                elif any(output.draws for output in planned):
                    samples = round(float(generation.motion.time_s[-1]) * SILENT_HZ)
                    sound = Audio(np.zeros(samples, np.float32), SILENT_HZ)
                write_job_outputs(job, face, generation, sound, monitor=report.receive)
        written = [] if pipe else list(files)
        report.finish("\n".join(map(printable, written)), files=written)


def _find_sound(motion: Path) -> Path | None:
    """Return the sound that a glTF file of motion names, where it is there and begins with the motion."""
    has_name = motion.suffix.lower() == ".glb" and is_file(motion)
    named = load_provided("find_named_sound")(motion) if has_name else None
    if named is None:
        return None
    sound, start_s = named
    if not start_s and is_file(sound):
        return sound
    why = "is not there" if not start_s else f"begins at {start_s:g} s of the motion"
    LOG.warning("%s: its sound %s %s; give a sound: --sound FILE", motion, sound, why)
    return None
