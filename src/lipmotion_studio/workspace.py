"""Recordings at work: which are open, which wait for analysis, and the thread of each.

All methods are called in the thread of the server's loop; what takes long runs in other threads: one for each recording
that is open, and one that analyses those that wait, one after another.
"""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from collections import OrderedDict, deque
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from typing import Any, TypeVar

from starlette.exceptions import HTTPException

from lipmotion.errors import InputError, LipMotionError
from lipmotion.pipeline.model import Model
from lipmotion.speech.sound.analysed_audio import AnalysedAudio
from lipmotion.types import Item, Progress
from lipmotion.types.progress import warnings_to
from lipmotion_studio.folder import NO_EDITS, ProjectFolder
from lipmotion_studio.project import ProjectRecording
from lipmotion_studio.recording import OpenRecording, analyse_recording, open_recording

LOG = logging.getLogger("lipmotion")
ResultT = TypeVar("ResultT")
NEW, WAITING, WORKING, READY, FAILED = STATUSES = ("new", "waiting", "working", "ready", "failed")
MAX_OPEN, MAX_OPEN_S = 12, 3600.0
"""Recordings that stay open, and the seconds of sound in them together: what was used last is closed last."""
SAVED_EACH = 50  # recordings after which the project is written during analysis; and after the last one
RECENT_S = 60.0  # how long a recording that is done, or failed, is listed among those at work


class NotReadyError(HTTPException):
    """A recording is still being analysed."""

    def __init__(self) -> None:
        super().__init__(503, "the recording is still being analysed; ask again", {"retry-after": "1"})


class StoppedError(LipMotionError):
    """What was being done is not wanted any more."""


class Work:
    """What happens to a recording.

    since_s : when the status changed, by a clock that only grows
    thread  : in which it is worked on, once it has been opened
    users   : requests that need it now
    stopped : whether what is done for it is to end soon
    """

    def __init__(self, number: int) -> None:
        self.number, self.status, self.error = number, WAITING, ""
        self.stage, self.share, self.since_s = "", 0.0, time.monotonic()
        self.recording: OpenRecording | None = None
        self.thread: ThreadPoolExecutor | None = None
        self.users, self.stopped = 0, False

    @property
    def progress(self) -> dict[str, Any]:
        """What is being done, and the share of it that is done."""
        return {"stage": self.stage, "share": round(self.share, 3)}

    def set_status(self, status: str, error: str = "") -> None:
        """Go over to another status."""
        self.status, self.error, self.since_s = status, error, time.monotonic()

    def report(self, event: Progress | Item) -> None:
        """Take a report of the progress. Raises StoppedError: the work is not wanted any more."""
        if self.stopped:
            raise StoppedError("stopped")
        if isinstance(event, Progress):
            self.stage, self.share = event.stage, event.share

    def close(self) -> None:
        """Close the recording and its thread."""
        if self.thread is not None:
            self.thread.shutdown(wait=False, cancel_futures=True)
        self.recording = self.thread = None


class Workspace:
    """The recordings of a project at work."""

    def __init__(self, folder: ProjectFolder, model: Model) -> None:
        self.folder, self.model = folder, model
        self._works: OrderedDict[int, Work] = OrderedDict()
        self._waiting: deque[Work] = deque()
        self.misfits: dict[int, list[str]] = {}  # what the analysis of each recording warned of
        self._analysing = threading.Lock()
        self._background = ThreadPoolExecutor(1, "understand")

    def find_status(self, recording: ProjectRecording) -> str:
        """Return the status of a recording: one of ``STATUSES``."""
        work, summary = self._works.get(recording.number), self.folder.summarise(recording)
        if work is not None and not (work.status == READY and summary.error):
            return work.status
        return FAILED if summary.error else NEW if summary is NO_EDITS else READY

    def find_work(self, number: int) -> Work | None:
        """Return what happens to a recording; None: nothing."""
        return self._works.get(number)

    def find_error(self, recording: ProjectRecording) -> str:
        """Return why a recording has failed; empty: it has not."""
        work = self._works.get(recording.number)
        return (work.error if work is not None else "") or self.folder.summarise(recording).error

    def list_current(self) -> list[Work]:
        """Return the recordings that wait or are at work, and those that were until a short while ago."""
        recent = time.monotonic() - RECENT_S
        return [work for work in self._works.values() if work.status in (WAITING, WORKING) or work.since_s > recent]

    def queue(self, numbers: Iterable[int]) -> int:
        """Queue new and failed recordings for analysis, after those that wait already; return how many wait."""
        for number in numbers:
            if self.find_status(self.folder.find_recording(number)) in (NEW, FAILED):
                self.forget(number)
                work = self._works[number] = Work(number)
                self._waiting.append(work)
                self._background.submit(self._analyse_next)
        return len(self._waiting)

    def open(self, number: int) -> Work:
        """Return what happens to a recording, which is opened if it is not; a new one is analysed ahead of others."""
        work = self._works.get(number)
        if work is not None and work.recording is not None and not work.users:
            with self.folder.lock:  # others than the studio may have changed its file
                is_behind = self.folder.summarise(self.folder.find_recording(number)) is not work.recording.summary
            if is_behind:
                self.forget(number)
                work = None
        if work is None:
            work = self._works[number] = Work(number)
        if work.status == FAILED:  # until it is queued again
            return work
        with suppress(ValueError):
            self._waiting.remove(work)
        self._works.move_to_end(number)
        if work.thread is None:
            work.thread = ThreadPoolExecutor(1, f"line-{number}")
            if work.status == READY:
                work.set_status(WORKING)
            work.thread.submit(self._run, work, self._open)
            self._close_others(work)
        return work

    async def run(self, number: int, do: Callable[[OpenRecording], ResultT]) -> ResultT:
        """Do something with an open recording, in its thread. Raises NotReadyError: in analysis. LipMotionError."""
        work = self.open(number)
        recording, thread = work.recording, work.thread
        if work.status == FAILED:
            raise InputError(work.error)
        if recording is None or thread is None:
            raise NotReadyError
        work.users += 1
        try:
            return await asyncio.get_running_loop().run_in_executor(thread, do, recording)
        except asyncio.CancelledError:
            if work.stopped:  # the recording was closed before its turn came: nothing has been done
                raise NotReadyError from None
            raise
        finally:
            work.users -= 1

    def forget(self, number: int) -> None:
        """Close a recording, and what is cached of it."""
        work = self._works.pop(number, None)
        if work is not None:
            work.stopped = True
            work.close()
            with suppress(ValueError):
                self._waiting.remove(work)

    def use(self, model: Model) -> None:
        """Go over to another model: recordings that are open are opened with it, once they are wanted again."""
        self.model = model
        for number, work in list(self._works.items()):
            if work.recording is None or work.thread is None:
                continue
            if work.users:
                work.recording = None
                work.thread.submit(self._run, work, self._open)
            else:
                work.close()
                del self._works[number]

    def close(self) -> None:
        """Close all recordings, and wait for what is at work."""
        self._waiting.clear()
        self._background.shutdown(wait=False, cancel_futures=True)
        for work in self._works.values():
            work.stopped = True
            work.close()
        self.folder.save()

    def _close_others(self, newest: Work) -> None:
        """Close the recordings that were used least recently, until the others are not too many."""
        works = [work for work in reversed(self._works.values()) if work.thread is not None]
        open_s = 0.0
        for place, work in enumerate(works):
            open_s += work.recording.audio.duration_s if work.recording else 0.0
            is_over = place >= MAX_OPEN or open_s > MAX_OPEN_S
            if is_over and work is not newest and work.recording and not work.users:
                work.close()
                del self._works[work.number]

    def _analyse_next(self) -> None:
        with suppress(IndexError):  # it has been opened since, and is analysed in its own thread
            self._run(self._waiting.popleft(), self._analyse)

    def _open(self, work: Work) -> None:
        audio, recording = self._analyse(work), self.folder.find_recording(work.number)
        model = None
        while model is not self.model:  # another one may be used since
            model = self.model
            work.recording = open_recording(self.folder, recording, model, audio)

    def _analyse(self, work: Work) -> AnalysedAudio | None:
        """Analyse a recording, if it is not yet, and return its sound; one at a time."""
        with self._analysing:
            recording = self.folder.find_recording(work.number)
            summary = self.folder.summarise(recording)
            if summary.error:
                raise InputError(summary.error)
            if summary is not NO_EDITS:
                return None
            work.set_status(WORKING)
            misfits = self.misfits[work.number] = list[str]()
            with warnings_to(misfits.append, of_thread=True):
                audio = analyse_recording(self.folder, recording, self.model, work.report)
            if len(self._waiting) % SAVED_EACH == 0:
                self.folder.save()
            return audio

    def _run(self, work: Work, do: Callable[[Work], object]) -> None:
        """Do something for a recording, and keep how it ended; nothing is raised."""
        try:
            work.set_status(WORKING if work.thread is not None else work.status)
            do(work)
            work.set_status(READY)
        except (LipMotionError, OSError) as error:
            work.set_status(FAILED, str(error))
        except Exception as error:  # a bug, which must not stop the others
            LOG.error("recording %d: %s: %s", work.number, type(error).__name__, error)
            work.set_status(FAILED, f"a bug: {type(error).__name__}: {error}")
        if work.status == FAILED and work.thread is not None:
            work.close()
