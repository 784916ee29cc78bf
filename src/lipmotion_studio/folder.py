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
from lipmotion.pipeline.batch.lines import is_recording, read_lines
from lipmotion.pipeline.edit_files import EditFile, check_sound, read_edits, write_edits
from lipmotion.speech.voices.pronunciations import LanguageLexicon
from lipmotion.storage.files import (
    atomic_file,
    create_folders,
    is_link,
    lock_folder,
    make_folder,
    portable_name,
    read_text_file,
    remove,
    remove_unfinished,
    sha256_of,
    sound_reference,
)
from lipmotion.storage.json_text import as_json, as_json_rows, from_json
from lipmotion.types.languages import AUTO, ENGLISH
from lipmotion.units import Lexicon
from lipmotion_studio.project import (
    EDITS_SUFFIX,
    Project,
    ProjectLine,
    check_lines,
    digest_of,
    project_document,
    project_from,
)
from lipmotion_studio.votes import Vote, read_votes, votes_text

LOG = logging.getLogger("lipmotion")
PROJECT, SOUNDS, EDITS, EXPORTS, LEXICON = "project.json", "sounds", "edits", "exports", "lexicon.txt"
COPIES = "copies"
"""Folder of a copy of each file of edits, which is written with it: what a damaged one is restored from."""
VOTES = "votes.json"
SUFFIX = ".studio"
"""How the folder of a project ends, beside the recording or the folder of recordings that it was made of."""
UNTITLED = Path(f"untitled{SUFFIX}")
LARGEST_PROJECT_BYTES = 1 << 28
LONGEST_NAME = 80
"""Most characters of the name of a line that was dropped."""


class RevisionError(LipMotionError):
    """A change was asked for by somebody who has not seen the last one: another window was first."""


@dataclass(frozen=True)
class EditsSummary:
    """What a line's file of edits holds, but for its phones.

    count  : how many edits
    digest : of their sentences
    state  : digest of all that changes with an edit, and with taking it back; empty: there is no file yet
    error  : why the file cannot be read, and how it is restored; empty: it can
    """

    count: int
    digest: str
    state: str
    error: str = ""


NO_EDITS = EditsSummary(0, digest_of(()), "")


def summary_of(file: EditFile) -> EditsSummary:
    """Return what lists say of a file of edits."""
    steps = file.edits.sentences
    return EditsSummary(len(steps), digest_of(steps), digest_of((*steps, "", *map(str, file.undone))))


def revision_of(line: ProjectLine, edits: EditsSummary) -> int:
    """Return the revision of a line: another number after every change that somebody can make of it.

    It follows from the content, and is the same after a restart: a change names the revision that its author saw.
    """
    versions = [[version.number, *version.steps] for version in line.versions]
    return _revision([line.transcript, line.mark, versions, edits.state])


def _revision(seen: Any) -> int:
    return int(sha256(as_json(seen).encode()).hexdigest()[:8], 16) >> 1


def check_revision(what: str, now: int, seen: int) -> None:
    """Raise RevisionError if something has another revision now than the author of a change has seen."""
    if now != seen:
        raise RevisionError(f"{what} has been changed elsewhere: in another window, or by a request before")


class ProjectFolder:
    """A project in its folder; may be used by several threads.

    path     : the folder
    project  : as it is now
    revision : how often it has changed since it was opened
    lock     : is held while something is checked and then changed; never while motion is made
    """

    def __init__(self, path: Path) -> None:
        self.path, self.revision = path, 0
        self.lock = threading.RLock()
        self._summaries: dict[int, tuple[object, EditsSummary]] = {}
        file = path / PROJECT
        self.project = _read(file) if file.exists() else Project()

    def line(self, number: int) -> ProjectLine:
        """Return a line. Raises InputError: there is none of that number."""
        found = self.project.lines.get(number)
        if found is None:
            raise InputError(f"there is no line {number} in the project")
        return found

    def sound(self, line: ProjectLine) -> Path:
        """Return the path of a line's recording."""
        return Path(os.path.normpath(self.path / line.sound))

    def edits(self, line: ProjectLine) -> Path:
        """Return the path of a line's file of edits, which is there once the line is understood."""
        return self.path / EDITS / f"{line.name}.{EDITS_SUFFIX}"

    def _copy(self, line: ProjectLine) -> Path:
        return self.path / COPIES / f"{line.name}.{EDITS_SUFFIX}"

    def checked_sound(self, line: ProjectLine) -> Path:
        """Return the path of a line's recording. Raises InputError: it is not there, or another one than it was."""
        path = self.sound(line)
        if line.sha256:
            check_sound(path, line.sha256)
        return path

    @contextmanager
    def changing(self, number: int, revision: int) -> Iterator[ProjectLine]:
        """Give a line to be changed by somebody who saw this revision of it; nobody else changes it meanwhile.

        Raises RevisionError: it has changed since. InputError: there is no such line any more.
        """
        with self.lock:
            line = self.line(number)
            check_revision("the line", revision_of(line, self.summary(line)), revision)
            yield line

    def summary(self, line: ProjectLine) -> EditsSummary:
        """Return what is said of a line's edits; ``NO_EDITS`` where it is not understood yet.

        What this process writes is known; a file is read again where others have written it: else it is the same value.
        """
        with self.lock:
            written, known = self._written(line), self._summaries.get(line.number)
            if known is None or known[0] != written:
                known = written, self._read_summary(line) if written else NO_EDITS
                self._summaries[line.number] = known
            return known[1]

    def _written(self, line: ProjectLine) -> object:
        """Return what tells a file of edits from an earlier one; a copy without its file counts. None: neither."""
        try:
            status = self.edits(line).stat()
            return status.st_ino, status.st_size, status.st_mtime_ns
        except FileNotFoundError:
            return self._copy(line).exists() or None
        except OSError as error:  # it is there, and its reading says why it cannot be read
            return str(error)

    def _read_summary(self, line: ProjectLine) -> EditsSummary:
        try:
            return summary_of(read_edits(self.edits(line), phones=False))
        except InputError as error:
            return EditsSummary(0, "", f"damaged: {error}", str(self._damaged(line, error)))

    def _damaged(self, line: ProjectLine, error: InputError) -> InputError:
        """Return what is said of a file of edits that cannot be read."""
        copy = self._copy(line)
        try:
            count = len(read_edits(copy).edits.steps)
        except InputError:
            export = self.path / EXPORTS / f"{line.name}.{EDITS_SUFFIX}"
            told = f"there is no good copy, but perhaps that of the last export, {export}; put it in its place"
        else:
            told = f"the last good copy, with {count} edits, is {copy}: restore it on the page, or put it in its place"
        return InputError(f"the edits of the line are damaged, and are left as they are: {error}; {told}")

    def read_edits(self, line: ProjectLine) -> EditFile:
        """Return a line's file of edits. Raises InputError: it is damaged, and where a copy is; or of another sound."""
        with self.lock:
            try:
                file = read_edits(self.edits(line))
            except InputError as error:
                raise self._damaged(line, error) from error
        if line.sha256 and file.sha256 not in ("", line.sha256):
            raise InputError(
                f"{self.edits(line)}: are edits of another recording than {self.sound(line)}; put the file of this "
                "line in its place, or add the recording again, under another name"
            )
        return file

    def has_edits(self, line: ProjectLine) -> bool:
        """Return whether a line is understood, and edited since. Raises InputError: as ``read_edits``."""
        return self.summary(line) is not NO_EDITS and bool(self.read_edits(line).edits.steps)

    def write_edits(self, line: ProjectLine, file: EditFile) -> None:
        """Write a line's file of edits, and the copy of it. Raises ExportError: it cannot be written."""
        path, copy = self.edits(line), self._copy(line)
        with self.lock, create_folders([path.parent, copy.parent]):
            write_twice(path, copy, lambda first: write_edits(file, first))
            self._summaries[line.number] = self._written(line), summary_of(file)

    def adopt(self, line: ProjectLine, file: EditFile) -> EditFile:
        """Return a line's edits with the digest of its sound, where a project of an earlier version has none, or half.

        From then on another sound is refused; a warning says so. The copy becomes that of the file.
        Raises InputError: the recording cannot be read. ExportError: it cannot be written.
        """
        path, copy, digest = self.edits(line), self._copy(line), line.sha256 or file.sha256
        if not (line.sha256 and file.sha256):
            LOG.warning("%s: is taken to be the recording that was edited; from now on no other is", self.sound(line))
            digest = digest or sha256_of(self.sound(line))
            self.change_line(line.number, lambda now: replace(now, sha256=digest))
        if not file.sha256:
            file = replace(file, sha256=digest)
            self.write_edits(line, file)
        elif not copy.exists() or copy.read_bytes() != path.read_bytes():  # others may have edited it
            with self.lock, create_folders([copy.parent]):
                copy_file(path, copy)
        return file

    def remove_edits(self, line: ProjectLine) -> None:
        """Remove a line's file of edits, and its copy. Raises ExportError: it cannot be removed."""
        with self.lock:
            for path in (self._copy(line), self.edits(line)):  # a copy without its file would be a damage
                remove(path)
                if path.exists():
                    raise ExportError(f"{path}: cannot be removed")

    def is_restorable(self, line: ProjectLine) -> bool:
        """Return whether a line's edits are damaged, or those of another sound, and there is a good copy."""
        with self.lock:
            try:
                self.read_edits(line)
            except InputError:
                try:
                    return read_edits(self._copy(line)).sha256 == line.sha256
                except InputError:
                    pass
            return False

    def restore_edits(self, line: ProjectLine) -> None:
        """Put the last good copy in the place of a damaged file of edits, which stays beside it under another name.

        Raises InputError: the file is not damaged, or there is no good copy. ExportError: it cannot be written.
        """
        path = self.edits(line)
        with self.lock:
            if not self.is_restorable(line):
                self.read_edits(line)  # says what is damaged
                raise InputError("the edits of the line are not damaged; nothing is restored")
            restore(path, self._copy(line))

    def change(self, changed: Callable[[Project], Project], *, save: bool = True) -> None:
        """Replace the project by what a function makes of it; ``save``: write it at once.

        Raises ExportError: it cannot be written; it is then as before.
        """
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

    def change_line(self, number: int, changed: Callable[[ProjectLine], ProjectLine], *, save: bool = True) -> None:
        """Replace a line, if it is still there, as ``change`` does."""
        with self.lock:
            if number in self.project.lines:
                self.change(lambda project: project.with_lines([changed(project.lines[number])]), save=save)

    def save(self) -> None:
        """Write the project. Raises ExportError: it cannot be written."""
        with self.lock:
            text = as_json_rows(project_document(self.project), ensure_ascii=False)
            with atomic_file(self.path / PROJECT) as temporary:
                temporary.write_text(text, encoding="utf-8")

    def add(self, source: Path) -> list[int]:
        """Add a recording, or those of a folder or a list, which stay where they are; return the new lines' numbers.

        Recordings that are lines already are left out.
        Raises InputError: no recordings. ExportError: as ``change``; or names that no folder can hold.
        """
        with self.lock:
            found = read_lines(source, (EDITS_SUFFIX,)) if source.is_dir() or not is_recording(source) else []
            named = [(Path(line.recording), line.name, line.transcript) for line in found] or [
                (source, portable_name(source.stem), "")
            ]
            known = {os.path.realpath(self.sound(line)) for line in self.project.lines.values()}
            new = [each for each in named if os.path.realpath(each[0]) not in known]
            taken, file = {_key(line.name) for line in self.project.lines.values()}, self.path.absolute() / PROJECT
            added = []
            for number, (sound, name, said) in enumerate(new, self.project.next_number):
                line = ProjectLine(number, name, sound_reference(sound.absolute(), file), sha256_of(sound), said)
                added.append(self._named(line, taken))
            project = self.project.with_lines(added)
            check_lines(project)
            self.change(lambda _: project)
            return [line.number for line in added]

    def drop(self, name: str, content: Path, transcript: str) -> int:
        """Add a recording that was dropped on the page, as a file of the project; return its number.

        content : a file on the same disk, which becomes that of the project
        Raises InputError: no name of a recording. ExportError: as ``change``, or the sound cannot be written.
        """
        if not is_recording(Path(name)):
            raise InputError(f"{name!r} is no name of a recording; required one as speech.wav, speech.flac, take.mp4")
        digest, suffix = sha256_of(content), Path(name).suffix.lower()
        with self.lock:
            folder = self.path / SOUNDS
            make_folder(folder)
            taken = {_key(line.name) for line in self.project.lines.values()}
            taken |= {_key(each.stem) for each in folder.iterdir()}  # also those of lines that were removed
            line = ProjectLine(self.project.next_number, plain_name(Path(name).stem), "", digest, transcript)
            line = self._named(line, taken)
            line = replace(line, sound=f"{SOUNDS}/{line.name}{suffix}")
            check_lines(self.project.with_lines([line]))
            with atomic_file(self.sound(line)) as temporary:
                content.replace(temporary)
            self.change(lambda project: project.with_lines([line]))
            return line.number

    def _named(self, line: ProjectLine, taken: set[str]) -> ProjectLine:
        """Return a new line with a name that is free, and take it; a number is added if needed.

        A name under which edits of another sound lie, as of a line that was removed, is not free.
        """

        def is_free(named: ProjectLine) -> bool:
            if _key(named.name) in taken:
                return False
            files = [path for path in (self.edits(named), self._copy(named)) if path.exists()]
            try:
                return all(read_edits(path, phones=False).sha256 == line.sha256 for path in files)
            except InputError:
                return False

        named, number = line, 1
        while not is_free(named):
            number += 1
            named = replace(line, name=f"{line.name}-{number}")
        taken.add(_key(named.name))
        return named

    @property
    def recordings(self) -> Path | None:
        """The folder of recordings that voices may be trained on; None: none was given."""
        given = self.project.recordings
        return Path(os.path.normpath(self.path / given)) if given else None

    @property
    def model_file(self) -> Path | None:
        """The path of the project's model; None: the one that ships."""
        return Path(os.path.normpath(self.path / self.project.model)) if self.project.model else None

    @property
    def lexicon_file(self) -> Path | None:
        """The path of the project's own pronunciations; None: it has none."""
        file = self.path / LEXICON
        return file if file.is_file() else None

    def lexicon(self) -> Lexicon:
        """Return the project's own pronunciations, ahead of those of its language. Raises InputError: unreadable."""
        own = Lexicon.from_file(self.lexicon_file) if self.lexicon_file else Lexicon()
        language = self.project.language
        return own if language in (ENGLISH, AUTO) else LanguageLexicon(own.user, language)

    def add_vote(self, vote: Vote) -> tuple[Vote, ...]:
        """Write a vote behind those that were cast before; return all. Raises InputError, ExportError: not possible."""
        with self.lock:
            votes = (*read_votes(self.path / VOTES), vote)
            with atomic_file(self.path / VOTES) as temporary:
                temporary.write_text(votes_text(votes), encoding="utf-8")
            return votes

    @property
    def voice_revision(self) -> int:
        """The revision of the voice that moves the lines, as ``revision_of`` is that of a line."""
        return _revision(self.project.model)

    def word_revision(self, word: str) -> int:
        """Return the revision of the project's pronunciations of a word, as ``revision_of`` is that of a line."""
        return _revision([word, self.lexicon().user.get(word, ())])

    def add_pronunciation(self, word: str, phones: tuple[str, ...], revision: int) -> None:
        """Write a pronunciation into the project's lexicon, ahead of earlier ones.

        revision : of the word, as it was seen
        Raises RevisionError: there is another one since. ExportError: it cannot be written.
        """
        with self.lock:
            check_revision(f"the word {word}", self.word_revision(word), revision)
            known = self.lexicon().user
            user = {**known, word: tuple(dict.fromkeys((phones, *known.get(word, ()))))}
            rows = [f"{each} {' '.join(variant)}\n" for each, variants in sorted(user.items()) for variant in variants]
            with atomic_file(self.path / LEXICON) as temporary:
                temporary.write_text("".join(rows), encoding="utf-8")


def _read(file: Path) -> Project:
    text = read_text_file(file, "project", LARGEST_PROJECT_BYTES)
    try:
        return project_from(from_json(text))
    except ValueError as error:  # InputError is one
        raise InputError(f"{file}: {error}") from error


def folder_for(source: Path | None, out: Path | None = None) -> Path:
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
    usual = place.with_name(portable_name(f"{place.name if place.is_dir() else place.stem}{SUFFIX}"))
    if out is None and is_link(usual):
        raise InputError(f"{usual}: is a link, required a folder beside {source}; open {usual} itself, or give -o")
    return out or usual


def _is_project(source: Path) -> bool:
    return source.name == PROJECT or (source / PROJECT).exists()


def _is_new(source: Path) -> bool:
    return source.suffix == SUFFIX and not source.exists()


@contextmanager
def opened_folder(source: Path | None, out: Path | None = None) -> Iterator[ProjectFolder]:
    """Open the project of ``folder_for``, created if needed, with the recordings of the source as its lines.

    Raises ExportError: another process works on it, or it cannot be written.  Raises InputError: it cannot be read.
    """
    path = folder_for(source, out)
    recordings = None if source is None or _is_project(source) or _is_new(source) else source
    with lock_folder(path):
        remove_unfinished(path)  # what was dropped on a studio that was killed
        folder = ProjectFolder(path)
        if recordings is not None:
            folder.add(recordings)
        elif not (path / PROJECT).exists():
            folder.save()
        yield folder


def _key(name: str) -> str:
    return unicodedata.normalize("NFD", name).casefold()


def copy_file(source: Path, target: Path) -> None:
    """Copy a file, whole or not at all. Raises ExportError: it cannot be written."""
    with atomic_file(target) as temporary:
        shutil.copyfile(source, temporary)


def write_twice(path: Path, copy: Path, write: Callable[[Path], object]) -> None:
    """Write a file and its copy. Raises ExportError: one of them cannot be written.

    What fails between the two leaves what was acknowledged, and never a copy alone: that would be a damage.
    """
    first, second = (copy, path) if path.exists() else (path, copy)
    write(first)
    copy_file(first, second)


def restore(path: Path, copy: Path) -> None:
    """Put a copy in the place of a damaged file, which stays beside it under another name. Raises ExportError."""
    with atomic_file(path) as temporary:
        shutil.copyfile(copy, temporary)
        if path.exists():
            path.replace(path.with_name(f"{path.name}.damaged-{uuid4().hex[:8]}"))
    LOG.warning("%s: was damaged, and is restored from %s", path, copy)


def plain_name(given: str, usual: str = "line") -> str:
    """Return a name that the page gives as the name of a file: letters, digits and a few signs; ``usual``: of none.

    >>> plain_name("../Anna's take"), plain_name("..", "voice")
    ('Anna_s take', 'voice')
    """
    plain = re.sub(r"[^\w .+()-]", "_", unicodedata.normalize("NFC", given)).strip(" ._")
    return portable_name(plain[:LONGEST_NAME]) or usual
