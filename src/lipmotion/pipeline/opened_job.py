"""Jobs at work: here, and nowhere else, a job's motion is made and its outputs are written."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from lipmotion.errors import InputError
from lipmotion.extensions import provided
from lipmotion.meshes.fitting import driven
from lipmotion.pipeline.edit_files import EditFile, edit_file
from lipmotion.pipeline.generate.posteriors import animate_with_posteriors, check_picture, write_posteriors
from lipmotion.pipeline.job import Job, Outputs
from lipmotion.pipeline.model import Model, load_model
from lipmotion.pipeline.outputs.curve_sets import check_curve_set, curve_names
from lipmotion.pipeline.outputs.motion_files import with_articulation
from lipmotion.pipeline.outputs.output import FilmOptions, Output, OutputSettings, ShownFace, checked_outputs
from lipmotion.pipeline.outputs.write import write_planned
from lipmotion.pipeline.understand.read_request import read_request
from lipmotion.types import Audio, Generation, Monitor, silent_monitor, sub_monitor

RECOGNITION = 0.3
"""The share of the work that is recognition, where a video is drawn, too."""


@dataclass(frozen=True, eq=False)
class OpenedJob:
    """A job with its face, which several recordings share; delivery and staging are those of the edits, too.

    face   : as outputs show it
    curves : what motion files hold instead of the motion: a set, or the character, if it has blendshapes; None: nothing
    edits  : what is changed of the motion
    """

    job: Job
    face: ShownFace
    curves: str | driven.DrivenCharacter | None
    edits: EditFile

    def of(self, recording: Path | None, files: tuple[str, ...] | None = None) -> OpenedJob:
        """Return the same for another recording, and other output files, as of ``Job.of``."""
        return replace(self, job=self.job.of(recording, files))

    def settings(self, speech: Path | Audio | None) -> OutputSettings:
        """Return what outputs hold, and how they show it; ``speech`` as of ``checked``."""
        outputs, staging = self.job.outputs, self.job.staging
        footage = outputs.background if self.face.has_own_background else None
        if outputs.background and not footage:
            staging = replace(staging, background=outputs.background)
        return OutputSettings(
            self.face,
            speech if isinstance(speech, Path) else None,
            not isinstance(speech, Path),
            outputs.channels or None,
            self.curves,
            outputs.motion_hz,
            outputs.fps,
            FilmOptions(
                Path(footage) if footage else None, outputs.jaw, outputs.overlay, outputs.mark, outputs.refinement
            ),
            staging,
            self.job.delivery,
        )

    def checked(self, speech: Path | Audio | None = None) -> Sequence[Output]:
        """Return the outputs of the files. Raises ExportError or InputError: one cannot be written.

        speech : the recording, or the sound; None: there will be a sound that is in no file
        """
        return checked_outputs(self.job.outputs.files, self.settings(speech))

    def write(
        self,
        generation: Generation,
        speech: Path | Audio | None,
        model: Model | None = None,
        *,
        temporary: bool = False,
        monitor: Monitor = silent_monitor,
    ) -> None:
        """Write motion to the files. Raises as ``write``.

        speech, model, temporary : as of ``write``
        """
        if self.job.outputs.articulation:
            generation = with_articulation(generation)
        settings = self.settings(speech)
        if speech is None:
            settings = replace(settings, sounded=False)
        write_planned(
            generation,
            checked_outputs(self.job.outputs.files, settings),
            settings,
            sound=speech if isinstance(speech, Audio) else None,
            model=model,
            temporary=temporary,
            monitor=monitor,
        )

    def run(
        self,
        load: Callable[[], Model] | None = None,
        *,
        words_beside: bool = False,
        temporary: bool = False,
        workers: int = 1,
        monitor: Monitor = silent_monitor,
    ) -> Generation:
        """Animate the recording and write the files; return the motion.

        load         : returns the model; None: it is loaded here
        words_beside : as of ``read_request``
        temporary    : whether the recording is a file that will be gone, which outputs then do not name
        workers      : as of ``animate``
        Raises InputError, ExportError and more: as ``animate`` and ``write``.
        """
        named, picture = self.job.request, self.job.outputs.posteriors
        draws = any(output.draws for output in self.checked(named.recording))
        if picture:
            check_picture(picture, named.recording)
        request, model = read_request(named, words_beside=words_beside), load() if load else load_model(named.model)
        if request.onto is None:
            request = replace(request, onto=self.face.other_person(model, named.speaker))
        if picture:
            generation, posteriors = animate_with_posteriors(request, model=model, edits=self.edits)
            write_posteriors(picture, generation, posteriors)
        else:
            session = self.edits.session(
                request,
                model=model,
                workers=workers,
                monitor=sub_monitor(monitor, 0.0, RECOGNITION if draws else 1.0),
                meanwhile=self.face.load if draws else None,
                curves=curve_names(self.curves) if self.curves else (),
            )
            generation = session.generated(self.edits.edits)
        of_writing = sub_monitor(monitor, RECOGNITION, 1.0)
        self.write(generation, named.recording, model, temporary=temporary, monitor=of_writing)
        return generation


def opened(job: Job) -> OpenedJob:
    """Return a job with its face and character.

    Raises InputError: no such face, character or set of curves. Raises ModelFormatError: as ``shown_face``.
    """
    outputs, edits = job.outputs, edit_file(job.request.edits)
    job = replace(job, delivery=edits.edits.delivery(job.delivery), staging=edits.edits.staging(job.staging))
    if outputs.curves:
        check_curve_set(outputs.curves)
    if outputs.character is None:
        if outputs.lip_points or outputs.binding or outputs.control_points:
            raise InputError("lip points and bindings belong to a character; name it: --character FILE")
        return OpenedJob(job, provided("shown_face")(outputs.face), outputs.curves or None, edits)
    character = character_of(outputs)
    weighed = character if character.shapes is not None else None
    return OpenedJob(job, provided("shown_face")(character), outputs.curves or weighed, edits)


def character_of(outputs: Outputs) -> driven.DrivenCharacter:
    """Return the character that outputs name, from its files. Raises InputError: they cannot be read."""
    return driven.driven_character(
        outputs.character or Path(),
        points=outputs.lip_points,
        binding=outputs.binding,
        by_points=outputs.control_points,
    )
