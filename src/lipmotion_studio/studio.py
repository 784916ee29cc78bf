"""The studio: a project, the lines of it that are at work, its faces, what is exported."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import fields, replace
from pathlib import Path
from threading import Lock
from typing import Any
from uuid import uuid4

from starlette.exceptions import HTTPException

from lipmotion.errors import InputError, LipMotionError, shorten
from lipmotion.extensions import installed_version
from lipmotion.formats.sound import write_sound
from lipmotion.pipeline.edit_files import write_edits
from lipmotion.pipeline.edits import FORMS, Step, Text, WordIs, WordSaid, WordsSaid, WordsSaidSo, parse_step
from lipmotion.pipeline.job import Job, check_outputs, open_face, run
from lipmotion.pipeline.outputs.curve_sets import SHAPE_SETS
from lipmotion.pipeline.request import Outputs
from lipmotion.storage.files import TEMPORARY, create_folders, remove, sha256_of, temporary_folder
from lipmotion.types.configuration import ANY, kind_of
from lipmotion.types.delivery import Delivery
from lipmotion.types.moods import MANNERS, MOODS
from lipmotion.types.staging import Staging
from lipmotion.units import PHONES, Pronunciation, is_silent, words_of
from lipmotion_faces.base import Face
from lipmotion_faces.outputs.drawn_video import VideoOutput, read_sound
from lipmotion_studio.desk import FAILED, READY, WAITING, WORKING, Desk, NotReadyError, Work
from lipmotion_studio.folder import EXPORTS, NO_EDITS, ProjectFolder, check_revision, revision_of
from lipmotion_studio.known_model import KnownModel, known_model
from lipmotion_studio.line import LONGEST_VIDEO_S, OpenLine
from lipmotion_studio.meshes import Faces
from lipmotion_studio.presets import PRESETS, Preset, suffixes
from lipmotion_studio.project import EDITS_SUFFIX, MARKS, ExportRecord, Project, ProjectLine, digest_of
from lipmotion_studio.recorded_videos import MP4, played_as, sound_begins_s, video_of, write_playable
from lipmotion_studio.trainer import VOICES, Trainer
from lipmotion_studio.training import FACE, VOICE
from lipmotion_studio.votes import Side

LOG = logging.getLogger("lipmotion")
ORDERS = ("", "doubt")
OTHER = "other"
"""What requests call the model that the project's is compared with."""


class Studio:
    """A project that is open.

    folder : the project
    used   : the model that moves its lines; None: as the project says
    against : a model with which its motion is compared; None: there is none
    """

    def __init__(
        self, folder: ProjectFolder, used: KnownModel | None = None, against: KnownModel | None = None
    ) -> None:
        self.folder, self.against = folder, against
        self._videos: dict[Path, tuple[Path, float] | None] = {}
        self._writing_video = Lock()
        self.used = used or known_model(_model_file(folder))
        self.desk = Desk(folder, self.used.model)
        places = {name: Path(os.path.normpath(folder.path / file)) for name, file in folder.project.characters.items()}
        self.trainer = Trainer(folder)
        self.faces = Faces(places, lambda: self.trainer.made(FACE))
        self._kept = ExitStack()
        self._sounds = self._kept.enter_context(temporary_folder())
        self._exporting: dict[str, int] | None = None

    def close(self) -> None:
        """Write what is not written, and remove what was kept for this run alone."""
        self.trainer.close()
        self.desk.close()
        self._kept.close()

    def number(self, given: str) -> int:
        """Return the number of a line that an address gives. Raises HTTPException: there is no such line."""
        number = int(given) if given.isascii() and given.isdecimal() and len(given) < 10 else 0
        if number not in self.folder.project.lines:
            raise HTTPException(404, "no such line")
        return number

    def listed(self, first: int, count: int, *, order: str = "", status: str = "", mark: str = "") -> dict[str, Any]:
        """Return the project, and so many of its lines from one on, for the list.

        order  : ``doubt``: what is least sure first; empty: that of the project
        status, mark : only lines with these; empty: all
        """
        if order not in ORDERS:
            raise InputError(f"order is {shorten(repr(order))}, required doubt, or nothing")
        with self.folder.lock:
            project, revision = self.folder.project, self.folder.revision
        lines = [
            line
            for line in project.lines.values()
            if (not mark or line.mark == mark) and (not status or self.desk.status(line) == status)
        ]
        if order == "doubt":
            lines.sort(key=lambda line: -1.0 if line.doubt is None else line.doubt, reverse=True)
        return {
            "name": self.folder.path.absolute().name,
            "folder": str(self.folder.path.absolute()),
            "revision": revision,
            "count": len(lines),
            "from": first,
            "lines": [self.row(line) for line in lines[first : first + count]],
            "forms": self.forms(),
            "version": installed_version(),
            "model": {"name": self.used.name, "engine": self.used.model.engine.name},
        }

    def row(self, line: ProjectLine) -> dict[str, Any]:
        """Return what the list says of a line, which may have left the project meanwhile."""
        summary = self.folder.summary(line)
        made = (summary.digest, self.used.digest)
        changed = bool(line.exports) and (line.exports[-1].steps, line.exports[-1].model) != made
        return {
            "id": line.number,
            "name": line.name,
            "status": self.desk.status(line),
            "revision": revision_of(line, summary),
            "mark": line.mark,
            "marked": line.marked,
            "edits_digest": summary.digest,
            "doubt": line.doubt,
            "duration_s": line.duration_s,
            "edits": summary.count,
            "exported": "changed" if changed else "yes" if line.exports else "no",
            "error": self.desk.error(line),
        }

    def line_document(self, number: int) -> dict[str, Any]:
        """Return what is said of a line, ready or not."""
        with self.folder.lock:
            line, work = self.folder.line(number), self.desk.work(number)
            known: dict[str, Any] = {"id": number, "name": line.name, "mark": line.mark, "transcript": line.transcript}
            known["revision"] = revision_of(line, self.folder.summary(line))
        known["versions"] = [
            {"name": each.name, "number": each.number, "edits": len(each.steps), "digest": each.digest}
            for each in line.versions
        ]
        status, error = self.desk.status(line), self.desk.error(line)
        if work is None or status == FAILED:
            restorable = status == FAILED and self.folder.is_restorable(line)
            return known | {"status": status, "progress": None, "error": error, "restorable": restorable}
        status = WORKING if work.status == READY and work.line is None else work.status
        return known | {"status": status, "progress": _progress(work), "error": work.error}

    def progress(self) -> dict[str, Any]:
        """Return which lines wait, or are at work, or were until a short while ago."""
        works = self.desk.at_work()
        lines = [{"id": work.number, "status": work.status, **_progress(work), "error": work.error} for work in works]
        waiting = sum(work.status == WAITING for work in works)
        told = {"lines": lines, "waiting": waiting, "revision": self.folder.revision, "export": self._exporting}
        return told | {"training": self.trainer.short_document()}

    def voices(self) -> dict[str, str]:
        """Return the models that the project may use by name, as paths from its folder; of the one that ships empty.

        The names are those of files; that of the one that ships is empty.
        """
        project = self.folder.project
        own = {name: path.relative_to(self.folder.path).as_posix() for name, path in self.trainer.made(VOICE).items()}
        others = [path for path in (project.given_model, project.model) if path and path not in own.values()]
        return {"": ""} | {Path(path).name: path for path in others} | own

    def voice_model(self, name: str) -> tuple[str, KnownModel]:
        """Return path and model of a voice. Raises InputError: none of that name. Others as ``load_model``."""
        known = self.voices()
        if name not in known:
            raise InputError(f"no voice {shorten(repr(name))}; required one of: {', '.join(filter(None, known))}")
        file = Path(os.path.normpath(self.folder.path / known[name])) if known[name] else None
        return known[name], known_model(file)

    def use_voice(self, path: str, voice: KnownModel, revision: int) -> None:
        """Let another model move the lines of the project, from now on; their phones and edits stay.

        path     : from the folder of the project; empty: the one that ships
        revision : of the voice, as it was seen
        Raises RevisionError: another one is used since. ExportError: the project cannot be written.
        """

        def with_model(project: Project) -> Project:
            check_revision("the voice", self.folder.voice_revision, revision)
            given = project.model if self.is_given(project.model) else project.given_model
            return replace(project, model=path, given_model=given)

        self.folder.change(with_model)
        self.used = voice
        self.desk.use(voice.model)

    def is_given(self, path: str) -> bool:
        """Return whether a model was given, and not trained here."""
        return bool(path) and not path.startswith(f"{VOICES}/")

    def forms(self) -> dict[str, Any]:
        """Return what can be chosen, from the registries and configurations."""
        return {
            "phones": [{"name": phone, "silent": is_silent(phone)} for phone in PHONES],
            "moods": list(MOODS),
            "manners": list(MANNERS),
            "faces": [
                {"name": name, "title": name, "mesh": mesh, "filmed": self.faces.is_filmed(name)}
                for name, mesh in self.faces.names.items()
            ],
            "against": self.against.name_beside(self.used) if self.against else None,
            "curve_sets": list(SHAPE_SETS),
            "presets": [
                {"name": each.name, "title": each.title, "files": list(each.files)} for each in PRESETS.values()
            ],
            "preset": self.folder.project.preset,
            "suffixes": list(suffixes()),
            "edit_forms": list(FORMS),
            "controls": list(_controls()),
            "marks": list(MARKS),
            "longest_video_s": LONGEST_VIDEO_S,
        }

    def understand(self, numbers: Sequence[int] | None) -> int:
        """Let lines be understood; None: all that are new. Returns how many wait. Raises HTTPException: no such."""
        known = self.folder.project.lines
        if numbers is not None and not set(numbers) <= known.keys():
            raise HTTPException(404, "no such line")
        return self.desk.queue(known if numbers is None else numbers)

    @contextmanager
    def arriving(self) -> Iterator[Path]:
        """Give the path of a file that something dropped is written to; afterwards it is gone."""
        path = self.folder.path / f"{TEMPORARY}{uuid4().hex}"
        try:
            yield path
        finally:
            remove(path)

    def with_pronunciations(self, sentences: Sequence[str]) -> tuple[str | Step, ...]:
        """Return edits that say words of the project's lexicon with their phones, which then stand in the edits.

        Raises InputError: a sentence is no edit.
        """
        steps = [parse_step(sentence) for sentence in sentences]
        if not any(isinstance(step, WordIs | WordsSaid) for step in steps):
            return tuple(steps)
        own = self.folder.lexicon().user
        return tuple(_pronounced(step, own) for step in steps)

    def say(self, number: int, revision: int, transcript: str) -> bool:
        """Let a line without edits be understood again, with its words; without any, they are recognised.

        Returns whether it has no edits; else nothing has been done.
        Raises NotReadyError: it is being understood. RevisionError: somebody else has changed it. InputError: its edits
        are damaged. ExportError: it cannot be written.
        """
        with self.folder.changing(number, revision) as line:
            if self.desk.status(line) in (WAITING, WORKING):
                raise NotReadyError
            if self.folder.has_edits(line):
                return False
            self.folder.remove_edits(line)
            self.folder.change_line(number, lambda now: replace(now, transcript=transcript.strip()))
            self.desk.forget(number)
        self.desk.opened(number)
        return True

    def mark(self, number: int, revision: int, mark: str) -> dict[str, Any]:
        """Mark a line as its edits are now; return what the list says of it.

        Raises InputError: no such mark, or its edits are damaged. RevisionError: somebody else has changed it.
        """
        with self.folder.changing(number, revision) as line:
            self.folder.has_edits(line)  # which is refused where they are damaged
            marked = replace(line, mark=mark, marked=self.folder.summary(line).digest)
            self.folder.change_line(number, lambda _: marked)
            return self.row(marked)

    def remove(self, number: int, revision: int) -> None:
        """Take a line out of the project; its files stay where they are. Raises RevisionError: it has been changed."""
        with self.folder.changing(number, revision):
            self.folder.change(lambda project: project.without_line(number))
            self.desk.forget(number)

    def restore(self, number: int, revision: int) -> None:
        """Put the last good copy in the place of a line's damaged edits, and open it.

        Raises InputError: they are not damaged, or there is no copy. RevisionError: somebody else has changed it.
        """
        with self.folder.changing(number, revision) as line:
            self.folder.restore_edits(line)
            self.desk.forget(number)
        self.desk.opened(number)

    def drawn(self, name: str) -> str | Face:
        """Return a face of which pictures are drawn. Raises InputError: there is none of that name, or a filmed one."""
        if self.faces.is_filmed(name):
            raise InputError("a filmed face is made as a video, not picture by picture; make the video of a selection")
        shown = self.faces.shown(name)
        return getattr(shown, "face", name)

    def played(self, number: int) -> Path:
        """Return the path of a line's sound as it is played. Raises InputError: it cannot be read, or is another."""
        path, sound = self._sounds / f"{number}.wav", self.folder.checked_sound(self.folder.line(number))
        if not path.exists():
            write_sound(path, read_sound(sound))
        return path

    def video_of(self, number: int) -> tuple[Path, float] | None:
        """Return the path of a line's real video, and when in it the line's sound begins [s]; None: there is none."""
        recording = self.folder.sound(self.folder.line(number))
        if recording not in self._videos:
            video = video_of(recording)
            self._videos[recording] = (video, sound_begins_s(video, recording)) if video else None
        return self._videos[recording]

    def played_video(self, number: int) -> tuple[Path, str]:
        """Return the path of a line's real video as browsers play it, and its media type.

        Raises HTTPException: it has none. InputError: it cannot be read.
        """
        video, _ = self.video_of(number) or (None, 0.0)
        if video is None or not video.is_file():
            raise HTTPException(404, "the line has no video")
        kind = played_as(video)
        if kind is not None:
            return video, kind
        path = self._sounds / f"{number}.mp4"
        with self._writing_video:
            if not path.exists():
                write_playable(video, self.folder.sound(self.folder.line(number)), path)
        return path, MP4

    def line_as(self, number: int, line: OpenLine, by: str, face: str = "") -> OpenLine:
        """Return an open line as it once was, or as the other model moves it, or mapped onto another person.

        by   : the name of a version that was kept; ``OTHER``: the model it is compared with; empty: the line as it is
        face : the name of the face that is shown; a filmed one may be of another person
        Raises InputError: there is no such version or model, or it cannot make an edit.
        """
        if by not in ("", OTHER):
            return self.line_as(number, line.with_edits(self.folder.line(number).version(by).steps), "", face)
        model = self._called(by).model
        onto = self.faces.shown(face).other_person(model, line.file.named.speaker) if face else None
        return line if model is self.used.model and onto is None else line.moved_by(model, onto)

    def side(self, number: int, by: str) -> Side:
        """Return what identifies a motion of a line in a comparison; ``by``: as in ``line_as``. Raises as that."""
        if by not in ("", OTHER):
            return Side(self.used.name, self.used.digest, self.folder.line(number).version(by).digest)
        model = self._called(by)
        return Side(model.name, model.digest, self.folder.summary(self.folder.line(number)).digest)

    def _called(self, by: str) -> KnownModel:
        """Return the model that requests call so. Raises InputError: there is none."""
        if not by:
            return self.used
        if self.against is None:
            raise InputError("there is no other model; give it: lipmotion studio --against FILE")
        return self.against

    def export(self, number: int, preset: Preset, face: str = "") -> dict[str, Any]:
        """Write files of a line, and record what was written from which edits; return their paths.

        face : the name of that which videos show; empty: the usual one
        Raises InputError: it is not understood yet, its edits are damaged, its sound is another one, or there is no
        such face. ExportError: a file cannot be written.
        Others as ``Job.run``.
        """
        line = self.folder.line(number)
        if self.folder.summary(line) is NO_EDITS:
            raise InputError(f"{line.name}: is not understood yet; open it first")
        out = self.folder.path / EXPORTS
        copy = out / f"{line.name}.{EDITS_SUFFIX}"
        files = tuple(str(out / f"{line.name}{suffix}") for suffix in preset.files)
        file = replace(self.folder.read_edits(line), undone=(), sha256=line.sha256)
        with create_folders([copy.parent]):
            write_edits(file, copy)
            request = replace(file.named, recording=self.folder.checked_sound(line), edits=copy)
            outputs = Outputs(files, curves=preset.curves, fps=preset.fps)
            job, shown = Job(request, outputs), open_face(outputs)
            if face and any(isinstance(each, VideoOutput) for each in check_outputs(job, shown, request.recording)):
                shown = self.faces.shown(face)
            run(job, face=shown, model=self.used.model)
        digests = {Path(path).relative_to(self.folder.path).as_posix(): sha256_of(Path(path)) for path in files}
        record = ExportRecord(
            preset.name,
            digests,
            copy.relative_to(self.folder.path).as_posix(),
            digest_of(file.edits.sentences),
            self.used.digest,
            installed_version(),
        )
        self.folder.change_line(number, lambda now: _with_export(now, record))
        return {"id": number, "files": list(digests), "edits": record.edits}

    def export_several(self, numbers: Sequence[int], preset: Preset, face: str = "") -> dict[str, Any]:
        """Write files of several lines, as ``export``; what fails is told, and the others are written."""
        exported, failed = [], []
        try:
            for done, number in enumerate(numbers):
                self._exporting = {"done": done, "count": len(numbers)}
                try:
                    exported.append(self.export(number, preset, face))
                except LipMotionError as error:
                    failed.append({"id": number, "error": str(error)})
        finally:
            self._exporting = None
        self.folder.change(lambda project: replace(project, preset=preset.name or project.preset))
        return {"exported": exported, "failed": failed}


def _pronounced(step: Step, own: Mapping[str, Sequence[Pronunciation]]) -> Step:
    """Return an edit of words with the phones of those that a lexicon has; other edits as they are."""
    if isinstance(step, WordIs):
        words = words_of(step.word)
        phones = [phone for word in words if word in own for phone in own[word][0]]
        return WordSaid(step.number, step.word, Text(" ".join(phones))) if own.keys() >= {*words} else step
    if type(step) is WordsSaid:  # and not one that brings phones along
        said = [f"{word} {' '.join(own[word][0])}" for word in dict.fromkeys(words_of(step.words)) if word in own]
        return WordsSaidSo(step.words, step.start_s, step.end_s, Text(", ".join(said))) if said else step
    return step


def _with_export(line: ProjectLine, record: ExportRecord) -> ProjectLine:
    """Return a line with one export more; of those with the same files only the last one is kept."""
    kept = tuple(each for each in line.exports if set(each.files) != set(record.files))
    return replace(line, exports=(*kept, record))


def _progress(work: Work) -> dict[str, Any]:
    return {"stage": work.stage, "share": round(work.share, 3)}


def _controls() -> Iterator[dict[str, Any]]:
    """Yield what edits can set of delivery and staging."""
    for part in (Delivery, Staging):
        for each in fields(part):
            rule = each.metadata.get("rule", ANY)
            told = {"name": each.name, "kind": kind_of(each).__name__, "usual": each.default}
            yield told | {"least": rule.least, "most": rule.most, "help": each.metadata.get("help", "")}


def _model_file(folder: ProjectFolder) -> Path | None:
    """Return the file of a project's model; None: the one that ships, with a warning where the project's is gone."""
    file = folder.model_file
    if file is not None and not file.exists():
        LOG.warning("%s: the model of the project is not there; the one that ships is used", file)
        return None
    return file
