"""A job: a recording, what is made of it, and how; and ``run``, the one place where a job is done.

A job is the same value from the command line, a file and Python. Nothing is read or imported before it runs.
"""
# ruff: noqa: RUF009 (``option`` returns the field of a dataclass)

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from lipmotion.errors import ExportError, InputError
from lipmotion.extensions import load_provided
from lipmotion.pipeline.request import Outputs, Request, locate_paths
from lipmotion.storage.files import make_portable
from lipmotion.storage.json_text import read_toml
from lipmotion.storage.sources import check_listable, is_recording
from lipmotion.types.configuration import Configuration, option
from lipmotion.types.delivery import Delivery, Staging
from lipmotion.types.progress import Monitor, silent_monitor, sub_monitor

if TYPE_CHECKING:
    from lipmotion.meshes.fitting.driven import DrivenCharacter
    from lipmotion.pipeline.model import Model
    from lipmotion.pipeline.outputs.output import Output, OutputSettings, ShownFace
    from lipmotion.types import Audio, Generation

RECOGNITION = {True: 0.3, False: 0.6}  # the share of the work that is motion, where a video is drawn, and where none


@dataclass(frozen=True)
class Job(Configuration):
    """A recording, what is made of it, and how (docs/api.md); of a batch, of every one of its recordings.

    >>> import lipmotion, tempfile
    >>> request = lipmotion.Request("examples/welcome.flac", recogniser="fast")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     lipmotion.Job(request, lipmotion.Outputs((f"{folder}/a.csv",))).run().motion.rate_hz
    100.0
    """

    request: Request = option(Request())
    outputs: Outputs = option(Outputs())
    delivery: Delivery = option(Delivery())
    staging: Staging = option(Staging())

    @classmethod
    def from_file(cls, path: str | Path) -> Job:
        """Return the job of a TOML file: a table for each part, with the names of its fields (docs/api.md).

        Paths begin at the folder of the file.
        Raises InputError: no such file, no TOML, an unknown name, a value that is not allowed, or Python 3.10.
        """
        members = read_toml(Path(path), "job", "give the options themselves")
        try:
            return cls.parsed(members).at(Path(path).parent)
        except InputError as error:
            raise InputError(f"{path}: {error}") from error

    def of(self, recording: str | Path | Audio | None, files: tuple[str, ...] | None = None) -> Job:
        """Return the same job for another recording; with other output files, if some are given."""
        outputs = self.outputs if files is None else replace(self.outputs, files=files)
        return replace(self, request=replace(self.request, recording=recording), outputs=outputs)

    def at(self, folder: Path) -> Job:
        """Return the same job with paths that begin at a folder."""
        files = [file if file == "-" else f"{folder / file}{'/' * file.endswith('/')}" for file in self.outputs.files]
        outputs = replace(locate_paths(self.outputs, folder), files=tuple(files))
        return replace(self, request=locate_paths(self.request, folder), outputs=outputs)

    def run(self, *, workers: int = 1) -> Generation:
        """Animate the recording and write the files, as ``lipmotion animate``; return the motion. As ``run``."""
        return run(self, workers=workers)


DETAILS = {
    "film": Job(),
    "game": Job(outputs=Outputs(rate_hz=30.0), delivery=Delivery(key_tolerance=0.01)),
    "mobile": Job(
        outputs=Outputs(rate_hz=30.0), delivery=Delivery(key_tolerance=0.04), staging=Staging(gaze=False, brows=False)
    ),
}
"""Levels of detail, and the options that each sets; what each loses: docs/controls.md."""


def run(  # noqa: PLR0913
    job: Job,
    *,
    face: ShownFace | None = None,
    model: Model | None = None,
    words_beside: bool = False,
    is_typed: bool = True,
    temporary: bool = False,
    workers: int = 1,
    monitor: Monitor = silent_monitor,
) -> Generation:
    """Animate the recording of a job and write its files; return the motion.

    face         : of ``open_face``, where several jobs share it; None: that of the job
    model        : where it is loaded already; None: that of the job
    words_beside, is_typed : as of ``read_request``
    temporary    : whether the recording is a file that will be gone, which outputs then do not name
    workers      : as of ``animate``
    Raises InputError, ExportError and more: as ``animate`` and ``write``, or there is no recording.
    """
    from lipmotion.pipeline.analysis.read_request import read_request
    from lipmotion.pipeline.edit_files import edit_file
    from lipmotion.pipeline.generate.animate import animate
    from lipmotion.pipeline.model import load_model
    from lipmotion.pipeline.outputs.curve_sets import list_curve_names

    edits, recording = edit_file(job.request.edits), job.request.recording
    job = replace(job, delivery=edits.edits.delivery(job.delivery), staging=edits.edits.staging(job.staging))
    face = face or open_face(job.outputs)
    draws = any(output.draws for output in check_outputs(job, face, recording))  # refused before the long work

    request = read_request(job.request, words_beside=words_beside, is_typed=is_typed)
    model = model or load_model(request.model)
    if request.onto is None:
        request = replace(request, onto=face.find_other_person(model, job.request.speaker))
    curves = choose_curves(job.outputs, face)
    generation = animate(
        request,
        model=model,
        edits=edits,
        workers=workers,
        monitor=sub_monitor(monitor, 0.0, RECOGNITION[draws]),
        background=face.load if draws else None,
        curves=list_curve_names(curves) if curves else (),
    )
    writing = sub_monitor(monitor, RECOGNITION[draws], 1.0)
    write_job_outputs(job, face, generation, recording, model=model, temporary=temporary, monitor=writing)
    return generation


def open_face(outputs: Outputs) -> ShownFace:
    """Return the face or the character of outputs, as they show it.

    Raises InputError: no such face, character or set of curves. Raises ModelFormatError: as ``shown_face``.
    """
    from lipmotion.pipeline.outputs.curve_sets import check_curve_set

    if outputs.curves:
        check_curve_set(outputs.curves)
    if outputs.character is None and (outputs.lip_points or outputs.binding or outputs.control_points):
        raise InputError("lip points and bindings belong to a character; name it: --character FILE")
    face: ShownFace = load_provided("shown_face")(
        outputs.face if outputs.character is None else open_character(outputs)
    )
    return face


def open_character(outputs: Outputs) -> DrivenCharacter:
    """Return the character that outputs name, from its files. Raises InputError: they cannot be read."""
    character: DrivenCharacter = load_provided("load_character")(
        outputs.character or Path(),
        points=outputs.lip_points,
        binding=outputs.binding,
        by_points=outputs.control_points,
    )
    return character


def choose_curves(outputs: Outputs, face: ShownFace) -> str | DrivenCharacter | None:
    """Return what motion files hold instead of the motion: a set, or a character with blendshapes; None: nothing."""
    character = face.character if outputs.character is not None else None
    return outputs.curves or (character if character is not None and character.shapes is not None else None)


def to_output_settings(job: Job, face: ShownFace, speech: str | Path | Audio | None) -> OutputSettings:
    """Return what the outputs of a job hold, and how they show it.

    speech : the recording, or the sound; None: there will be a sound that is in no file
    """
    from lipmotion.pipeline.outputs.output import OutputSettings

    outputs, staging = replace(job.outputs, rate_hz=job.outputs.motion_hz), job.staging
    if outputs.background and not face.has_own_background:
        staging, outputs = replace(staging, background=str(outputs.background)), replace(outputs, background=None)
    recording = Path(speech) if isinstance(speech, str | Path) else None
    curves = choose_curves(outputs, face)
    return OutputSettings(face, recording, recording is None, outputs, curves, staging, job.delivery)


def check_outputs(job: Job, face: ShownFace, speech: str | Path | Audio | None = None) -> list[Output]:
    """Return the outputs of a job's files. Raises ExportError or InputError: one cannot be written.

    speech : as of ``to_output_settings``
    """
    from lipmotion.pipeline.outputs.output import create_outputs

    return create_outputs(job.outputs.files, to_output_settings(job, face, speech))


def write_job_outputs(
    job: Job,
    face: ShownFace,
    generation: Generation,
    speech: str | Path | Audio | None,
    *,
    model: Model | None = None,
    temporary: bool = False,
    monitor: Monitor = silent_monitor,
) -> None:
    """Write motion to the files of a job. Raises as ``write``.

    speech, model, temporary : as of ``write``
    """
    from lipmotion.pipeline.outputs.motion_files import with_articulation
    from lipmotion.pipeline.outputs.output import Performance, write_performance
    from lipmotion.types import Audio

    if job.outputs.articulation:
        generation = with_articulation(generation)
    settings = replace(to_output_settings(job, face, speech), sounded=isinstance(speech, Audio))
    sound = speech if isinstance(speech, Audio) else None
    performance = Performance(generation, settings, sound, settings.recording, model, monitor)
    write_performance(performance, job.outputs.files, temporary=temporary)


NAME = "{name}"  # in the path of an output, the name of the recording without its suffix


def list_recordings(paths: Sequence[Path]) -> list[Path]:
    """Return recordings: files as they are, and of folders the sounds and videos in them, sorted by name.

    Raises InputError: a folder without recordings, or one that cannot be read.
    """
    recordings: list[Path] = []
    for path in paths:
        inside = [path]
        if path.is_dir():
            check_listable(path)
            inside = sorted(filter(is_recording, path.iterdir()))
            if not inside:
                raise InputError(f"{path}: no sounds and no videos in it; give a folder of recordings")
        recordings += inside
    return recordings


def is_for_several(output: str) -> bool:
    """Return whether an output is a place for many files: a path with ``{name}``, or a folder.

    A folder that is called as a file is, as ``a.json``, is one only if the path ends with a slash.
    """
    is_folder = os.path.isdir(output)  # noqa: PTH112 (a name that is too long is no folder, and no error here)
    return NAME in output or output.endswith(("/", os.sep)) or (is_folder and not Path(output).suffix)


def plan_outputs(recordings: Sequence[Path], outputs: Sequence[str], kinds: Sequence[str]) -> list[list[str]]:
    """Return the outputs of each recording.

    outputs : folders, for which every kind is written, and paths with ``{name}``; of one recording, files, too
    kinds   : suffixes without the dot, as ``json``
    Raises ExportError: an output is none of these, or two recordings would be written to one file.
    """
    templates: list[str] = []
    for output in outputs:
        is_file = not is_for_several(output)
        if is_file and (len(recordings) > 1 or output == "-"):
            several = f"there are {len(recordings)} recordings" if len(recordings) > 1 else "no folder"
            example = f"'out/{NAME}{Path(output).suffix or '.json'}'"
            raise ExportError(f"{output}: is one file, and {several}; give a folder, as out/, or a name, as {example}")
        templates += [output] if is_file or NAME in output else [str(Path(output) / f"{NAME}.{kind}") for kind in kinds]
    planned = [[each.replace(NAME, recording.stem) for each in templates] for recording in recordings]
    named = [part for template in templates for part in Path(template).parts if NAME in part]
    for recording in recordings:
        for name in (part.replace(NAME, recording.stem) for part in named):
            if make_portable(name) != name:
                raise ExportError(f"{name}: no name of a file on Windows; rename {recording}, or name the output")
    seen: dict[str, Path] = {}
    for recording, files in zip(recordings, planned, strict=True):
        for file in files:
            other = seen.setdefault(os.path.realpath(file), recording)
            if other != recording:
                raise ExportError(f"{file}: would be written for {other} and for {recording}; rename one of them")
    return planned
