"""Faces as outputs show them: one interface for drawn faces, characters, cut-outs and filmed people."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from lipmotion.articulation.cue_sheets import list_frame_shapes
from lipmotion.errors import ExportError, InputError
from lipmotion.kernels.compiler import numba_works
from lipmotion.meshes.fitting.driven import DrivenCharacter
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.outputs.cues import check_cue_options, cues
from lipmotion.pipeline.outputs.curve_sets import WEIGHTS
from lipmotion.pipeline.outputs.output import OutputSettings, Performance, ShownFace, measure_prosody, shift_prosody
from lipmotion.storage.sources import check_kind, is_file
from lipmotion.types import Channel, Generation, Motion, Prosody, Timeline
from lipmotion.types.delivery import MOODS
from lipmotion.types.progress import REPORT_INTERVAL, with_progress
from lipmotion.units.phones import OPTIONAL
from lipmotion_faces.base import SMALLEST_PX, Face, Staging
from lipmotion_faces.characters.binding import PosedCharacter
from lipmotion_faces.characters.scene import Scene
from lipmotion_faces.cut_out import CutOut, read_cut_out
from lipmotion_faces.film import filmed_video
from lipmotion_faces.filmed.face import SUFFIX, FilmedFace, load_face
from lipmotion_faces.mesh import MeshFace
from lipmotion_faces.outputs import drawn_video
from lipmotion_faces.outputs.scenes import build_character_scene, build_head_scene
from lipmotion_faces.portrait import DrawnFace
from lipmotion_faces.registry import FACES, is_drawings, make_face, stage_face

LOG = logging.getLogger("lipmotion")
AnyFace = str | Path | Face | FilmedFace | CutOut | PosedCharacter


class _WithHead(ShownFace):
    """A face that is no 3D character: files for 3D programs show the 3D head instead."""

    def check_drawable(self, path: Path, generation: Generation) -> None:
        drawn_video.check_drawable(path, generation.motion)

    def build_scene(
        self, generation: Generation, settings: OutputSettings, prosody: Prosody | None, frames: slice | None = None
    ) -> Scene:
        return build_head_scene(
            generation, settings.outputs.rate_hz, staging=settings.staging, prosody=prosody, frames=frames
        )


class ShownDrawing(_WithHead):
    """A drawing: of ``faces.registry``."""

    def __init__(self, face: Face) -> None:
        self.face = face

    def check(self, settings: OutputSettings) -> None:  # noqa: D102
        filmed_video.refuse_film(settings.outputs)
        stage_face(self.face, settings.staging)

    def check_video(self, path: Path, settings: OutputSettings) -> None:  # noqa: D102
        drawn_video.check_background(path, settings.staging)

    def write_video(self, path: Path, performance: Performance) -> None:  # noqa: D102
        settings, played = performance.settings, performance.cached(drawn_video.load_track)
        others = {edit.channel for edit in performance.generation.curve_edits} - {*WEIGHTS, ""}
        if others and self.character is None:
            named = ", ".join(sorted(others))
            LOG.warning("%s: %s is of a rig that this face has not, and does not show; pin jawOpen", path, named)
        seen, prosody = performance.cached(_deliver), performance.cached(_measure_played_prosody)
        staged = stage_face(self.face, settings.staging, prosody or measure_prosody(played))
        fps = _find_rate(settings)
        count = drawn_video.count_pictures(seen, fps)
        drawn = drawn_video.report_cost(path, staged.render(seen.motion, seen.units, fps=fps), count)
        shown = with_progress(drawn, filmed_video.RENDERING, performance.monitor, count, REPORT_INTERVAL)
        drawn_video.write_frames(path, shown, fps, played)

    def load(self) -> None:  # noqa: D102
        if isinstance(self.face, DrawnFace) and numba_works():  # compiled kernels
            closed = Motion(np.zeros((1, 1)), 1.0, (Channel("opening"),))
            list(self.face.with_staging(Staging(size=SMALLEST_PX)).render(closed, Timeline(())))


class ShownCharacter(ShownDrawing):
    """A character of the user's own."""

    def __init__(self, face: MeshFace) -> None:
        super().__init__(face)
        self.character: PosedCharacter = face.character

    def build_scene(  # noqa: D102
        self, generation: Generation, settings: OutputSettings, prosody: Prosody | None, frames: slice | None = None
    ) -> Scene:
        staging = settings.staging
        return build_character_scene(
            generation, self.character, settings.outputs.rate_hz, staging=staging, prosody=prosody, frames=frames
        )


class ShownCutOut(_WithHead):
    """Pictures, one for each mouth shape: each is shown as long as its cue."""

    def __init__(self, face: CutOut) -> None:
        self.face = face
        self._optional = "".join(name for name in OPTIONAL if name in face.pictures)

    def check(self, settings: OutputSettings) -> None:  # noqa: D102
        filmed_video.refuse_film(settings.outputs)

    def check_video(self, path: Path, settings: OutputSettings) -> None:  # noqa: D102
        drawn_video.check_background(path, settings.staging)
        check_cue_options(_find_rate(settings), None, self._optional)

    def check_drawable(self, path: Path, generation: Generation) -> None:
        """Raise ExportError if a generation has no phones, from which shapes are chosen."""
        if not len(generation.units):
            missing = "the motion has no phones, from which drawings are chosen"
            raise ExportError(f"{path}: {missing}; give them: --units FILE")

    def write_video(self, path: Path, performance: Performance) -> None:  # noqa: D102
        settings, generation, fps = performance.settings, performance.generation, _find_rate(performance.settings)
        sheet = cues(generation, fps=fps, shapes=self._optional, delivery=settings.delivery)
        count = drawn_video.count_pictures(generation, fps)
        shown = list_frame_shapes(sheet)[:count]
        frames = self.face.draw([*shown, *[shown[-1]] * (count - len(shown))], settings.staging)
        sound = performance.cached(drawn_video.load_track)
        drawn_video.write_frames(
            path, with_progress(frames, filmed_video.RENDERING, performance.monitor, count, REPORT_INTERVAL), fps, sound
        )


class ShownPerson(_WithHead):
    """A filmed face, whose mouth and jaw are stitched into footage."""

    has_own_background = True

    def __init__(self, face: FilmedFace) -> None:
        self.face = face

    def check(self, settings: OutputSettings) -> None:  # noqa: D102
        filmed_video.check_film(settings.outputs, settings.recording)
        if settings.staging != Staging():
            raise InputError("size, colour of the background and what moves are of drawn faces; leave them out")

    def check_video(self, path: Path, settings: OutputSettings) -> None:  # noqa: D102
        if settings.delivery.hold_ms:
            instead = "hold those of a drawn face, or of motion files"
            raise InputError(f"the poses of a filmed face cannot be held; {instead}")
        if any(key.mood in MOODS for key in settings.delivery.moods):
            raise InputError(
                "a filmed face has the mood of its footage; leave the mood out, or show a drawn face or a character"
            )
        if path.suffix.lower() != drawn_video.OPAQUE_SUFFIX:
            raise ExportError(f"{path}: filmed faces are written as {drawn_video.OPAQUE_SUFFIX}; name the output so")

    def check_drawable(self, path: Path, generation: Generation) -> None:
        """Log a warning where tags in the words ask for a mood; ``make_film`` names the channels that are needed."""
        moods = [key.label for key in generation.moods if key.mood in MOODS]
        if moods:
            LOG.warning("%s: a filmed face has the mood of its footage; not shown: %s", path, ", ".join(moods))

    def write_video(self, path: Path, performance: Performance) -> None:  # noqa: D102
        settings = performance.settings
        film, sound = self.film(performance), performance.cached(drawn_video.load_track)
        filmed_video.write_film(path, film, sound, mark=settings.outputs.mark, monitor=performance.monitor)

    def film(self, performance: Performance) -> filmed_video.Film:
        """Return the video, which is made while it is read. Raises InputError: the motion lacks channels."""
        settings, seen = performance.settings, performance.cached(_deliver)
        return filmed_video.make_film(
            self.face,
            seen.motion,
            speech=settings.recording,
            sound=performance.cached(drawn_video.load_track),
            model=performance.model,
            units=seen.units,
            fps=settings.outputs.fps,
            options=settings.outputs,
        )

    def find_other_person(self, model: Model, speaker: str = "") -> FilmedFace | None:  # noqa: D102
        return filmed_video.find_other_person(model, self.face, speaker)


def shown_face(face: AnyFace | ShownFace) -> ShownFace:
    """Return a face as outputs show it, by name, path or value. Raises InputError, ModelFormatError: no such face."""
    if isinstance(face, ShownFace):
        return face
    if isinstance(face, PosedCharacter):
        return ShownCharacter(MeshFace(face))
    opened: Face | FilmedFace | CutOut
    if isinstance(face, Face | FilmedFace | CutOut):
        opened = face
    elif is_drawings(face):
        opened = read_cut_out(Path(face))
    elif Path(face).suffix.lower() == SUFFIX:
        opened = load_face(face)
    else:
        check_kind(Path(face), "face")
        sibling = Path(f"{face}{SUFFIX}")
        if str(face) not in FACES.names and is_file(sibling):
            raise InputError(f"no drawn face {str(face)!r}; for the filmed face give its file: {sibling}")
        opened = make_face(str(face))
    if isinstance(opened, CutOut):
        return ShownCutOut(opened)
    if isinstance(opened, FilmedFace):
        return ShownPerson(opened)
    return ShownCharacter(opened) if isinstance(opened, MeshFace) else ShownDrawing(opened)


def _deliver(performance: Performance) -> Generation:
    settings = performance.settings
    character = settings.curves if isinstance(settings.curves, DrivenCharacter) else None
    if performance.generation.curve_edits:
        character = character or settings.face.character
    prosody = performance.cached(_measure_played_prosody) if performance.generation.curve_edits else None
    hertz, staging = _find_rate(settings), settings.staging
    return drawn_video.deliver_to_face(performance.generation, settings.delivery, hertz, character, staging, prosody)


def _measure_played_prosody(performance: Performance) -> Prosody:
    """Return loudness and pitch of the sound track, in the time of the motion."""
    return shift_prosody(measure_prosody(performance.cached(drawn_video.load_track)), performance.settings.delivery)


def _find_rate(settings: OutputSettings) -> float:
    return settings.outputs.fps or drawn_video.DRAWN_HZ
