"""Folders of projects: ``project.json``, sounds that were dropped, files of edits, exports, the project's lexicon.

One process works on a folder at a time. Every file is written whole or not at all.
"""

from __future__ import annotations

import os
import re
import threading
import unicodedata
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from lipmotion.errors import InputError
from lipmotion.pipeline.batch.lines import is_recording, read_lines
from lipmotion.pipeline.outputs.scenes import sound_reference
from lipmotion.speech.voices.pronunciations import LanguageLexicon
from lipmotion.storage.files import (
    is_link,
    locked,
    make_folder,
    portable_name,
    read_text_file,
    remove_unfinished,
    sha256_of,
    whole_file,
)
from lipmotion.storage.json_text import as_json_rows, from_json
from lipmotion.studio.project import EDITS_SUFFIX, Project, ProjectLine, check_lines, project_document, project_from
from lipmotion.studio.votes import Vote, read_votes, votes_text
from lipmotion.types.languages import AUTO, ENGLISH
from lipmotion.units import Lexicon

PROJECT, SOUNDS, EDITS, EXPORTS, LEXICON = "project.json", "sounds", "edits", "exports", "lexicon.txt"
VOTES = "votes.json"
SUFFIX = ".studio"
"""How the folder of a project ends, beside the recording or the folder of recordings that it was made of."""
UNTITLED = Path(f"untitled{SUFFIX}")
LARGEST_PROJECT_BYTES = 1 << 28
LONGEST_NAME = 80
"""Most characters of the name of a line that was dropped."""


class ProjectFolder:
    """A project in its folder; may be used by several threads.

    path     : the folder
    project  : as it is now
    revision : how often it has changed since it was opened
    """

    def __init__(self, path: Path) -> None:
        self.path, self.revision = path, 0
        self._lock = threading.RLock()
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

    def change(self, changed: Callable[[Project], Project], *, save: bool = True) -> None:
        """Replace the project by what a function makes of it; ``save``: write it at once.

        Raises ExportError: it cannot be written; it is then as before.
        """
        with self._lock:
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
        with self._lock:
            if number in self.project.lines:
                self.change(lambda project: project.with_lines([changed(project.lines[number])]), save=save)

    def save(self) -> None:
        """Write the project. Raises ExportError: it cannot be written."""
        with self._lock:
            text = as_json_rows(project_document(self.project), ensure_ascii=False)
            with whole_file(self.path / PROJECT) as temporary:
                temporary.write_text(text, encoding="utf-8")

    def add(self, source: Path) -> list[int]:
        """Add a recording, or those of a folder or a list, which stay where they are; return the new lines' numbers.

        Recordings that are lines already are left out.
        Raises InputError: no recordings. ExportError: as ``change``; or names that no folder can hold.
        """
        with self._lock:
            found = read_lines(source, (EDITS_SUFFIX,)) if source.is_dir() or not is_recording(source) else []
            named = [(Path(line.recording), line.name, line.transcript) for line in found] or [
                (source, portable_name(source.stem), "")
            ]
            known = {os.path.realpath(self.sound(line)) for line in self.project.lines.values()}
            new = [each for each in named if os.path.realpath(each[0]) not in known]
            taken, file = {_key(line.name) for line in self.project.lines.values()}, self.path.absolute() / PROJECT
            added = [
                ProjectLine(number, _free(name, taken), sound_reference(sound.absolute(), file), sha256_of(sound), said)
                for number, (sound, name, said) in enumerate(new, self.project.next_number)
            ]
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
        with self._lock:
            taken = {_key(line.name) for line in self.project.lines.values()}
            stem = _free(plain_name(Path(name).stem), taken)
            folder = self.path / SOUNDS
            make_folder(folder)
            file = folder / f"{stem}{Path(name).suffix.lower()}"
            with whole_file(file) as temporary:
                content.replace(temporary)
            number = self.project.next_number
            line = ProjectLine(number, stem, f"{SOUNDS}/{file.name}", sha256_of(file), transcript)
            check_lines(self.project.with_lines([line]))
            self.change(lambda project: project.with_lines([line]))
            return number

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
        with self._lock:
            votes = (*read_votes(self.path / VOTES), vote)
            with whole_file(self.path / VOTES) as temporary:
                temporary.write_text(votes_text(votes), encoding="utf-8")
            return votes

    def add_pronunciation(self, word: str, phones: tuple[str, ...]) -> None:
        """Write a pronunciation into the project's lexicon, ahead of earlier ones. Raises ExportError: cannot be."""
        with self._lock:
            own = {word: (phones, *self.lexicon().user.get(word, ()))}
            user = {**self.lexicon().user, **{each: tuple(dict.fromkeys(variants)) for each, variants in own.items()}}
            rows = [f"{each} {' '.join(variant)}\n" for each, variants in sorted(user.items()) for variant in variants]
            with whole_file(self.path / LEXICON) as temporary:
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
    with locked(path):
        remove_unfinished(path)  # what was dropped on a studio that was killed
        folder = ProjectFolder(path)
        if recordings is not None:
            folder.add(recordings)
        elif not (path / PROJECT).exists():
            folder.save()
        yield folder


def _key(name: str) -> str:
    return unicodedata.normalize("NFD", name).casefold()


def _free(name: str, taken: set[str]) -> str:
    """Return a name that is not taken, with a number behind it if needed, and take it."""
    found, number = name, 1
    while _key(found) in taken:
        number += 1
        found = f"{name}-{number}"
    taken.add(_key(found))
    return found


def plain_name(given: str, usual: str = "line") -> str:
    """Return a name that the page gives as the name of a file: letters, digits and a few signs; ``usual``: of none.

    >>> plain_name("../Anna's take"), plain_name("..", "voice")
    ('Anna_s take', 'voice')
    """
    plain = re.sub(r"[^\w .+()-]", "_", unicodedata.normalize("NFC", given)).strip(" ._")
    return portable_name(plain[:LONGEST_NAME]) or usual
