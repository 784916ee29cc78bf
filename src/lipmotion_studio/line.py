"""A line that is open: its session, its edits with their history, and what the page shows of it."""

from __future__ import annotations

from collections.abc import Sequence
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
from lipmotion.pipeline.edit_files import EditFile
from lipmotion.pipeline.edits import Edits, Step, WordIs, WordSaid, WordStep, parse_step
from lipmotion.pipeline.generate.explain import explain_session, explanation_text
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.outputs.output import OutputSettings, Performance, ShownFace
from lipmotion.pipeline.session import read_pronunciations
from lipmotion.speech.features.analysed_audio import AnalysedAudio
from lipmotion.types import Audio, Channel, Explanation, Generation, Motion, Span, Timeline, Unit
from lipmotion.units import Pronunciation, is_silent, words_in_time, words_of
from lipmotion_faces.base import Face
from lipmotion_faces.film.filmed_video import write_film
from lipmotion_faces.filmed.face import FilmedFace
from lipmotion_faces.outputs.drawn_video import DRAWN_HZ, read_sound
from lipmotion_faces.outputs.scenes import delivered_scene
from lipmotion_faces.outputs.session_pictures import SessionPictures
from lipmotion_faces.outputs.shown_faces import ShownPerson
from lipmotion_faces.video.mp4 import write_mp4
from lipmotion_studio.folder import ProjectFolder, check_revision, revision_of, summary_of
from lipmotion_studio.meshes import with_turn
from lipmotion_studio.project import digest_of

LEAST_MOVE = 5e-4
"""Frames whose values differ by less, in the units of the channels, have not moved: 0.03 mm of a mouth."""
MOST_SHOWN_DOUBTS = 200
LONG_S = 30.0
"""In longer lines an edit moves the mouth around it at once; the whole motion is made when it is asked for."""
LONGEST_VIDEO_S = 60.0
CONFIDENCE = (Channel("confidence", "share"),)
WITH_TRANSCRIPT = ("transcript", "mapped transcript")
"""Where the words of an ``Outlook`` come from if they were given: for the line, or in a file beside the recording."""


class OpenLine:
    """A line that is open, for one thread at a time.

    file    : its edits; what is written at each change
    folder, number : the project that it is a line of
    summary : of the file as it was read, or written last
    audio   : the sound, which has been read
    onto    : the person onto whose face the motion is mapped; None: it stays as it is
    settled  : whether the motion is that of the whole line, as files get it; else only what lies around the last edits
               has been made since
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
        self.recording, self.settled = folder.sound(folder.line(number)), True
        known, self.summary = folder.summary(folder.line(number)), summary_of(file)
        if known.state == self.summary.state:  # else others have changed the file since it was read
            self.summary = known
        self._others: dict[tuple[int, int], OpenLine] = {}
        asked = replace(read_request(file.named), onto=onto) if onto is not None else None
        self.session = file.session(asked, model=model, audio=audio)
        self._pictures = SessionPictures(self.session)
        self.session.generate(file.edits)

    def moved_by(self, model: Model, onto: FilmedFace | None) -> OpenLine:
        """Return the line with its edits as another model moves it, or mapped onto another person; it is only read.

        Raises InputError: the model cannot make an edit, or there is no such person.
        """
        key = id(model), id(onto)
        if key not in self._others:
            self._others[key] = OpenLine(self.file, self.folder, self.number, model, self.audio, onto)
        self._others[key].file = self.file
        return self._others[key]

    def with_edits(self, sentences: Sequence[str]) -> OpenLine:
        """Return the line with other edits; it is only read. Raises InputError: an edit is refused."""
        other = copy(self)
        other.file, other.settled = replace(self.file, edits=Edits().then(*sentences), undone=()), True
        return other

    @property
    def generation(self) -> Generation:
        """The motion with all edits, but for its delivery."""
        with self._view():
            return self.session.generate(self.file.edits)

    @property
    def _delivered(self) -> Motion:
        with self._view():
            return self.session.deliver(self.file.edits).motion

    def _view(self, *, settled: bool | None = None) -> AbstractContextManager[None]:
        """Return what motion is asked for within; ``settled``: None: as it is."""
        whole = self.settled if settled is None else settled
        return nullcontext() if whole else self.session.sketching()

    def settle(self, revision: int) -> dict[str, Any]:
        """Make the whole motion, where it is not yet; return what moved. Raises RevisionError: as ``edited``."""
        self._check(revision)
        before, self.settled = self._delivered, True
        return {"changed": moved_stretch(before, self._delivered)}

    @property
    def last_s(self) -> float:
        """The end of the last phone, in seconds."""
        return self.generation.units[-1].end_s

    def edited(self, revision: int, steps: tuple[str | Step, ...], instead: int = 0) -> dict[str, Any]:
        """Make some edits; return what moved. Nothing has changed where one is refused.

        instead : so many of the last edits are taken back first, for good
        Raises RevisionError: the edits are no longer those of the revision. InputError: an edit is refused.
        """
        self._check(revision)
        changed = self._changed(self.file.undo(instead).then(*steps) if steps else self.file.undo(instead), revision)
        return changed | {"guessed": self._guessed(steps)}

    def back_to(self, revision: int, version: str) -> dict[str, Any]:
        """Go back to a version that was kept; the edits as they are become one, too. Raises as ``edited``.

        Raises InputError: no such version, or too many.
        """
        self._check(revision)
        line, now = self.folder.line(self.number), self.file.edits.sentences
        line.with_version(now)  # refuses one too many before anything has changed
        sentences = line.version(version).steps
        same = next((n for n, (old, new) in enumerate(zip(now, sentences, strict=False)) if old != new), len(now))
        same = min(same, len(sentences))
        return self._changed(self.file.undo(len(now) - same).then(*sentences[same:]), revision, keeps=True)

    def _guessed(self, steps: tuple[str | Step, ...]) -> list[dict[str, Any]]:
        """Return the words of edits whose pronunciation is a guess, with it, as objects of JSON."""
        lexicon = read_lexicon(self.session.request)
        found: dict[str, Pronunciation] = {}
        for step in map(parse_step, map(str, steps)):
            if isinstance(step, WordStep):
                own, text = read_pronunciations(step), step.word if isinstance(step, WordIs | WordSaid) else step.words
                found |= guess_pronunciations([word for word in words_of(text) if word not in own], lexicon)
        return [{"word": word, "phones": list(phones)} for word, phones in found.items()]

    @property
    def transcript(self) -> str:
        """The words that the phones were aligned with, before the edits; empty: they were recognised, or none given."""
        outlook, units = self.file.outlook, self.file.units
        if outlook is None or units is None or outlook.words not in WITH_TRANSCRIPT:
            return ""
        return " ".join(span.label for span in words_in_time(units) if span.label)

    def undone(self, revision: int, count: int) -> dict[str, Any]:
        """Take back the last edits; return what moved. Raises as ``edited``."""
        self._check(revision)
        return self._changed(self.file.undo(count), revision)

    def redone(self, revision: int, count: int) -> dict[str, Any]:
        """Make edits again that were taken back; return what moved. Raises as ``edited``."""
        self._check(revision)
        return self._changed(self.file.redo(count), revision)

    @property
    def revision(self) -> int:
        """The number of the line as it is now; another one after each change (``folder.revision_of``)."""
        return revision_of(self.folder.line(self.number), self.summary)

    def _check(self, revision: int) -> None:
        check_revision("the line", self.revision, revision)

    def _changed(self, file: EditFile, revision: int, *, keeps: bool = False) -> dict[str, Any]:
        """Go over to other edits: compute, then write, then keep them; nothing, where somebody else was first.

        keeps : whether the edits from before are kept as a version
        """
        before, settled = self._delivered, self.audio.duration_s <= LONG_S
        with self._view(settled=settled):
            after = self.session.deliver(file.edits).motion
        is_other = file.edits.steps != self.file.edits.steps or file.undone != self.file.undone
        if is_other or keeps:
            with self.folder.changing(self.number, revision) as line:
                if keeps:
                    kept = line.with_version(self.file.edits.sentences)
                    self.folder.change_line(self.number, lambda _: kept)
                if is_other:
                    self.folder.write_edits(line, file)
                    self.file, self.summary = file, self.folder.summary(line)
        self.settled = settled
        return {"changed": moved_stretch(before, after)}

    def state(self) -> dict[str, Any]:
        """Return what the page shows of the line, but for what the project says of it."""
        generation = self.generation
        motion, units = generation.motion, generation.units
        outlook = generation.outlook
        return {
            "settled": self.settled,
            "duration_s": self.audio.duration_s,
            "rate_hz": motion.rate_hz,
            "frames": len(motion.values),
            "words": word_rows(units),
            "phones": phone_rows(units, self.session.units()),
            "channels": [{"name": channel.name, "unit": channel.unit} for channel in motion.channels],
            "steps": list(self.file.edits.sentences),
            "edits_digest": digest_of(self.file.edits.sentences),
            "undo": len(self.file.edits.steps),
            "redo": len(self.file.undone),
            "warnings": list(outlook.advice) if outlook else [],
        }

    def numbers(self, of: str) -> Motion:
        """Return the numbers of a kind: ``motion``, ``delivered``, ``variance`` or ``confidence``."""
        generation = self.generation
        if of == "delivered":
            return self._delivered
        if of == "variance":
            return replace(generation.motion, values=generation.variance)
        if of == "confidence":
            return Motion(score_words(generation)[:, None], generation.motion.rate_hz, CONFIDENCE)
        return generation.motion

    def weights(self, face: ShownFace, frames: slice | None = None) -> Motion:
        """Return the weights of a face's morph targets, and its head's turn, as its ``.glb`` holds them.

        frames : which of them are computed alone; None: all
        """
        found = with_turn(delivered_scene(self.performance(face), frames))
        return found if frames is None or len(found.values) == frames.stop - frames.start else _cut(found, frames)

    def performance(self, face: ShownFace) -> Performance:
        """Return the motion with what outputs need of it."""
        edits = self.file.edits
        settings = OutputSettings(face, self.recording, staging=edits.staging(), delivery=edits.delivery())
        return Performance(self.generation, settings, self.audio, None, self.model)

    def picture(self, time_s: float, face: str | Face) -> NDArray[np.uint8]:
        """Return the picture of a drawn face at a time. Raises InputError: as there."""
        with self._view():
            return self._pictures.picture(time_s, self.file.edits, face=face)

    def write_video(self, path: Path, start_s: float, end_s: float, face: str | Face) -> None:
        """Write a stretch as a video of a drawn face. Raises InputError: as ``picture``; or it is too long, or none."""
        count = int((len(self.generation.motion.values) - 1) / 100 * DRAWN_HZ + 1e-9) + 1
        frames, sound = self._stretch(start_s, end_s, count, DRAWN_HZ)
        pictures = (self.picture(number / DRAWN_HZ, face) for number in frames)
        write_mp4(path, pictures, fps=DRAWN_HZ, audio=sound)

    def write_film(self, path: Path, start_s: float, end_s: float, person: ShownPerson) -> None:
        """Write a stretch as a video of a filmed face: its pictures are those of the video of the whole line.

        Raises InputError: as ``write_video``, or edits ask for what a filmed face cannot do.
        """
        performance = self.performance(person)
        person.check(performance.settings)
        person.check_video(path, performance.settings)
        film = person.film(performance)
        frames, sound = self._stretch(start_s, end_s, film.count, film.rate_hz)
        part = replace(film, frames=islice(film.frames, frames.start, frames.stop), count=len(frames))
        write_film(path, part, sound, mark=performance.settings.outputs.mark)

    def _stretch(self, start_s: float, end_s: float, count: int, rate_hz: float) -> tuple[range, Audio]:
        """Return which frames of a video show a stretch, and their sound. Raises InputError: too long, or none."""
        last_s = min(end_s, self.audio.duration_s)
        if not 0 < last_s - start_s <= LONGEST_VIDEO_S:
            raise InputError(f"{start_s} to {end_s} s, required a stretch of at most {LONGEST_VIDEO_S:g} s")
        first = min(round(start_s * rate_hz), count - 1)
        sound = read_sound(self.recording)
        part = slice(*(round(time_s * sound.rate_hz) for time_s in (first / rate_hz, last_s)))
        last = max(min(round(last_s * rate_hz), count - 1), first)
        return range(first, last + 1), Audio(sound.samples[part], sound.rate_hz)

    def why(self, time_s: float) -> dict[str, Any]:
        """Return what determined the motion at a time. Raises InputError: a time outside the recording."""
        with self._view():
            (found,) = explain_session(self.session, self.file.edits, [time_s])
        return why_document(found)

    def doubts(self) -> list[dict[str, Any]]:
        """Return the phones, by their confidence, the least sure first."""
        return doubts_of(self.generation)


def _cut(motion: Motion, frames: slice) -> Motion:
    return replace(motion, values=motion.values[frames])


def moved_stretch(before: Motion, after: Motion) -> dict[str, float] | None:
    """Return from when to when two motions differ; None: nowhere."""
    if before.values.shape != after.values.shape or before.names != after.names:
        return {"start_s": 0.0, "end_s": float(max(len(before.values), len(after.values)) / after.rate_hz)}
    other = np.flatnonzero((before.values != after.values).any(axis=1))
    moved = other[(np.abs(before.values[other] - after.values[other]) > LEAST_MOVE).any(axis=1)]
    if not len(moved):
        return None
    return {"start_s": float(moved[0] / after.rate_hz), "end_s": float(moved[-1] / after.rate_hz)}


def phone_rows(units: Timeline[Unit], plain: Timeline[Unit]) -> list[dict[str, Any]]:
    """Return phones in time as objects of JSON.

    plain : the phones before all edits: what is not one of them was edited
    """
    before = set(map(_said, plain))
    return [
        {
            "label": span.label.phone or span.label.unit,
            "start_s": span.start_s,
            "end_s": span.end_s,
            "word": span.label.word,
            "confidence": span.label.confidence or None,  # 0: of a recogniser that does not tell
            "edited": _said(span) not in before,
        }
        for span in units
    ]


def _said(span: Span[Unit]) -> tuple[str, float, float]:
    """Return which phone is said, and from when to when."""
    return span.label.phone or span.label.unit, span.start_s, span.end_s


def word_rows(units: Timeline[Unit]) -> list[dict[str, Any]]:
    """Return the words of phones in time as objects of JSON, with the numbers of their phones, from 1."""
    rows, first, spans = [], 0, list(units)
    for word in words_in_time(units):
        last = first
        while last + 1 < len(spans) and spans[last + 1].start_s < word.end_s - 1e-9:
            last += 1
        if word.label:
            times = {"start_s": word.start_s, "end_s": word.end_s}
            rows.append({"label": word.label, **times, "first": first + 1, "last": last + 1})
        first = last + 1
    return rows


def score_words(generation: Generation) -> NDArray[np.float64]:
    """Return how sure each frame is; 1 where it is not known."""
    found = generation.confidence
    return np.ones(len(generation.motion.values)) if found is None else found


def doubts_of(generation: Generation) -> list[dict[str, Any]]:
    """Return the phones that are said, by the mean confidence of their frames, the least sure first."""
    sure, hertz = score_words(generation), generation.motion.rate_hz
    rows = []
    for number, span in enumerate(generation.units, 1):
        frames = sure[int(span.start_s * hertz) : max(int(span.end_s * hertz), int(span.start_s * hertz) + 1)]
        if len(frames) and not is_silent(span.label.phone):
            time_s = (span.start_s + span.end_s) / 2
            rows.append({"time_s": time_s, "confidence": float(frames.mean()), "phone": number})
    return sorted(rows, key=lambda row: row["confidence"])[:MOST_SHOWN_DOUBTS]


def rate_doubt(generation: Generation) -> float:
    """Return the mean doubt of a line's speech, 0 to 1; of a line without speech 1."""
    rows = doubts_of(generation)
    return 1.0 - float(np.mean([row["confidence"] for row in rows])) if rows else 1.0


def why_document(found: Explanation) -> dict[str, Any]:
    """Return an explanation as the page shows it."""
    span = found.span
    shares = [share for regression in found.regressions for share in regression.shares]
    shares = shares or [state for chain in found.chains for state in chain.states]
    return {
        "time_s": found.time_s,
        "frame": found.frame,
        "state": found.state,
        "phone": span.label.phone if span else "",
        "word": span.label.word if span else "",
        "unit": span.label.unit if span else "",
        "start_s": span.start_s if span else None,
        "end_s": span.end_s if span else None,
        "experts": [{"name": share.name, "share": share.probability} for share in shares],
        "confidence": found.confidence,
        "text": explanation_text(found),
    }


def transcript_step(text: str, start_s: float, end_s: float) -> str:
    """Return the edit that says other words in a stretch."""
    return f"say {' '.join(text.split())} from {start_s:.3f} to {end_s:.3f}"
