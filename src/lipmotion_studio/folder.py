"""Folders of projects: ``project.json``, sounds that were dropped, files of edits, exports, the project's lexicon.

One process works on a folder at a time. Every file is written whole or not at all.
"""

from __future__ import annotations

import logging
import os
import re
import shutil
import threading
import unicodedata
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Any
from uuid import uuid4

from lipmotion.errors import ExportError, InputError, LipMotionError
from lipmotion.pipeline.batch.lines import file_key, read_lines
from lipmotion.pipeline.edit_files import EditFile, check_sound, read_edits, write_edits
from lipmotion.speech.voices.espeak import LanguageLexicon
from lipmotion.storage import files
from lipmotion.storage.json_text import as_json, as_json_rows, from_json
from lipmotion.storage.locks import lock_folder, remove_unfinished
from lipmotion.storage.sources import hash_file, is_recording, read_text_file
from lipmotion.types.languages import AUTO, ENGLISH
from lipmotion.units import Lexicon
from lipmotion_studio.project import (
    EDITS_SUFFIX,
    Project,
    ProjectRecording,
    check_recordings,
    describe_project,
    digest_edits,
    parse_project,
)

LOG = logging.getLogger("lipmotion")
PROJECT, SOUNDS, EDITS, EXPORTS, LEXICON = "project.json", "sounds", "edits", "exports", "lexicon.txt"
COPIES = "copies"
"""Folder of a copy of each file of edits, which is written with it: what a damaged one is restored from."""
SUFFIX = ".studio"
"""How the folder of a project ends, beside the recording or the folder of recordings that it was made of."""
UNTITLED = Path(f"untitled{SUFFIX}")
MAX_PROJECT_BYTES = 1 << 28
MAX_NAME = 80  # most characters of the name of a recording that was dropped


class RevisionError(LipMotionError):
    """A change was asked for by somebody who has not seen the last one: another window was first."""


@dataclass(frozen=True)
class EditsSummary:
    """What a recording's file of edits holds, but for its phones.

    digest : of their commands
    state  : digest of all that changes with an edit, and with taking it back; empty: there is no file yet
    error  : why the file cannot be read, and how it is restored; empty: it can
    """

    count: int
    digest: str
    state: str
    error: str = ""


NO_EDITS = EditsSummary(0, digest_edits(()), "")


def summarise_edits(file: EditFile) -> EditsSummary:
    """Return what lists say of a file of edits."""
    steps = file.edits.sentences
    return EditsSummary(len(steps), digest_edits(steps), digest_edits((*steps, "", *map(str, file.undone))))


def compute_revision(recording: ProjectRecording, edits: EditsSummary) -> int:
    """Return the revision of a recording: another number after every change that somebody can make of it."""
    versions = [[version.number, *version.steps] for version in recording.versions]
    return _digest_revision([recording.transcript, recording.mark, versions, edits.state])


def _digest_revision(content: Any) -> int:
    return int(sha256(as_json(content).encode()).hexdigest()[:8], 16) >> 1


def check_revision(what: str, now: int, seen: int) -> None:
    """Raise RevisionError if something has another revision now than the author of a change has seen."""
    if now != seen:
        raise RevisionError(f"{what} has been changed elsewhere: in another window, or by a request before")


class ProjectFolder:
    """A project in its folder; may be used by several threads.

    revision : how often it has changed since it was opened
    lock     : is held while something is checked and then changed; never while motion is made
    """

    def __init__(self, path: Path) -> None:
        self.path, self.revision = path, 0
        self.lock = threading.RLock()
        self._summaries: dict[int, tuple[object, EditsSummary]] = {}
        file = path / PROJECT
        self.project = Project()
        if file.exists():
            text = read_text_file(file, "project", MAX_PROJECT_BYTES)
            try:
                self.project = parse_project(from_json(text))
            except ValueError as error:  # InputError is one
                raise InputError(f"{file}: {error}") from error

    def find_recording(self, number: int) -> ProjectRecording:
        """Return a recording. Raises InputError: there is none of that number."""
        recording = self.project.lines.get(number)
        if recording is None:
            raise InputError(f"there is no recording {number} in the project")
        return recording

    def locate_sound(self, recording: ProjectRecording) -> Path:
        """Return the path of a recording's sound."""
        return Path(os.path.normpath(self.path / recording.sound))

    def locate_edits(self, recording: ProjectRecording) -> Path:
        """Return the path of a recording's file of edits, which is there once it is analysed."""
        return self.path / EDITS / f"{recording.name}.{EDITS_SUFFIX}"

    def _copy(self, recording: ProjectRecording) -> Path:
        return self.path / COPIES / f"{recording.name}.{EDITS_SUFFIX}"

    def check_sound(self, recording: ProjectRecording) -> Path:
        """Return the path of a recording's sound. Raises InputError: it is not there, or another one than it was."""
        path = self.locate_sound(recording)
        check_sound(path, recording.sha256)
        return path

    @contextmanager
    def check_out(self, number: int, revision: int) -> Iterator[ProjectRecording]:
        """Give a recording, seen at this revision, to be changed. Raises RevisionError: changed. InputError: gone."""
        with self.lock:
            recording = self.find_recording(number)
            check_revision("the recording", compute_revision(recording, self.summarise(recording)), revision)
            yield recording

    def summarise(self, recording: ProjectRecording) -> EditsSummary:
        """Return what a recording's file of edits holds; ``NO_EDITS`` where it is not analysed yet."""
        with self.lock:
            state, cached = self._read_file_state(recording), self._summaries.get(recording.number)
            if cached is None or cached[0] != state:
                summary = NO_EDITS
                if state:
                    try:
                        summary = summarise_edits(read_edits(self.locate_edits(recording), phones=False))
                    except InputError as error:
                        summary = EditsSummary(0, "", f"damaged: {error}", str(self._damage(recording, error)))
                cached = self._summaries[recording.number] = state, summary
            return cached[1]

    def _read_file_state(self, recording: ProjectRecording) -> object:
        """Return what tells a file of edits from an earlier one; a copy without its file counts. None: neither."""
        try:
            status = self.locate_edits(recording).stat()
            return status.st_ino, status.st_size, status.st_mtime_ns
        except FileNotFoundError:
            return self._copy(recording).exists() or None
        except OSError as error:  # it is there, and its reading says why it cannot be read
            return str(error)

    def _damage(self, recording: ProjectRecording, error: InputError) -> InputError:
        """Return the error of a file of edits that cannot be read, with the way out."""
        copy = self._copy(recording)
        try:
            count = len(read_edits(copy).edits.steps)
            way_out = (
                f"the last good copy, with {count} edits, is {copy}: restore it on the page, or put it in its place"
            )
        except InputError:
            export = self.path / EXPORTS / f"{recording.name}.{EDITS_SUFFIX}"
            way_out = f"there is no good copy, but perhaps that of the last export, {export}; put it in its place"
        return InputError(f"the edits of the recording are damaged, and are left as they are: {error}; {way_out}")

    def read_edits(self, recording: ProjectRecording) -> EditFile:
        """Return a recording's edits. Raises InputError: damaged (and where a copy is), or of another sound."""
        with self.lock:
            try:
                file = read_edits(self.locate_edits(recording))
            except InputError as error:
                raise self._damage(recording, error) from error
        if file.sha256 not in ("", recording.sha256):
            raise InputError(
                f"{self.locate_edits(recording)}: are edits of another recording than {self.locate_sound(recording)}; "
                "put the right file in its place, or add the recording again, under another name"
            )
        return file

    def has_edits(self, recording: ProjectRecording) -> bool:
        """Return whether a recording is analysed, and edited since. Raises InputError: as ``read_edits``."""
        return self.summarise(recording) is not NO_EDITS and bool(self.read_edits(recording).edits.steps)

    def write_edits(self, recording: ProjectRecording, file: EditFile) -> None:
        """Write a recording's file of edits, and the copy of it. Raises ExportError: it cannot be written."""
        path, copy = self.locate_edits(recording), self._copy(recording)
        with self.lock, files.create_folders([path.parent, copy.parent]):
            first, second = (copy, path) if path.exists() else (path, copy)
            write_edits(file, first)
            copy_file(first, second)
            self._summaries[recording.number] = self._read_file_state(recording), summarise_edits(file)

    def adopt(self, recording: ProjectRecording, file: EditFile) -> EditFile:
        """Return a recording's edits with the digest of its sound, where it was taken out; the copy becomes the same.

        Raises ExportError: it cannot be written.
        """
        path, copy = self.locate_edits(recording), self._copy(recording)
        if not file.sha256:
            file = replace(file, sha256=recording.sha256)
            self.write_edits(recording, file)
        elif not copy.exists() or copy.read_bytes() != path.read_bytes():  # others may have edited it
            with self.lock, files.create_folders([copy.parent]):
                copy_file(path, copy)
        return file

    def remove_edits(self, recording: ProjectRecording) -> None:
        """Remove a recording's file of edits, and its copy. Raises ExportError: it cannot be removed."""
        with self.lock:
            for path in (self._copy(recording), self.locate_edits(recording)):  # a copy without its file is a damage
                files.remove(path)
                if path.exists():
                    raise ExportError(f"{path}: cannot be removed")

    def is_restorable(self, recording: ProjectRecording) -> bool:
        """Return whether a recording's edits are damaged, or those of another sound, and there is a good copy."""
        with self.lock:
            try:
                self.read_edits(recording)
            except InputError:
                try:
                    return read_edits(self._copy(recording)).sha256 == recording.sha256
                except InputError:
                    pass
            return False

    def restore_edits(self, recording: ProjectRecording) -> None:
        """Put the copy in place of damaged edits, which stay beside. Raises InputError: no damage or copy."""
        with self.lock:
            if not self.is_restorable(recording):
                self.read_edits(recording)  # says what is damaged
                raise InputError("the edits of the recording are not damaged; nothing is restored")
            restore_copy(self.locate_edits(recording), self._copy(recording))

    def change(self, changed: Callable[[Project], Project], *, save: bool = True) -> None:
        """Replace the project by what a function makes of it. Raises ExportError: not written; it stays as it was."""
        with self.lock:
            before = self.project
            self.project = changed(before)
            self.revision += 1
            if not save:
                return
            try:
                self.save()
            except BaseException:
                self.project = before
                raise

    def change_recording(
        self, number: int, changed: Callable[[ProjectRecording], ProjectRecording], *, save: bool = True
    ) -> None:
        """Replace a recording, if it is still there, as ``change`` does."""
        with self.lock:
            if number in self.project.lines:
                self.change(lambda project: project.with_recordings([changed(project.lines[number])]), save=save)

    def save(self) -> None:
        """Write the project. Raises ExportError: it cannot be written."""
        with self.lock:
            text = as_json_rows(describe_project(self.project), ensure_ascii=False)
            with files.atomic_file(self.path / PROJECT) as temporary:
                temporary.write_text(text, encoding="utf-8")

    def add(self, source: Path) -> list[int]:
        """Add new recordings, also of folders or lists; return their numbers. Raises InputError, ExportError."""
        with self.lock:
            listed = read_lines(source, (EDITS_SUFFIX,)) if source.is_dir() or not is_recording(source) else []
            sources = [(Path(each.recording), each.name, each.transcript) for each in listed]
            known = {os.path.realpath(self.locate_sound(each)) for each in self.project.lines.values()}
            taken = {file_key(each.name) for each in self.project.lines.values()}
            added: list[ProjectRecording] = []
            for sound, name, transcript in sources or [(source, files.make_portable(source.stem), "")]:
                if not sound.is_file():
                    raise InputError(f"{source}: names {sound}, no such file; required a recording, or a list of paths")
                if os.path.realpath(sound) not in known:
                    number = self.project.next_number + len(added)
                    reference = files.sound_reference(sound.absolute(), self.path.absolute() / PROJECT)
                    recording = ProjectRecording(number, name, reference, hash_file(sound), transcript)
                    added.append(self._choose_name(recording, taken))
            project = self.project.with_recordings(added)
            check_recordings(project)
            self.change(lambda _: project)
            return [each.number for each in added]

    def drop(self, name: str, content: Path, transcript: str) -> int:
        """Add a recording that was dropped on the page, as a file of the project; return its number.

        content : a file on the same disk, which becomes that of the project
        Raises InputError: no name of a recording. ExportError: as ``change``, or the sound cannot be written.
        """
        if not is_recording(Path(name)):
            raise InputError(f"{name!r} is no name of a recording; required one as speech.wav, speech.flac, take.mp4")
        digest, suffix = hash_file(content), Path(name).suffix.lower()
        with self.lock:
            folder = self.path / SOUNDS
            files.make_folder(folder)
            taken = {file_key(each.name) for each in self.project.lines.values()}
            taken |= {file_key(each.stem) for each in folder.iterdir()}  # also of what was removed
            number = self.project.next_number
            recording = ProjectRecording(number, to_file_name(Path(name).stem), "", digest, transcript)
            recording = self._choose_name(recording, taken)
            recording = replace(recording, sound=f"{SOUNDS}/{recording.name}{suffix}")
            check_recordings(self.project.with_recordings([recording]))
            with files.atomic_file(self.locate_sound(recording)) as temporary:
                content.replace(temporary)
            self.change(lambda project: project.with_recordings([recording]))
            return number

    def _choose_name(self, recording: ProjectRecording, taken: set[str]) -> ProjectRecording:
        """Return a new recording with a name that is free, and take it; a number is added if needed."""

        def is_free(named: ProjectRecording) -> bool:
            if file_key(named.name) in taken:
                return False
            paths = [path for path in (self.locate_edits(named), self._copy(named)) if path.exists()]
            try:
                return all(read_edits(path, phones=False).sha256 == recording.sha256 for path in paths)
            except InputError:
                return False

        named, number = recording, 1
        while not is_free(named):
            number += 1
            named = replace(recording, name=f"{recording.name}-{number}")
        taken.add(file_key(named.name))
        return named

    @property
    def recordings(self) -> Path | None:
        """The folder of recordings that voices may be trained on; None: none was given."""
        folder = self.project.recordings
        return Path(os.path.normpath(self.path / folder)) if folder else None

    @property
    def model_file(self) -> Path | None:
        """The path of the project's model; None: the one that ships."""
        return Path(os.path.normpath(self.path / self.project.model)) if self.project.model else None

    @property
    def lexicon_file(self) -> Path | None:
        """The path of the project's own pronunciations; None: it has none."""
        file = self.path / LEXICON
        return file if file.is_file() else None

    def load_lexicon(self) -> Lexicon:
        """Return the project's own pronunciations, ahead of those of its language. Raises InputError: unreadable."""
        lexicon = Lexicon.from_file(self.lexicon_file) if self.lexicon_file else Lexicon()
        language = self.project.language
        return lexicon if language in (ENGLISH, AUTO) else LanguageLexicon(lexicon.user, language)

    @property
    def voice_revision(self) -> int:
        """The revision of the voice that moves the recordings, as ``compute_revision`` is that of a recording."""
        return _digest_revision(self.project.model)

    def compute_word_revision(self, word: str) -> int:
        """Return the revision of the project's pronunciations of a word, as ``compute_revision``."""
        return _digest_revision([word, self.load_lexicon().user.get(word, ())])

    def add_pronunciation(self, word: str, phones: tuple[str, ...], revision: int) -> None:
        """Write a pronunciation into the lexicon, ahead of earlier ones. Raises RevisionError, ExportError."""
        with self.lock:
            check_revision(f"the word {word}", self.compute_word_revision(word), revision)
            known = self.load_lexicon().user
            user = {**known, word: tuple(dict.fromkeys((phones, *known.get(word, ()))))}
            rows = [f"{each} {' '.join(variant)}\n" for each, variants in sorted(user.items()) for variant in variants]
            with files.atomic_file(self.path / LEXICON) as temporary:
                temporary.write_text("".join(rows), encoding="utf-8")


def find_project_path(source: Path | None, out: Path | None = None) -> Path:
    """Return the folder of the project of a recording, of a folder or a list of recordings, or of the project itself.

    A path that ends as projects do, and is not there, is that of an empty project.
    Raises InputError: there is no such file or folder, or the folder beside the source is a link.
    """
    if source is None:
        return out or UNTITLED
    if _is_new(source):
        return source
    if not source.exists():
        raise InputError(f"{source}: no such file or folder; give a recording, a folder of them, or a project")
    if _is_project(source):
        return source.parent if source.name == PROJECT else source
    place = source.absolute()
    usual = place.with_name(files.make_portable(f"{place.name if place.is_dir() else place.stem}{SUFFIX}"))
    if out is None and files.is_link(usual):
        raise InputError(f"{usual}: is a link, required a folder beside {source}; open {usual} itself, or give -o")
    return out or usual


def _is_project(source: Path) -> bool:
    return source.name == PROJECT or (source / PROJECT).exists()


def _is_new(source: Path) -> bool:
    return source.suffix == SUFFIX and not source.exists()


@contextmanager
def open_folder(source: Path | None, out: Path | None = None) -> Iterator[ProjectFolder]:
    """Open the project of ``find_project_path``, or create it. Raises ExportError: in use. InputError: unreadable."""
    path = find_project_path(source, out)
    recordings = None if source is None or _is_project(source) or _is_new(source) else source
    with lock_folder(path):
        remove_unfinished(path)  # what was dropped on a studio that was killed
        folder = ProjectFolder(path)
        if recordings is not None:
            folder.add(recordings)
        elif not (path / PROJECT).exists():
            folder.save()
        yield folder


def copy_file(source: Path, target: Path) -> None:
    """Copy a file, whole or not at all. Raises ExportError: it cannot be written."""
    with files.atomic_file(target) as temporary:
        shutil.copyfile(source, temporary)


def set_aside(path: Path) -> Path:
    """Give a damaged file another name beside its place; return that. Raises OSError: it cannot be renamed."""
    return path.replace(path.with_name(f"{path.name}.damaged-{uuid4().hex[:8]}"))


def restore_copy(path: Path, copy: Path) -> None:
    """Put a copy in the place of a damaged file, which stays beside it under another name. Raises ExportError."""
    with files.atomic_file(path) as temporary:
        shutil.copyfile(copy, temporary)
        if path.exists():
            set_aside(path)
    LOG.warning("%s: was damaged, and is restored from %s", path, copy)


def to_file_name(name: str, default: str = "line") -> str:
    """Return a name that the page gives as the name of a file: letters, digits and a few signs.

    >>> to_file_name("../Anna's take"), to_file_name("..", "voice")
    ('Anna_s take', 'voice')
    """
    plain = re.sub(r"[^\w .+()-]", "_", unicodedata.normalize("NFC", name)).strip(" ._")
    return files.make_portable(plain[:MAX_NAME]) or default
