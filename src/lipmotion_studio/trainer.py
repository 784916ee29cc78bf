"""Training of a project's own voices and faces: one at a time, in a process of its own, which reports its progress."""

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

from lipmotion.errors import ExportError, InputError, shorten
from lipmotion.pipeline.workers import start_process
from lipmotion.storage.files import atomic_file, make_folder, remove
from lipmotion.storage.json_text import as_json, from_json
from lipmotion.storage.locks import UNFINISHED, name_work_folder
from lipmotion.storage.sources import VIDEO_SUFFIXES, read_text_file
from lipmotion.types import values
from lipmotion_faces.filmed.face import SUFFIX as FACE_SUFFIX
from lipmotion_studio.folder import ProjectFolder, set_aside, to_file_name
from lipmotion_studio.project import ProjectRecording
from lipmotion_studio.training import FACE, KINDS, VOICE, TrainingOrder, TrainingRecording, VoiceOptions, run_training

LOG = logging.getLogger("lipmotion")
TRAINING, STATE = "training", "state.json"
VOICES, FACES = "voices", "faces"
PLACES = {VOICE: (VOICES, ".lipmotion"), FACE: (FACES, FACE_SUFFIX)}  # folder and suffix of what is made, by its kind
WORKING, DONE, FAILED, STOPPED, INTERRUPTED = "working", "done", "failed", "stopped", "interrupted"
FORMAT, VERSION = "lipmotion.training", 1
MAX_WARNINGS = 200  # warnings, and recordings that are not used, that the page shows
MAX_LISTED = 500
MAX_UNFINISHED = 0.99  # the share of the work that is shown, at most, until it is done


@dataclass(frozen=True)
class TrainingRequest:
    """What is to be made; without recordings' numbers (``lines``) the folder of recordings is learned from."""

    kind: str
    name: str
    lines: tuple[int, ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict)

    @property
    def file(self) -> str:
        """The path of what is made, from the folder of the project."""
        folder, suffix = PLACES[self.kind]
        return f"{folder}/{self.name}{suffix}"


class Trainer:
    """Makes voices and faces of a project, one at a time; may be used by several threads.

    The last job is shown until there is another. It is kept in the folder of the project: what a killed studio was
    making is shown as interrupted, and can be made again.

    clock : returns seconds, and only grows
    """

    def __init__(self, folder: ProjectFolder, clock: Callable[[], float] = time.monotonic) -> None:
        self._folder, self._lock, self._clock = folder, threading.RLock(), clock
        self._file = folder.path / TRAINING / STATE
        self._request, self._status = _read_job(self._file)
        self._process: BaseProcess | None = None
        self._thread: threading.Thread | None = None
        self._begun_s = 0.0
        self._first_share: float | None = None
        self._ends_s: float | None = None

    @property
    def is_working(self) -> bool:
        """Whether something is being made."""
        return self._status.get("state") == WORKING

    def describe(self) -> dict[str, Any]:
        """Return what was asked for last, and how it goes on or ended, as the page shows it; empty: nothing was."""
        with self._lock:
            request = self._request
            if request is None:
                return {}
            return {**asdict(request), "lines": list(request.lines), "file": request.file, **self.summarise()}

    def summarise(self) -> dict[str, Any]:
        """Return the state of a job: ``stage``, ``share``, ``left_s`` (0: longer than estimated), warnings, report."""
        with self._lock:
            left_s = None if self._ends_s is None else max(round(self._ends_s - self._clock()), 0)
            return dict(self._status) | ({"left_s": left_s} if self.is_working else {})

    def list_videos(self) -> list[ProjectRecording]:
        """Return the recordings of the project that are videos."""
        recordings = self._folder.project.lines.values()
        return [each for each in recordings if Path(each.sound).suffix.lower() in VIDEO_SUFFIXES]

    def list_files(self, kind: str) -> dict[str, Path]:
        """Return the files of the voices or the faces of the project by their names."""
        folder, suffix = PLACES[kind]
        paths = sorted((self._folder.path / folder).glob(f"*{suffix}"))
        return {path.stem: path for path in paths if path.is_file() and not path.name.startswith(".")}

    def begin(self, kind: str, name: str, numbers: Sequence[int], options: VoiceOptions) -> None:
        """Begin to make a voice or a face. Raises InputError: busy; no such kind, name or videos. ExportError."""
        if kind not in KINDS:
            raise InputError(f"no kind {shorten(repr(kind))}; required {' or '.join(KINDS)}")
        plain = to_file_name(name, "")
        if "/" in name or "\\" in name:
            raise InputError(f"the name {shorten(repr(name))} has a slash; give it a name without one, as Anna")
        if not plain:
            raise InputError(f"the {kind} has no name; give it a name, as that of the person")
        request, number = TrainingRequest(kind, plain, tuple(numbers), options.as_mapping()), 1
        while (self._folder.path / request.file).exists():
            number += 1
            request = replace(request, name=f"{plain}-{number}")
        self._begin(request)

    def retry(self) -> None:
        """Begin again what was stopped, interrupted or has failed, where it was. Raises as ``begin``."""
        if self._request is None or self._status["state"] == DONE:
            raise InputError("nothing was stopped; begin with a voice or a face")
        self._begin(self._request)

    def stop(self) -> None:
        """Stop what is being made, and wait for its end; what is finished of it is kept for ``retry``."""
        with self._lock:
            process, thread = self._process, self._thread
            if self.is_working:
                self._status["state"] = STOPPED
        if process is not None and thread is not None:
            process.kill()
            thread.join()

    def close(self) -> None:
        """End what is being made, silently: it is shown as interrupted when the project is opened again."""
        with self._lock:
            process, thread, self._thread = self._process, self._thread, None
        if process is not None and thread is not None:
            process.kill()
            thread.join()

    def _begin(self, request: TrainingRequest) -> None:
        with self._lock:
            if self.is_working or self._thread is not None:
                raise InputError("a voice or a face is being made; wait for it, or stop it")
            order = self._build_order(request)
            for folder, _ in PLACES.values():  # what was begun and will not be gone on with
                for left in (self._folder.path / folder).glob(f"*{UNFINISHED}"):
                    if left.name != name_work_folder(order.target).name:
                        remove(left)
            before = self._request, self._status
            self._request, self._status = request, {"state": WORKING, **_create_status()}
            try:
                self._write()
            except ExportError:
                self._request, self._status = before
                raise
            self._begun_s, self._first_share, self._ends_s = self._clock(), None, None
            process, pipe = start_process(run_training, order)
            self._process = process
            self._thread = threading.Thread(target=self._follow, args=(process, pipe), name="training", daemon=True)
            self._thread.start()

    def _build_order(self, request: TrainingRequest) -> TrainingOrder:
        folder = self._folder
        videos = {each.number: each for each in self.list_videos()}
        missing = [number for number in request.lines if number not in videos]
        if missing:
            raise InputError(f"recording {missing[0]} is no video of this project; choose among its videos")
        if not request.lines and folder.recordings is None:
            raise InputError(
                "no recordings are chosen; choose some that are videos, or give a folder: lipmotion studio "
                "--recordings FOLDER"
            )
        chosen = tuple(
            TrainingRecording(folder.locate_sound(each).absolute(), each.name, each.transcript, each.sha256)
            for each in map(videos.__getitem__, request.lines)
        )
        place = folder.path.absolute()
        return TrainingOrder(
            request.kind,
            place / request.file,
            place / TRAINING,
            chosen or (folder.recordings or place).absolute(),
            VoiceOptions.stored(request.options),
            folder.lexicon_file and folder.lexicon_file.absolute(),
            max((os.cpu_count() or 2) - 1, 1),  # the page needs one
        )

    def _follow(self, process: BaseProcess, pipe: Connection) -> None:
        with pipe, suppress(EOFError, OSError):
            while True:
                self._take(pipe.recv())
        process.join()
        with self._lock:
            is_closed, self._thread, self._process = self._thread is None, None, None
            if is_closed and self.is_working:
                return
            if self.is_working:
                reason = "it ended without a word; is there enough memory? What is finished is kept: run it again"
                self._status |= {"state": FAILED, "error": reason}
            try:
                self._write()
            except ExportError as error:
                LOG.warning("%s", error)

    def _take(self, report: Mapping[str, Any]) -> None:
        """Take a report; where the work has gone on, estimate anew when it will be done, if it goes on as until now."""
        with self._lock:
            status = self._status
            if "stage" in report:
                now_s, share = self._clock(), min(report["share"], MAX_UNFINISHED)
                if self._first_share is None:
                    self._first_share = share
                elif share > max(status["share"], self._first_share):
                    self._ends_s = now_s + (now_s - self._begun_s) * (1 - share) / (share - self._first_share)
                status |= {"stage": report["stage"], "share": max(share, status["share"])}
            elif "report" in report:
                file = self._request.file if self._request else ""
                status |= {"state": DONE, "share": 1.0, "report": {**report["report"], "file": file}}
            elif "error" in report and self.is_working:
                status |= {"state": FAILED, "error": report["error"]}
            elif "warning" in report:
                _append(status["warnings"], report["warning"])
            elif "skipped" in report:
                _append(status["skipped"], {"name": report["skipped"], "reason": report["reason"]})
            elif "noted" in report:
                _append(status["warnings"], f"{report['noted']}: {report['reason']}")

    def _write(self) -> None:
        make_folder(self._file.parent)
        request = {} if self._request is None else asdict(self._request)
        document = {"format": FORMAT, "version": VERSION, "wanted": request, "told": self._status}
        with atomic_file(self._file) as temporary:
            temporary.write_text(as_json(document, indent=1, ensure_ascii=False), encoding="utf-8")


def _read_job(file: Path) -> tuple[TrainingRequest | None, dict[str, Any]]:
    """Return the last request and its status, if there is one; a file that cannot be read is set aside."""
    if not file.exists():
        return None, {}
    try:
        content = _STATE(from_json(read_text_file(file, "training")))
        request, status = content["wanted"], content["told"]
        VoiceOptions.stored(request.options)  # raises where there are no such options
    except ValueError as error:  # InputError is one
        place = set_aside(file)
        LOG.warning("%s: cannot be read (%s), and is kept as %s; voices and faces stay", file, error, place.name)
        return None, {}
    state = INTERRUPTED if status["state"] == WORKING else status["state"]
    return replace(request, name=to_file_name(request.name)), {**_create_status(), **status, "state": state}


_TEXT, _ANY = values.text(1 << 20), values.any_members(lambda value: value)
_REQUEST = {
    "kind": values.one_of(KINDS),
    "name": _TEXT,
    "lines": values.as_tuple(values.items(values.whole(0, 1 << 31))),
    "options": _ANY,
}
_STATUS = {
    "state": values.one_of((WORKING, DONE, FAILED, STOPPED, INTERRUPTED)),
    "stage": _TEXT,
    "share": values.number(0, 1),
    "warnings": values.items(_TEXT),
    "skipped": values.items(_ANY),
    "error": _TEXT,
    "report": values.optional(_ANY),
}
_JOB = {"wanted": values.value_of(TrainingRequest, _REQUEST, _REQUEST), "told": values.members(_STATUS, ["state"])}
_HEAD = {"format": values.one_of([FORMAT]), "version": values.one_of([VERSION])}
_STATE = values.members(_JOB | _HEAD, (*_HEAD, *_JOB))


def _create_status() -> dict[str, Any]:
    return {"stage": "", "share": 0.0, "warnings": [], "skipped": [], "error": "", "report": None}


def _append(entries: list[Any], new: Any) -> None:
    if len(entries) < MAX_WARNINGS and new not in entries:
        entries.append(new)
