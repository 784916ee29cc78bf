"""The studio: a project, the recordings of it that are at work, its faces, what is exported."""

from __future__ import annotations

import logging
import os
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, fields, replace
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray
from starlette.exceptions import HTTPException

from lipmotion.errors import InputError, LipMotionError, shorten
from lipmotion.extensions import find_version
from lipmotion.formats.sound import write_sound
from lipmotion.pipeline.edit_files import write_edits
from lipmotion.pipeline.edits import FORMS, Step, Text, WordIs, WordSaid, WordsSaid, WordsSaidSo, parse_step
from lipmotion.pipeline.job import Job, check_outputs, open_face, run
from lipmotion.pipeline.model import Model, find_shipped, load_model
from lipmotion.pipeline.outputs.curve_sets import SHAPE_SETS
from lipmotion.pipeline.request import Outputs
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.storage.files import create_folders
from lipmotion.storage.locks import open_temporary
from lipmotion.storage.sources import VIDEO_SUFFIXES, has_video, hash_file, list_video, open_media
from lipmotion.types import SPEECH_RATE_HZ
from lipmotion.types.configuration import ANY, kind_of
from lipmotion.types.delivery import MANNERS, MOODS, Delivery, Staging
from lipmotion.units import PHONES, is_silent, split_words
from lipmotion_faces.base import Face
from lipmotion_faces.outputs.drawn_video import VideoOutput, read_sound
from lipmotion_faces.tracking.track import read_video_frames
from lipmotion_faces.video.mp4 import write_mp4
from lipmotion_studio.folder import EXPORTS, NO_EDITS, ProjectFolder, check_revision, compute_revision
from lipmotion_studio.meshes import Faces
from lipmotion_studio.project import (
    EDITS_SUFFIX,
    MARKS,
    PRESETS,
    ExportRecord,
    Preset,
    Project,
    ProjectRecording,
    digest_edits,
    list_export_suffixes,
)
from lipmotion_studio.recording import LONGEST_VIDEO_S, OpenRecording
from lipmotion_studio.trainer import VOICES, Trainer
from lipmotion_studio.training import FACE, VOICE
from lipmotion_studio.workspace import FAILED, READY, WAITING, WORKING, NotReadyError, Workspace

PLAYED = {
    ".mp4": ("video/mp4", ("h264", "av1", "dav1d")),
    ".m4v": ("video/mp4", ("h264", "av1", "dav1d")),
    ".webm": ("video/webm", ("vp8", "vp9", "av1", "dav1d")),
}
"""What browsers play as it is: the kind of a file by its suffix, and the codecs in it."""
MP4 = "video/mp4"
IN_STEP_S = 0.005  # sound and pictures that begin further apart do not begin together
LOUDNESS_HZ = 100
"""Rate of the loudness by which two sounds are compared: encoders move samples a little, which it hardly shows."""


def find_real_video(recording: Path) -> Path | None:
    """Return the path of the real video of a recording, a sound or a video; None: there is none."""
    if recording.suffix.lower() in VIDEO_SUFFIXES:
        return recording if has_video(recording) else None
    siblings = (recording.with_suffix(suffix) for suffix in sorted(VIDEO_SUFFIXES))
    return next((path for path in siblings if path.is_file() and has_video(path)), None)


def find_media_type(path: Path) -> str | None:
    """Return the media type of a video that browsers play as it is; None: they do not, and it is written anew."""
    kind, codecs = PLAYED.get(path.suffix.lower(), ("", ()))
    if not kind:
        return None
    with open_media(path) as container:
        is_known = list_video(container)[0].codec_context.name.removeprefix("lib") in codecs
        return kind if is_known and (container.start_time or 0) < IN_STEP_S * 1e6 else None


def find_sound_start(video: Path, sound: Path) -> float:
    """Return when in a real video the sound of its recording begins, in seconds from the beginning of the video.

    sound : the recording: the video itself, of which the readers have silence before a sound that begins later than
            the pictures; or another file, which begins with the video or, as programs that extract sound leave that
            silence out, with the sound in it: where it is more like the sound of the video
    Raises InputError: one of both cannot be read.
    """
    late_s = 0.0
    if sound != video:
        with open_media(video) as container:
            for stream in list(container.streams.audio)[:1]:
                start_s = float((stream.start_time or 0) * stream.time_base)
                late_s = max(start_s - (container.start_time or 0) / 1e6, 0.0)
    if late_s < IN_STEP_S:
        return 0.0

    def measure_loudness(path: Path) -> NDArray[np.float64]:
        samples, each = np.abs(read_audio(path, warn=False).samples), SPEECH_RATE_HZ // LOUDNESS_HZ
        return np.sqrt(samples[: len(samples) // each * each].reshape(-1, each).mean(axis=1, dtype=float))

    def correlate(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
        count = min(len(one), len(other))  # what both have
        one, other = one[:count] - one[:count].mean(), other[:count] - other[:count].mean()
        return float(one @ other) / max(float(np.sqrt((one @ one) * (other @ other))), 1e-12)

    of_video, of_recording = map(measure_loudness, (video, sound))
    later = of_video[round(late_s * LOUDNESS_HZ) :]
    return late_s if correlate(later, of_recording) > correlate(of_video, of_recording) else 0.0


def write_playable(video: Path, sound: Path, path: Path) -> None:
    """Write a video as browsers play it, with a recording's sound. Raises InputError, ExportError."""
    frames, rate_hz = read_video_frames(video)
    even = (frame[: len(frame) // 2 * 2, : frame.shape[1] // 2 * 2] for frame in frames)
    write_mp4(path, even, fps=rate_hz, audio=read_sound(sound))


LOG = logging.getLogger("lipmotion")
OTHER = "other"  # what requests call the model that the project's is compared with
DIGEST_DIGITS = 8


@dataclass(frozen=True)
class KnownModel:
    """A model: the name of its file, without suffix, and the file's digest (SHA-256)."""

    model: Model
    name: str
    digest: str


def load_known_model(file: Path | None) -> KnownModel:
    """Return the model of a file; None: the one that ships. Raises as ``load_model``."""
    model, path = load_model(file), file or find_shipped()
    return KnownModel(model, path.stem, hash_file(path))


class Studio:
    """A project that is open, the model that moves its recordings, and one that is compared with it, or None."""

    def __init__(
        self, folder: ProjectFolder, used: KnownModel | None = None, against: KnownModel | None = None
    ) -> None:
        self.folder, self.against = folder, against
        self._videos: dict[Path, tuple[Path, float] | None] = {}
        self._writing_video = Lock()
        file = folder.model_file
        if used is None and file is not None and not file.exists():
            LOG.warning("%s: the model of the project is not there; the one that ships is used", file)
            file = None
        self.used = used or load_known_model(file)
        self.workspace = Workspace(folder, self.used.model)
        places = {name: Path(os.path.normpath(folder.path / file)) for name, file in folder.project.characters.items()}
        self.trainer = Trainer(folder)
        self.faces = Faces(places, lambda: self.trainer.list_files(FACE))
        self._run = ExitStack()
        self._sounds = self._run.enter_context(open_temporary())
        self._exporting: dict[str, int] | None = None

    def close(self) -> None:
        """Write what is not written, and remove what was cached for this run alone."""
        self.trainer.close()
        self.workspace.close()
        self._run.close()

    def list_recordings(self, first: int, count: int) -> dict[str, Any]:
        """Return the project, and ``count`` recordings from one on."""
        with self.folder.lock:
            project, revision = self.folder.project, self.folder.revision
        recordings = list(project.lines.values())
        return {
            "name": self.folder.path.absolute().name,
            "folder": str(self.folder.path.absolute()),
            "revision": revision,
            "count": len(recordings),
            "from": first,
            "lines": [self.describe_row(each) for each in recordings[first : first + count]],
            "forms": self._list_choices(),
            "version": find_version(),
            "model": {"name": self.used.name, "engine": self.used.model.engine.name},
        }

    def describe_row(self, recording: ProjectRecording) -> dict[str, Any]:
        """Return a row of the list, of a recording that may have left the project since."""
        summary, exports = self.folder.summarise(recording), recording.exports
        changed = bool(exports) and (exports[-1].steps, exports[-1].model) != (summary.digest, self.used.digest)
        return {
            "id": recording.number,
            "name": recording.name,
            "status": self.workspace.find_status(recording),
            "revision": compute_revision(recording, summary),
            "mark": recording.mark,
            "marked": recording.marked,
            "edits_digest": summary.digest,
            "doubt": recording.doubt,
            "duration_s": recording.duration_s,
            "edits": summary.count,
            "exported": "changed" if changed else "yes" if exports else "no",
            "error": self.workspace.find_error(recording),
        }

    def describe_recording(self, number: int) -> dict[str, Any]:
        """Return what the page shows of a recording, ready or not."""
        with self.folder.lock:
            recording, work = self.folder.find_recording(number), self.workspace.find_work(number)
            document: dict[str, Any] = {"id": number, "name": recording.name, "mark": recording.mark}
            document |= {"transcript": recording.transcript}
            document["revision"] = compute_revision(recording, self.folder.summarise(recording))
        document["versions"] = [
            {"name": each.name, "number": each.number, "edits": len(each.steps), "digest": each.digest}
            for each in recording.versions
        ]
        status, error = self.workspace.find_status(recording), self.workspace.find_error(recording)
        if work is None or status == FAILED:
            restorable = status == FAILED and self.folder.is_restorable(recording)
            return document | {"status": status, "progress": None, "error": error, "restorable": restorable}
        status = WORKING if work.status == READY and work.recording is None else work.status
        return document | {"status": status, "progress": work.progress, "error": work.error}

    def describe_progress(self) -> dict[str, Any]:
        """Return which recordings wait, or are at work, or were until a short while ago."""
        works = self.workspace.list_current()
        rows = [{"id": work.number, "status": work.status, **work.progress, "error": work.error} for work in works]
        waiting = sum(work.status == WAITING for work in works)
        document = {"lines": rows, "waiting": waiting, "revision": self.folder.revision, "export": self._exporting}
        return document | {"training": self.trainer.summarise()}

    def list_voices(self) -> dict[str, str]:
        """Return the models that the project may use by the names of their files, as paths from its folder."""
        project = self.folder.project
        files = self.trainer.list_files(VOICE)
        made = {name: path.relative_to(self.folder.path).as_posix() for name, path in files.items()}
        others = [path for path in (project.given_model, project.model) if path and path not in made.values()]
        return {"": ""} | {Path(path).name: path for path in others} | made

    def load_voice(self, name: str) -> tuple[str, KnownModel]:
        """Return path and model of a voice. Raises InputError: none of that name. Others as ``load_model``."""
        voices = self.list_voices()
        if name not in voices:
            raise InputError(f"no voice {shorten(repr(name))}; required one of: {', '.join(filter(None, voices))}")
        file = Path(os.path.normpath(self.folder.path / voices[name])) if voices[name] else None
        return voices[name], load_known_model(file)

    def use_voice(self, path: str, voice: KnownModel, revision: int) -> None:
        """Let another model move the recordings of the project, from now on; their phones and edits stay.

        revision : of the voice, as it was seen
        Raises RevisionError: another one is used since. ExportError: the project cannot be written.
        """

        def with_model(project: Project) -> Project:
            check_revision("the voice", self.folder.voice_revision, revision)
            was_given = project.model and not project.model.startswith(f"{VOICES}/")  # and not trained here
            given = project.model if was_given else project.given_model
            return replace(project, model=path, given_model=given)

        self.folder.change(with_model)
        self.used = voice
        self.workspace.use(voice.model)

    def _list_choices(self) -> dict[str, Any]:
        """Return what can be chosen, from the registries and configurations."""
        controls = []  # what edits can set of delivery and staging
        for each in (*fields(Delivery), *fields(Staging)):
            rule = each.metadata.get("rule", ANY)
            control = {"name": each.name, "kind": kind_of(each).__name__, "usual": each.default}
            controls.append(control | {"least": rule.least, "most": rule.most, "help": each.metadata.get("help", "")})
        against = self.against.name if self.against else None
        if self.against and against == self.used.name:
            against = f"{against} ({self.against.digest[:DIGEST_DIGITS]})"
        return {
            "phones": [{"name": phone, "silent": is_silent(phone)} for phone in PHONES],
            "moods": list(MOODS),
            "manners": list(MANNERS),
            "faces": [
                {"name": name, "title": name, "mesh": mesh, "filmed": self.faces.is_filmed(name)}
                for name, mesh in self.faces.names.items()
            ],
            "against": against,
            "curve_sets": list(SHAPE_SETS),
            "presets": [
                {"name": name, "title": each.title, "files": list(each.files)} for name, each in PRESETS.items()
            ],
            "preset": self.folder.project.preset,
            "suffixes": list(list_export_suffixes()),
            "edit_forms": list(FORMS),
            "controls": controls,
            "marks": list(MARKS),
            "longest_video_s": LONGEST_VIDEO_S,
        }

    def add_phones(self, sentences: Sequence[str]) -> tuple[Step, ...]:
        """Return edits; those that say words of the lexicon with its phones. Raises InputError: not an edit."""
        steps = [parse_step(sentence) for sentence in sentences]
        if not any(isinstance(step, WordIs | WordsSaid) for step in steps):
            return tuple(steps)
        user = self.folder.load_lexicon().user
        for place, step in enumerate(steps):
            if isinstance(step, WordIs):
                words = split_words(step.word)
                if user.keys() >= {*words}:
                    phones = " ".join(phone for word in words for phone in user[word][0])
                    steps[place] = WordSaid(step.number, step.word, Text(phones))
            elif type(step) is WordsSaid:  # and not one that brings phones along
                words = tuple(dict.fromkeys(split_words(step.words)))
                variants = [f"{word} {' '.join(user[word][0])}" for word in words if word in user]
                if variants:
                    steps[place] = WordsSaidSo(step.words, step.start_s, step.end_s, Text(", ".join(variants)))
        return tuple(steps)

    def analyse_again(self, number: int, revision: int, transcript: str) -> bool:
        """Analyse a recording without edits again, with its words; without any, they are recognised.

        Returns whether it has no edits; else nothing has been done.
        Raises NotReadyError: it is being analysed. RevisionError: somebody else has changed it. InputError: its edits
        are damaged. ExportError: it cannot be written.
        """
        with self.folder.check_out(number, revision) as recording:
            if self.workspace.find_status(recording) in (WAITING, WORKING):
                raise NotReadyError
            if self.folder.has_edits(recording):
                return False
            self.folder.remove_edits(recording)
            self.folder.change_recording(number, lambda now: replace(now, transcript=transcript.strip()))
            self.workspace.forget(number)
        self.workspace.open(number)
        return True

    def mark(self, number: int, revision: int, mark: str) -> dict[str, Any]:
        """Mark a recording as it is now; return its row. Raises InputError: no mark, damaged edits. RevisionError."""
        with self.folder.check_out(number, revision) as recording:
            self.folder.has_edits(recording)  # which is refused where they are damaged
            marked = replace(recording, mark=mark, marked=self.folder.summarise(recording).digest)
            self.folder.change_recording(number, lambda _: marked)
            return self.describe_row(marked)

    def find_drawn_face(self, name: str) -> str | Face:
        """Return a face of which pictures are drawn. Raises InputError: there is none of that name, or a filmed one."""
        if self.faces.is_filmed(name):
            raise InputError("a filmed face is made as a video, not picture by picture; make the video of a selection")
        return getattr(self.faces.open_face(name), "face", name)

    def prepare_sound(self, number: int) -> Path:
        """Return the path of a recording's sound as it is played. Raises InputError: unreadable, or another one."""
        path, sound = self._sounds / f"{number}.wav", self.folder.check_sound(self.folder.find_recording(number))
        if not path.exists():
            write_sound(path, read_sound(sound))
        return path

    def find_video(self, number: int) -> tuple[Path, float] | None:
        """Return the path of a recording's real video, and when in it the sound begins [s]; None: there is none."""
        sound = self.folder.locate_sound(self.folder.find_recording(number))
        if sound not in self._videos:
            video = find_real_video(sound)
            self._videos[sound] = (video, find_sound_start(video, sound)) if video else None
        return self._videos[sound]

    def prepare_video(self, number: int) -> tuple[Path, str]:
        """Return path and media type of a recording's video for browsers. Raises HTTPException: none. InputError."""
        video, _ = self.find_video(number) or (None, 0.0)
        if video is None or not video.is_file():
            raise HTTPException(404, "the recording has no video")
        kind = find_media_type(video)
        if kind is not None:
            return video, kind
        path = self._sounds / f"{number}.mp4"
        with self._writing_video:
            if not path.exists():
                write_playable(video, self.folder.locate_sound(self.folder.find_recording(number)), path)
        return path, MP4

    def vary(self, number: int, recording: OpenRecording, by: str, face: str = "") -> OpenRecording:
        """Return an open recording as it once was, or as the other model moves it, or mapped onto another person.

        face : the name of the face that is shown; a filmed one may be of another person
        Raises InputError: there is no such version or model, or it cannot make an edit.
        """
        if by not in ("", OTHER):
            steps = self.folder.find_recording(number).find_version(by).steps
            return self.vary(number, recording.with_edits(steps), "", face)
        model = self._find_model(by).model
        onto = self.faces.open_face(face).find_other_person(model, recording.file.named.speaker) if face else None
        return recording if model is self.used.model and onto is None else recording.with_model(model, onto)

    def _find_model(self, by: str) -> KnownModel:
        """Return the model that requests call so. Raises InputError: there is none."""
        if not by:
            return self.used
        if self.against is None:
            raise InputError("there is no other model; give it: lipmotion studio --against FILE")
        return self.against

    def export(self, number: int, preset: Preset, face: str = "") -> dict[str, Any]:
        """Write files of a recording, and record what was written from which edits; return their paths.

        Raises InputError: it is not analysed yet, its edits are damaged, its sound is another one, or there is no
        such face. ExportError: a file cannot be written.
        Others as ``Job.run``.
        """
        recording = self.folder.find_recording(number)
        if self.folder.summarise(recording) is NO_EDITS:
            raise InputError(f"{recording.name}: is not analysed yet; open it first")
        out = self.folder.path / EXPORTS
        copy = out / f"{recording.name}.{EDITS_SUFFIX}"
        files = tuple(str(out / f"{recording.name}{suffix}") for suffix in preset.files)
        file = replace(self.folder.read_edits(recording), undone=(), sha256=recording.sha256)
        with create_folders([copy.parent]):
            write_edits(file, copy)
            request = replace(file.named, recording=self.folder.check_sound(recording), edits=copy)
            outputs = Outputs(files, curves=preset.curves, fps=preset.fps or None)
            job, shown = Job(request, outputs), open_face(outputs)
            if face and any(isinstance(each, VideoOutput) for each in check_outputs(job, shown, request.recording)):
                shown = self.faces.open_face(face)
            run(job, face=shown, model=self.used.model)
        digests = {Path(path).relative_to(self.folder.path).as_posix(): hash_file(Path(path)) for path in files}
        record = ExportRecord(
            preset.name,
            digests,
            copy.relative_to(self.folder.path).as_posix(),
            digest_edits(file.edits.sentences),
            self.used.digest,
            find_version(),
        )

        def add_record(now: ProjectRecording) -> ProjectRecording:
            others = tuple(each for each in now.exports if set(each.files) != set(record.files))
            return replace(now, exports=(*others, record))

        self.folder.change_recording(number, add_record)
        return {"id": number, "files": list(digests), "edits": record.edits}

    def export_several(self, numbers: Sequence[int], preset: Preset, face: str = "") -> dict[str, Any]:
        """Write files of several recordings, as ``export``; what fails is reported, and the others are written."""
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
