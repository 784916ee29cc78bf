"""A recording of the project: its analysis, and, once it is open, its session, its edits, and what the page shows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from copy import copy
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.pipeline.analysis.read_request import read_lexicon, read_request
from lipmotion.pipeline.analysis.transcribe import guess_pronunciations
from lipmotion.pipeline.edit_files import EditFile, create_edit_file
from lipmotion.pipeline.edits import Edits, Step, WordIs, WordSaid, WordStep, parse_step
from lipmotion.pipeline.generate.explain import explain_session, write_explanation
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.outputs.curve_sets import UNEDITABLE
from lipmotion.pipeline.outputs.output import OutputSettings, Performance, ShownFace
from lipmotion.pipeline.request import Request
from lipmotion.pipeline.session import Session
from lipmotion.speech.sound.analysed_audio import AnalysedAudio, analysed
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.types import Audio, Channel, Generation, Monitor, Motion, Span, Timeline, Unit, silent_monitor
from lipmotion.units import Pronunciation, group_words, is_silent, split_words
from lipmotion_faces.base import Face
from lipmotion_faces.film.filmed_video import write_film
from lipmotion_faces.filmed.face import FilmedFace
from lipmotion_faces.outputs.drawn_video import DRAWN_HZ, read_sound
from lipmotion_faces.outputs.scenes import build_scene
from lipmotion_faces.outputs.session_pictures import SessionPictures
from lipmotion_faces.outputs.shown_faces import ShownPerson
from lipmotion_faces.video.mp4 import write_mp4
from lipmotion_studio.folder import ProjectFolder, check_revision, compute_revision, summarise_edits
from lipmotion_studio.meshes import TURN
from lipmotion_studio.project import ProjectRecording, digest_edits

MIN_MOVE = 5e-4  # frames whose values differ by less, in the units of the channels, have not moved: 0.03 mm of a mouth
MAX_DOUBTS = 200
LONG_S = 30.0
"""In longer recordings an edit moves the mouth around it at once; the full motion is made when it is asked for."""
LONGEST_VIDEO_S = 60.0
CONFIDENCE = (Channel("confidence", "share"),)
WITH_TRANSCRIPT = ("transcript", "mapped transcript")
"""Where the words of an ``Outlook`` come from if they were given: for the recording, or in a file beside it."""


class OpenRecording:
    """A recording that is open, for one thread at a time.

    folder, number : the project, and its number there
    summary : of the file as it was read, or written last
    onto    : the person onto whose face the motion is mapped; None: it stays as it is
    settled : whether the full motion is up to date; else only what lies around the last edits is
    Raises as ``EditFile.session``.
    """

    def __init__(
        self,
        file: EditFile,
        folder: ProjectFolder,
        number: int,
        model: Model,
        audio: AnalysedAudio,
        onto: FilmedFace | None = None,
    ) -> None:
        self.file, self.folder, self.number, self.model, self.audio = file, folder, number, model, audio
        self.sound_path, self.settled = folder.locate_sound(folder.find_recording(number)), True
        known, self.summary = folder.summarise(folder.find_recording(number)), summarise_edits(file)
        if known.state == self.summary.state:  # else others have changed the file since it was read
            self.summary = known
        self._others: dict[tuple[int, int], OpenRecording] = {}
        request = replace(read_request(file.named), onto=onto) if onto is not None else None
        self.session = file.session(request, model=model, audio=audio)
        self._pictures = SessionPictures(self.session)
        self.session.generate(file.edits)

    def with_model(self, model: Model, onto: FilmedFace | None) -> OpenRecording:
        """Return it with another model, or mapped onto a person. Raises InputError: an edit fails; no such person."""
        key = id(model), id(onto)
        if key not in self._others:
            self._others[key] = OpenRecording(self.file, self.folder, self.number, model, self.audio, onto)
        self._others[key].file = self.file
        return self._others[key]

    def with_edits(self, sentences: Sequence[str]) -> OpenRecording:
        """Return it with other edits; to be read only. Raises InputError: an edit is refused."""
        other = copy(self)
        other.file, other.settled = replace(self.file, edits=Edits().then(*sentences), undone=()), True
        return other

    @property
    def generation(self) -> Generation:
        """The motion with all edits, but for its delivery."""
        with self._preview():
            return self.session.generate(self.file.edits)

    @property
    def _styled(self) -> Motion:
        with self._preview():
            return self.session.deliver(self.file.edits).motion

    def _preview(self, *, settled: bool | None = None) -> AbstractContextManager[None]:
        """Return what motion is asked for within; ``settled``: None: as it is."""
        return nullcontext() if (self.settled if settled is None else settled) else self.session.sketching()

    @property
    def transcript(self) -> str:
        """The words that the phones were aligned with, before the edits; empty: they were recognised, or none given."""
        outlook, units = self.file.outlook, self.file.units
        if outlook is None or units is None or outlook.words not in WITH_TRANSCRIPT:
            return ""
        return " ".join(span.label for span in group_words(units) if span.label)

    @property
    def revision(self) -> int:
        """The number of the recording as it is now; another one after each change (``folder.compute_revision``)."""
        return compute_revision(self.folder.find_recording(self.number), self.summary)

    def settle(self, revision: int) -> dict[str, Any]:
        """Make the full motion, where it is not yet; return what moved. Raises RevisionError: as ``edit``."""
        check_revision("the recording", self.revision, revision)
        before, self.settled = self._styled, True
        return {"changed": find_change(before, self._styled)}

    def edit(self, revision: int, steps: tuple[str | Step, ...], instead: int = 0) -> dict[str, Any]:
        """Make some edits; return what moved, and the words whose pronunciation is a guess.

        instead : number of the last edits that are taken back first, for good
        Nothing has changed where an edit is refused.
        Raises RevisionError: the edits are no longer those of the revision. InputError: an edit is refused.
        """

        def change(file: EditFile) -> EditFile:
            return file.undo(instead).then(*steps) if steps else file.undo(instead)

        changed, lexicon = self._change(revision, change), read_lexicon(self.session.request)
        guessed: dict[str, Pronunciation] = {}
        for step in map(parse_step, map(str, steps)):
            if isinstance(step, WordStep):
                text = step.word if isinstance(step, WordIs | WordSaid) else step.words
                unknown = [word for word in split_words(text) if word not in step.lexicon_entries]
                guessed |= guess_pronunciations(unknown, lexicon)
        rows = [{"word": word, "phones": list(phones)} for word, phones in guessed.items()]
        return changed | {"guessed": rows}

    def keep_version(self, revision: int) -> dict[str, Any]:
        """Keep the edits as a version. Raises RevisionError: as ``edit``. InputError: there are too many."""
        with self.folder.check_out(self.number, revision) as recording:
            saved = recording.with_version(self.file.edits.sentences)
            self.folder.change_recording(self.number, lambda _: saved)
        return {}

    def forget_version(self, revision: int, name: str) -> dict[str, Any]:
        """Remove a version. Raises RevisionError: as ``edit``. InputError: there is none of that name."""
        with self.folder.check_out(self.number, revision) as recording:
            removed = recording.find_version(name)
            others = tuple(version for version in recording.versions if version != removed)
            self.folder.change_recording(self.number, lambda now: replace(now, versions=others))
        return {}

    def restore_version(self, revision: int, name: str) -> dict[str, Any]:
        """Go back to a kept version; keep the edits as they are, too. Raises as ``edit``; InputError: no version."""

        def change(file: EditFile) -> EditFile:
            recording, now = self.folder.find_recording(self.number), file.edits.sentences
            recording.with_version(now)  # refuses one too many before anything has changed
            sentences = recording.find_version(name).steps
            same = next((n for n, (old, new) in enumerate(zip(now, sentences, strict=False)) if old != new), len(now))
            same = min(same, len(sentences))
            return file.undo(len(now) - same).then(*sentences[same:])

        return self._change(revision, change, keep_version=True)

    def undo(self, revision: int, count: int) -> dict[str, Any]:
        """Take back the last edits; return what moved. Raises as ``edit``."""
        return self._change(revision, lambda file: file.undo(count))

    def redo(self, revision: int, count: int) -> dict[str, Any]:
        """Make edits again that were taken back; return what moved. Raises as ``edit``."""
        return self._change(revision, lambda file: file.redo(count))

    def _change(
        self, revision: int, change: Callable[[EditFile], EditFile], *, keep_version: bool = False
    ) -> dict[str, Any]:
        """Go over to other edits: compute, then write, then use them; nothing, where somebody else was first."""
        check_revision("the recording", self.revision, revision)
        file, before, settled = change(self.file), self._styled, self.audio.duration_s <= LONG_S
        with self._preview(settled=settled):
            after = self.session.deliver(file.edits).motion
        is_other = file.edits.steps != self.file.edits.steps or file.undone != self.file.undone
        if is_other or keep_version:
            with self.folder.check_out(self.number, revision) as recording:
                if keep_version:
                    saved = recording.with_version(self.file.edits.sentences)
                    self.folder.change_recording(self.number, lambda _: saved)
                if is_other:
                    self.folder.write_edits(recording, file)
                    self.file, self.summary = file, self.folder.summarise(recording)
        self.settled = settled
        return {"changed": find_change(before, after)}

    def describe(self) -> dict[str, Any]:
        """Return what the page shows of the recording, but for what the project says of it."""
        generation = self.generation
        motion, outlook = generation.motion, generation.outlook
        rows, first, spans = [], 0, list(generation.units)
        for word in group_words(generation.units):
            last = first
            while last + 1 < len(spans) and spans[last + 1].start_s < word.end_s - 1e-9:
                last += 1
            if word.label:
                times = {"start_s": word.start_s, "end_s": word.end_s}
                rows.append({"label": word.label, **times, "first": first + 1, "last": last + 1})
            first = last + 1
        return {
            "settled": self.settled,
            "duration_s": self.audio.duration_s,
            "rate_hz": motion.rate_hz,
            "frames": len(motion.values),
            "words": rows,
            "phones": describe_phones(generation.units, self.session.units()),
            "channels": [{"name": n.name, "unit": n.unit} for n in motion.channels if n.name not in UNEDITABLE],
            "steps": list(self.file.edits.sentences),
            "edits_digest": digest_edits(self.file.edits.sentences),
            "undo": len(self.file.edits.steps),
            "redo": len(self.file.undone),
            "warnings": list(outlook.advice) if outlook else [],
        }

    def select_motion(self, of: str) -> Motion:
        """Return the numbers of a kind: ``motion``, ``delivered``, ``variance`` or ``confidence``."""
        generation = self.generation
        if of == "delivered":
            return self._styled
        if of == "variance":
            return replace(generation.motion, values=generation.variance)
        if of == "confidence":
            return Motion(rate_frames(generation)[:, None], generation.motion.rate_hz, CONFIDENCE)
        return generation.motion

    def compute_weights(self, face: ShownFace, frames: slice | None = None) -> Motion:
        """Return the weights of a face's morph targets, and its head's turn, as its ``.glb`` holds them.

        Raises InputError: the face has no morph targets.
        """
        scene = build_scene(self.prepare(face), frames)
        weights = scene.weights
        if weights is None:
            raise InputError("the face has no morph targets; choose the head, or a character with blendshapes")
        if scene.turn is not None:
            values = np.concatenate([weights.values, scene.turn.rotations], axis=1)
            weights = Motion(values, weights.rate_hz, weights.channels + tuple(map(Channel, TURN)))
        if frames is None or len(weights.values) == frames.stop - frames.start:
            return weights
        return replace(weights, values=weights.values[frames])

    def prepare(self, face: ShownFace) -> Performance:
        """Return the motion with what outputs need of it."""
        edits = self.file.edits
        settings = OutputSettings(face, self.sound_path, staging=edits.staging(), delivery=edits.delivery())
        return Performance(self.generation, settings, self.audio, None, self.model)

    def draw(self, time_s: float, face: str | Face) -> NDArray[np.uint8]:
        """Return the picture of a drawn face at a time. Raises InputError: as there."""
        with self._preview():
            return self._pictures.draw(time_s, self.file.edits, face=face)

    def write_video(self, path: Path, start_s: float, end_s: float, face: str | Face) -> None:
        """Write a stretch as a video of a drawn face. Raises InputError: as ``draw``; or it is too long, or none."""
        count = int((len(self.generation.motion.values) - 1) / 100 * DRAWN_HZ + 1e-9) + 1
        frames, sound = self._cut(start_s, end_s, count, DRAWN_HZ)
        pictures = (self.draw(number / DRAWN_HZ, face) for number in frames)
        write_mp4(path, pictures, fps=DRAWN_HZ, audio=sound)

    def write_film(self, path: Path, start_s: float, end_s: float, person: ShownPerson) -> None:
        """Write a stretch as a film. Raises InputError: as ``write_video``, or edits that it cannot show."""
        performance = self.prepare(person)
        person.check(performance.settings)
        person.check_video(path, performance.settings)
        film = person.film(performance)
        frames, sound = self._cut(start_s, end_s, film.count, film.rate_hz)
        part = replace(film, frames=islice(film.frames, frames.start, frames.stop), count=len(frames))
        write_film(path, part, sound, mark=performance.settings.outputs.mark)

    def _cut(self, start_s: float, end_s: float, count: int, rate_hz: float) -> tuple[range, Audio]:
        """Return which frames of a video show a stretch, and their sound. Raises InputError: too long, or none."""
        last_s = min(end_s, self.audio.duration_s)
        if not 0 < last_s - start_s <= LONGEST_VIDEO_S:
            raise InputError(f"{start_s} to {end_s} s, required a stretch of at most {LONGEST_VIDEO_S:g} s")
        first = min(round(start_s * rate_hz), count - 1)
        sound = read_sound(self.sound_path)
        part = slice(*(round(time_s * sound.rate_hz) for time_s in (first / rate_hz, last_s)))
        last = max(min(round(last_s * rate_hz), count - 1), first)
        return range(first, last + 1), Audio(sound.samples[part], sound.rate_hz)

    def explain(self, time_s: float) -> dict[str, Any]:
        """Return what determined the motion at a time. Raises InputError: a time outside the recording."""
        with self._preview():
            (explanation,) = explain_session(self.session, self.file.edits, [time_s])
        span = explanation.span
        shares = [state for chain in explanation.chains for state in chain.states]
        return {
            "time_s": explanation.time_s,
            "frame": explanation.frame,
            "state": explanation.state,
            "phone": span.label.phone if span else "",
            "word": span.label.word if span else "",
            "unit": span.label.unit if span else "",
            "start_s": span.start_s if span else None,
            "end_s": span.end_s if span else None,
            "experts": [{"name": share.name, "share": share.probability} for share in shares],
            "confidence": explanation.confidence,
            "text": write_explanation(explanation),
        }


def find_change(before: Motion, after: Motion) -> dict[str, float] | None:
    """Return from when to when two motions differ in their common channels; None: nowhere."""
    names = [name for name in before.names if name in after.names]
    was, now = before.selected(names).values, after.selected(names).values
    if was.shape != now.shape or not names:
        return {"start_s": 0.0, "end_s": float(max(len(was), len(now)) / after.rate_hz)}
    frames = np.flatnonzero((np.abs(was - now) > MIN_MOVE).any(axis=1))
    if not len(frames):
        return None
    return {"start_s": float(frames[0] / after.rate_hz), "end_s": float(frames[-1] / after.rate_hz)}


def describe_phones(units: Timeline[Unit], plain: Timeline[Unit]) -> list[dict[str, Any]]:
    """Return phones in time as objects of JSON; those that are not among ``plain`` were edited."""

    def identify(span: Span[Unit]) -> tuple[str, float, float]:
        return span.label.phone or span.label.unit, span.start_s, span.end_s

    before = set(map(identify, plain))
    return [
        {
            "label": span.label.phone or span.label.unit,
            "start_s": span.start_s,
            "end_s": span.end_s,
            "word": span.label.word,
            "confidence": span.label.confidence or None,  # 0: of a recogniser that does not tell
            "edited": identify(span) not in before,
        }
        for span in units
    ]


def rate_frames(generation: Generation) -> NDArray[np.float64]:
    """Return how sure each frame is; 1 where it is not known."""
    confidence = generation.confidence
    return np.ones(len(generation.motion.values)) if confidence is None else confidence


def list_doubts(generation: Generation) -> list[dict[str, Any]]:
    """Return the phones that are said, by the mean confidence of their frames, the least sure first."""
    confidence, hertz = rate_frames(generation), generation.motion.rate_hz
    rows = []
    for number, span in enumerate(generation.units, 1):
        frames = confidence[int(span.start_s * hertz) : max(int(span.end_s * hertz), int(span.start_s * hertz) + 1)]
        if len(frames) and not is_silent(span.label.phone):
            time_s = (span.start_s + span.end_s) / 2
            rows.append({"time_s": time_s, "confidence": float(frames.mean()), "phone": number})
    return sorted(rows, key=lambda row: row["confidence"])[:MAX_DOUBTS]


def average_doubt(generation: Generation) -> float:
    """Return the mean doubt of a recording's speech, 0 to 1; without speech 1."""
    rows = list_doubts(generation)
    return 1.0 - float(np.mean([row["confidence"] for row in rows])) if rows else 1.0


def analyse_recording(
    folder: ProjectFolder, recording: ProjectRecording, model: Model, monitor: Monitor = silent_monitor
) -> AnalysedAudio:
    """Find words and phones of a recording, and write them as its file of edits; return its sound.

    The project's lexicon is not named there: what it says of later words stands in the edits that say them.
    Raises InputError, AlignmentError: the sound or its words are not usable. ExportError: it cannot be written.
    """
    audio, project = analysed(read_audio(folder.check_sound(recording))), folder.project
    named = Request(
        folder.locate_sound(recording),
        model=folder.model_file,
        lexicon=folder.lexicon_file,
        language=project.language,
        recogniser=project.recogniser,
    )
    request = read_request(named, words_beside=not recording.transcript)
    if recording.transcript:
        request = replace(request, transcript=recording.transcript)
    session = Session(request, model=model, monitor=monitor, audio=audio)
    file, generation = create_edit_file(replace(named, lexicon=None), session)
    folder.check_sound(recording)  # it may have been replaced since
    duration_s, doubt = audio.duration_s, average_doubt(generation)
    with folder.lock:
        folder.find_recording(recording.number)  # it may have been removed since
        folder.write_edits(recording, replace(file, sha256=recording.sha256))
        folder.change_recording(
            recording.number, lambda now: replace(now, duration_s=duration_s, doubt=doubt), save=False
        )
    return audio


def open_recording(
    folder: ProjectFolder, recording: ProjectRecording, model: Model, audio: AnalysedAudio | None = None
) -> OpenRecording:
    """Open an analysed recording; note its length and doubt. Raises InputError: unreadable. ExportError."""
    file = folder.read_edits(recording)
    if audio is None:
        audio = analysed(read_audio(folder.check_sound(recording)))
    file = folder.adopt(recording, file)
    named = replace(file.named, recording=folder.locate_sound(recording), model=folder.model_file)
    opened = OpenRecording(replace(file, named=named), folder, recording.number, model, audio)
    if recording.duration_s is None:  # it was analysed by a studio that was killed before the project was written
        duration_s, doubt = audio.duration_s, average_doubt(opened.generation)
        folder.change_recording(recording.number, lambda now: replace(now, duration_s=duration_s, doubt=doubt))
    return opened
