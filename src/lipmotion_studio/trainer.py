"""Training of a project's own voices and faces: one at a time, in a process of its own, told as it goes on."""

from __future__ import annotations

import logging
import os
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from lipmotion.corpora.source_recordings import VIDEO_SUFFIXES
from lipmotion.errors import ExportError, InputError, shorten
from lipmotion.pipeline.workers import start_process
from lipmotion.storage.files import UNFINISHED, atomic_file, make_folder, read_text_file, remove, work_folder
from lipmotion.storage.json_text import as_json, from_json
from lipmotion.types.values import any_members, items, members, number, one_of, optional, text, tupled, value_of, whole
from lipmotion_faces.filmed.face import SUFFIX as FACE_SUFFIX
from lipmotion_studio.folder import ProjectFolder, copy_file, plain_name, restore, write_twice
from lipmotion_studio.project import ProjectLine
from lipmotion_studio.training import FACE, KINDS, VOICE, LearnedLine, TrainingOrder, VoiceOptions, carry_out

LOG = logging.getLogger("lipmotion")
TRAINING, STATE, STATE_COPY = "training", "state.json", "state.copy.json"
VOICES, FACES = "voices", "faces"
PLACES = {VOICE: (VOICES, ".lipmotion"), FACE: (FACES, FACE_SUFFIX)}
"""Folder and suffix of what is made, by its kind."""
WORKING, DONE, FAILED, STOPPED, INTERRUPTED = "working", "done", "failed", "stopped", "interrupted"
FORMAT, VERSION = "lipmotion.training", 1
MOST_TOLD = 200
"""Warnings, and recordings that are not used, of which the page is told."""
MOST_LISTED = 500
"""Videos of a project that the page lists."""
MOST_UNFINISHED = 0.99
"""The share of the work that is told, at most, until it is done."""


@dataclass(frozen=True)
class Wanted:
    """What was asked for.

    kind   : ``voice`` or ``face``
    name   : of what is made
    lines  : numbers of the lines that are learned from; none: the folder of recordings is
    options : values of ``VoiceOptions`` by name
    """

    kind: str
    name: str
    lines: tuple[int, ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict)

    @property
    def file(self) -> str:
        """The path of what is made, from the folder of the project."""
        folder, suffix = PLACES[self.kind]
        return f"{folder}/{self.name}{suffix}"


@dataclass(frozen=True)
class TrainingJob:
    """What was asked for, and how it went."""

    wanted: Wanted
    told: dict[str, Any]


class Trainer:
    """Makes voices and faces of a project, one at a time; may be used by several threads.

    The last one is told until there is another: what was asked for, and how it went; and besides, the last voice and
    the last face that were made. All is kept in the folder of the project, so that one that a killed studio was making
    is told as interrupted, and can be made again.

    clock  : returns seconds, and only grows
    damage : why the file that keeps it cannot be read, and how it is restored; until then nothing is made. Empty: it
             can be read
    """

    def __init__(self, folder: ProjectFolder, clock: Callable[[], float] = time.monotonic) -> None:
        self._folder, self._lock, self._clock = folder, threading.RLock(), clock
        self._file, self._copy = folder.path / TRAINING / STATE, folder.path / TRAINING / STATE_COPY
        self._wanted: Wanted | None = None
        self._told: dict[str, Any] = {}
        self._made: dict[str, TrainingJob] = {}
        self.damage = ""
        self._open()
        self._process: BaseProcess | None = None
        self._thread: threading.Thread | None = None
        self._begun_s = 0.0
        self._first_share: float | None = None
        self._ends_s: float | None = None

    @property
    def is_working(self) -> bool:
        """Whether something is being made."""
        return self._told.get("state") == WORKING

    def document(self) -> dict[str, Any] | None:
        """Return what was asked for last, and how it goes on or ended; None: nothing was."""
        with self._lock:
            return None if self._wanted is None else {**_wanted_document(self._wanted), **self.short_document()}

    def short_document(self) -> dict[str, Any]:
        """Return how it goes on or ended: ``state``, ``stage``, ``share``, ``left_s`` and what was told.

        ``left_s`` is by the last estimate; 0: it takes longer than that; None: not known yet
        """
        with self._lock:
            left_s = None if self._ends_s is None else max(round(self._ends_s - self._clock()), 0)
            return dict(self._told) | ({"left_s": left_s} if self.is_working else {})

    def earlier(self) -> list[dict[str, Any]]:
        """Return the last voice and the last face that were made, as ``document``, where that is another one."""
        with self._lock:
            last = self._wanted if self._told.get("state") == DONE else None
            return [{**_wanted_document(job.wanted), **job.told} for job in self._made.values() if job.wanted != last]

    def videos(self) -> list[ProjectLine]:
        """Return the lines of the project that are videos."""
        return [
            line for line in self._folder.project.lines.values() if Path(line.sound).suffix.lower() in VIDEO_SUFFIXES
        ]

    def made(self, kind: str) -> dict[str, Path]:
        """Return the files of the voices or the faces of the project by their names."""
        folder, suffix = PLACES[kind]
        found = sorted((self._folder.path / folder).glob(f"*{suffix}"))
        return {path.stem: path for path in found if path.is_file() and not path.name.startswith(".")}

    def begin(self, kind: str, name: str, lines: Sequence[int], options: VoiceOptions) -> None:
        """Begin to make a voice or a face.

        name  : of its file, which is made one that is free
        lines : numbers of lines that are videos; none: the project's folder of recordings
        Raises InputError: something is being made, no such kind, no name, no videos of these numbers, or no folder.
        ExportError: the folder of the project cannot be written.
        """
        if kind not in KINDS:
            raise InputError(f"no kind {shorten(repr(kind))}; required {' or '.join(KINDS)}")
        folder, suffix = PLACES[kind]
        plain, number = plain_name(name, ""), 1
        if "/" in name or "\\" in name:
            raise InputError(f"the name {shorten(repr(name))} has a slash; give it a name without one, as Anna")
        if not plain:
            raise InputError(f"the {kind} has no name; give it a name, as that of the person")
        while (self._folder.path / folder / f"{_numbered(plain, number)}{suffix}").exists():
            number += 1
        self._begin(Wanted(kind, _numbered(plain, number), tuple(lines), options.as_mapping()))

    def again(self) -> None:
        """Begin again what was stopped, interrupted or has failed, where it was. Raises as ``begin``."""
        if self.damage or self._wanted is None or self._told["state"] == DONE:
            raise InputError(self.damage or "nothing was stopped; begin with a voice or a face")
        self._begin(self._wanted)

    def stop(self) -> None:
        """Stop what is being made, and wait for its end; what is finished of it is kept for ``again``."""
        with self._lock:
            process, thread = self._process, self._thread
            if self.is_working:
                self._told["state"] = STOPPED
        if process is not None and thread is not None:
            process.kill()
            thread.join()

    def close(self) -> None:
        """End what is being made, without a word: it is told as interrupted when the project is opened again."""
        with self._lock:
            process, thread, self._thread = self._process, self._thread, None
        if process is not None and thread is not None:
            process.kill()
            thread.join()

    def _begin(self, wanted: Wanted) -> None:
        with self._lock:
            if self.damage:
                raise InputError(self.damage)
            if self.is_working or self._thread is not None:
                raise InputError("a voice or a face is being made; wait for it, or stop it")
            order = self._order(wanted)
            self._remove_unfinished(order.target)
            before = self._wanted, self._told
            self._wanted, self._told = wanted, {"state": WORKING, **_nothing_told()}
            try:
                self._write()
            except ExportError:
                self._wanted, self._told = before
                raise
            self._begun_s, self._first_share, self._ends_s = self._clock(), None, None
            self._process, pipe = start_process(carry_out, order)
            self._thread = threading.Thread(
                target=self._follow, args=(self._process, pipe), name="training", daemon=True
            )
            self._thread.start()

    def _order(self, wanted: Wanted) -> TrainingOrder:
        project = self._folder
        videos = {line.number: line for line in self.videos()}
        missing = [number for number in wanted.lines if number not in videos]
        if missing:
            raise InputError(f"line {missing[0]} is no video of this project; choose among its videos")
        if not wanted.lines and project.recordings is None:
            raise InputError(
                "no recordings are chosen; choose lines that are videos, or give a folder: lipmotion studio "
                "--recordings FOLDER"
            )
        chosen = [videos[number] for number in wanted.lines]
        lines = tuple(
            LearnedLine(project.sound(line).absolute(), line.name, line.transcript, line.sha256) for line in chosen
        )
        place = project.path.absolute()
        return TrainingOrder(
            wanted.kind,
            place / wanted.file,
            place / TRAINING,
            lines or (project.recordings or place).absolute(),
            VoiceOptions.stored(wanted.options),
            project.lexicon_file and project.lexicon_file.absolute(),
            max((os.cpu_count() or 2) - 1, 1),  # the page needs one
        )

    def _remove_unfinished(self, target: Path) -> None:
        """Remove what was begun and will not be gone on with."""
        for folder, _ in PLACES.values():
            for left in (self._folder.path / folder).glob(f"*{UNFINISHED}"):
                if left.name != work_folder(target).name:
                    remove(left)

    def _follow(self, process: BaseProcess, pipe: Connection) -> None:
        """Take what the process tells until it ends."""
        with pipe, suppress(EOFError, OSError):
            while True:
                self._take(pipe.recv())
        process.join()
        with self._lock:
            is_closed, self._thread, self._process = self._thread is None, None, None
            if is_closed and self._told["state"] == WORKING:
                return
            if self._told["state"] == WORKING:
                told = "it ended without a word; is there enough memory? What is finished is kept: run it again"
                self._told |= {"state": FAILED, "error": told}
            try:
                self._write()
            except ExportError as error:
                LOG.warning("%s", error)

    def _take(self, told: Mapping[str, Any]) -> None:
        with self._lock:
            if "stage" in told:
                self._go_on(told["stage"], min(told["share"], MOST_UNFINISHED))
            elif "report" in told:
                file = self._wanted.file if self._wanted else ""
                self._told |= {"state": DONE, "share": 1.0, "report": {**told["report"], "file": file}}
                if self._wanted:
                    self._made[self._wanted.kind] = TrainingJob(self._wanted, self._told)
            elif "error" in told and self.is_working:
                self._told |= {"state": FAILED, "error": told["error"]}
            elif "warning" in told:
                _append(self._told["warnings"], told["warning"])
            elif "skipped" in told:
                _append(self._told["skipped"], {"name": told["skipped"], "reason": told["reason"]})
            elif "noted" in told:
                _append(self._told["warnings"], f"{told['noted']}: {told['reason']}")

    def _go_on(self, stage: str, share: float) -> None:
        """Tell how far it is; where it has gone on, estimate anew when it will be done, if it goes on as until now."""
        now_s = self._clock()
        if self._first_share is None:
            self._first_share = share
        elif share > max(self._told["share"], self._first_share):
            self._ends_s = now_s + (now_s - self._begun_s) * (1 - share) / (share - self._first_share)
        self._told |= {"stage": stage, "share": max(share, self._told["share"])}

    def _write(self) -> None:
        make_folder(self._file.parent)
        wanted = {} if self._wanted is None else asdict(self._wanted)
        made = [asdict(job) for job in self._made.values()]
        document = {"format": FORMAT, "version": VERSION, "wanted": wanted, "told": self._told, "made": made}
        text = as_json(document, indent=1, ensure_ascii=False)

        def write(path: Path) -> None:
            with atomic_file(path) as temporary:
                temporary.write_text(text, encoding="utf-8")

        write_twice(self._file, self._copy, write)

    def _open(self) -> None:
        """Read what was made last, where there is a file of it; what is wrong with one is told."""
        self.damage = ""
        if not self._file.exists() and not self._copy.exists():
            return
        try:
            last, made = _read(self._file)
        except InputError as error:
            told = f"there is no good copy; remove the folder {self._file.parent}: voices and faces stay"
            if self.is_restorable:
                told = f"restore the last good copy on the page, or put it in its place: {self._copy}"
            self.damage = f"what is known of the training is damaged, and is left as it is: {error}; {told}"
            LOG.warning("%s", self.damage)
            return
        self._wanted, self._told = last.wanted, last.told
        self._made = {job.wanted.kind: job for job in (*made, last) if job.told["state"] == DONE}
        if not self._copy.exists():
            with suppress(ExportError):
                copy_file(self._file, self._copy)

    @property
    def is_restorable(self) -> bool:
        """Whether there is a good copy of the file that keeps what was made."""
        try:
            return bool(_read(self._copy))
        except InputError:
            return False

    def restore(self) -> None:
        """Put the last good copy in the place of a damaged file, which stays beside it under another name.

        Raises InputError: it is not damaged, or there is no good copy. ExportError: it cannot be written.
        """
        with self._lock:
            if not self.damage or not self.is_restorable:
                raise InputError(self.damage or "what is known of the training is not damaged; nothing is restored")
            restore(self._file, self._copy)
            self._open()


def _read(file: Path) -> tuple[TrainingJob, list[TrainingJob]]:
    """Return what was made last, and before. Raises InputError: the file cannot be read, or is of a later version."""
    text = read_text_file(file, "training")
    try:
        found = _STATE(from_json(text))
        return _job(found), [_job(each) for each in found.get("made", ())]
    except ValueError as error:  # InputError is one
        raise InputError(f"{file}: {error}") from error


def _job(job: Mapping[str, Any]) -> TrainingJob:
    """Return what a file says of something that was made. Raises InputError: options that there are not."""
    wanted, told = replace(job["wanted"], name=plain_name(job["wanted"].name)), job["told"]
    VoiceOptions.stored(wanted.options)
    state = INTERRUPTED if told["state"] == WORKING else told["state"]
    return TrainingJob(wanted, {**_nothing_told(), **told, "state": state})


_TEXT, _ANY = text(1 << 20), any_members(lambda value: value)
_WANTED = {"kind": one_of(KINDS), "name": _TEXT, "lines": tupled(items(whole(0, 1 << 31))), "options": _ANY}
_TOLD = {
    **{"state": one_of((WORKING, DONE, FAILED, STOPPED, INTERRUPTED)), "stage": _TEXT, "share": number(0, 1)},
    **{"warnings": items(_TEXT), "skipped": items(_ANY), "error": _TEXT, "report": optional(_ANY)},
}
_JOB = {"wanted": value_of(Wanted, _WANTED, _WANTED), "told": members(_TOLD, ["state"])}
_STATE = members(
    _JOB | {"format": one_of([FORMAT]), "version": one_of([VERSION]), "made": items(members(_JOB, _JOB))},
    ("format", "version", *_JOB),
)


def _numbered(name: str, number: int) -> str:
    return name if number == 1 else f"{name}-{number}"


def _wanted_document(wanted: Wanted) -> dict[str, Any]:
    return {**asdict(wanted), "lines": list(wanted.lines), "file": wanted.file}


def _nothing_told() -> dict[str, Any]:
    return {"stage": "", "share": 0.0, "warnings": [], "skipped": [], "error": "", "report": None}


def _append(told: list[Any], new: Any) -> None:
    if len(told) < MOST_TOLD and new not in told:
        told.append(new)
