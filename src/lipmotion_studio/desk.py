"""Lines at work: which are open, which wait to be understood, and the thread of each.

All methods are called in the thread of the server's loop; what takes long runs in other threads: one for each line that
is open, and one that understands the lines that wait, one after another.
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
from typing import TypeVar

from starlette.exceptions import HTTPException

from lipmotion.errors import InputError, LipMotionError
from lipmotion.pipeline.model import Model
from lipmotion.speech.features.analysed_audio import AnalysedAudio
from lipmotion.types import Item, Progress
from lipmotion_studio.folder import NO_EDITS, ProjectFolder
from lipmotion_studio.line import OpenLine
from lipmotion_studio.project import ProjectLine
from lipmotion_studio.understanding import open_line, understand_line

LOG = logging.getLogger("lipmotion")
ResultT = TypeVar("ResultT")
NEW, WAITING, WORKING, READY, FAILED = STATUSES = ("new", "waiting", "working", "ready", "failed")
MOST_OPEN, MOST_OPEN_S = 12, 3600.0
"""Lines that stay open, and the seconds of sound in them together: what was used last is closed last."""
SAVED_EACH = 50
"""Lines after which the project is written while lines are understood; and after the last one."""
RECENT_S = 60.0
"""How long a line that is done, or failed, is told among those at work."""


class NotReadyError(HTTPException):
    """A line is still being understood."""

    def __init__(self) -> None:
        super().__init__(503, "the line is still being understood; ask again", {"retry-after": "1"})


class StoppedError(LipMotionError):
    """What was being done is not wanted any more."""


class Work:
    """What happens to a line.

    number  : of the line
    status, stage, share, error : as the page shows them
    since_s : when the status changed, by a clock that only grows
    line    : once the line is open
    thread  : in which it is worked on, once it has been opened
    users   : requests that need it now
    stopped : whether what is done for it is to end soon
    """

    def __init__(self, number: int) -> None:
        self.number, self.status, self.error = number, WAITING, ""
        self.stage, self.share, self.since_s = "", 0.0, time.monotonic()
        self.line: OpenLine | None = None
        self.thread: ThreadPoolExecutor | None = None
        self.users, self.stopped = 0, False

    def turn(self, status: str, error: str = "") -> None:
        """Go over to another status."""
        self.status, self.error, self.since_s = status, error, time.monotonic()

    def report(self, event: Progress | Item) -> None:
        """Take a report of the progress. Raises StoppedError: the work is not wanted any more."""
        if self.stopped:
            raise StoppedError("stopped")
        if isinstance(event, Progress):
            self.stage, self.share = event.stage, event.share


class Desk:
    """The lines of a project at work.

    model : of the project
    """

    def __init__(self, folder: ProjectFolder, model: Model) -> None:
        self.folder, self.model = folder, model
        self._works: OrderedDict[int, Work] = OrderedDict()
        self._waiting: deque[Work] = deque()
        self._understanding = threading.Lock()
        self._background = ThreadPoolExecutor(1, "understand")

    def status(self, line: ProjectLine) -> str:
        """Return what is to be said of a line."""
        work, summary = self._works.get(line.number), self.folder.summary(line)
        if work is not None and not (work.status == READY and summary.error):
            return work.status
        return FAILED if summary.error else NEW if summary is NO_EDITS else READY

    def work(self, number: int) -> Work | None:
        """Return what happens to a line; None: nothing."""
        return self._works.get(number)

    def error(self, line: ProjectLine) -> str:
        """Return why a line has failed; empty: it has not."""
        work = self._works.get(line.number)
        return (work.error if work is not None else "") or self.folder.summary(line).error

    def at_work(self) -> list[Work]:
        """Return the lines that wait or are at work, and those that were until a short while ago."""
        recent = time.monotonic() - RECENT_S
        return [work for work in self._works.values() if work.status in (WAITING, WORKING) or work.since_s > recent]

    def queue(self, numbers: Iterable[int]) -> int:
        """Let lines be understood that are new, after those that wait already; return how many wait."""
        for number in numbers:
            if self.status(self.folder.line(number)) in (NEW, FAILED):
                self.forget(number)
                work = self._works[number] = Work(number)
                self._waiting.append(work)
                self._background.submit(self._understand_next)
        return len(self._waiting)

    def opened(self, number: int) -> Work:
        """Return what happens to a line, which is opened if it is not; a new one is understood ahead of others."""
        work = self._works.get(number)
        if work is not None and work.line is not None and not work.users and self._is_behind(work.line):
            self.forget(number)
            work = None
        if work is None:
            work = self._works[number] = Work(number)
        if work.status == FAILED:  # until it is queued again
            return work
        self._no_longer_waits(work)
        self._works.move_to_end(number)
        if work.thread is None:
            work.thread = ThreadPoolExecutor(1, f"line-{number}")
            if work.status == READY:
                work.turn(WORKING)
            work.thread.submit(self._open, work)
            self._close_others(work)
        return work

    def _is_behind(self, line: OpenLine) -> bool:
        """Return whether others than the studio have changed the file of an open line."""
        with self.folder.lock:
            return self.folder.summary(self.folder.line(line.number)) is not line.summary

    async def at(self, number: int, do: Callable[[OpenLine], ResultT]) -> ResultT:
        """Do something with an open line, in its thread; return the result.

        Raises NotReadyError: it is still being understood. LipMotionError: it has failed, and why; or as ``do``.
        """
        work = self.opened(number)
        line, thread = work.line, work.thread
        if work.status == FAILED:
            raise InputError(work.error)
        if line is None or thread is None:
            raise NotReadyError
        work.users += 1
        try:
            return await asyncio.get_running_loop().run_in_executor(thread, do, line)
        except asyncio.CancelledError:
            if work.stopped:  # the line was closed before its turn came: nothing has been done
                raise NotReadyError from None
            raise
        finally:
            work.users -= 1

    async def beside(self, do: Callable[[], ResultT]) -> ResultT:
        """Do something in another thread that needs no open line; return the result. Raises as ``do``."""
        return await asyncio.get_running_loop().run_in_executor(None, do)

    def forget(self, number: int) -> None:
        """Close a line, and what is kept of it."""
        work = self._works.pop(number, None)
        if work is not None:
            work.stopped = True
            _close(work)
            self._no_longer_waits(work)

    def use(self, model: Model) -> None:
        """Go over to another model: lines that are open are opened with it, once they are wanted again.

        Edits that are on their way are made and written before that.
        """
        self.model = model
        for number, work in list(self._works.items()):
            if work.line is None or work.thread is None:
                continue
            if work.users:
                work.line = None
                work.thread.submit(self._open, work)
            else:
                _close(work)
                del self._works[number]

    def _no_longer_waits(self, work: Work) -> None:
        with suppress(ValueError):
            self._waiting.remove(work)

    def close(self) -> None:
        """Close all lines, and wait for what is at work."""
        self._waiting.clear()
        self._background.shutdown(wait=False, cancel_futures=True)
        for work in self._works.values():
            work.stopped = True
            _close(work)
        self.folder.save()

    def _close_others(self, kept: Work) -> None:
        """Close the lines that were used least recently, until the others are not too many."""
        works = [work for work in reversed(self._works.values()) if work.thread is not None]
        open_s = 0.0
        for place, work in enumerate(works):
            open_s += work.line.audio.duration_s if work.line else 0.0
            if (place >= MOST_OPEN or open_s > MOST_OPEN_S) and work is not kept and work.line and not work.users:
                _close(work)
                del self._works[work.number]

    def _understand_next(self) -> None:
        with suppress(IndexError):  # it has been opened since, and is understood in its own thread
            work = self._waiting.popleft()
            self._run(work, lambda: self._understand(work))

    def _open(self, work: Work) -> None:
        def opening() -> None:
            audio, line = self._understand(work), self.folder.line(work.number)
            model = self.model
            work.line = open_line(self.folder, line, model, audio)
            while model is not self.model:  # another one is used since
                model = self.model
                work.line = open_line(self.folder, line, model, audio)

        self._run(work, opening)

    def _understand(self, work: Work) -> AnalysedAudio | None:
        """Understand a line that is not yet, and return its sound; one at a time."""
        with self._understanding:
            line = self.folder.line(work.number)
            summary = self.folder.summary(line)
            if summary.error:
                raise InputError(summary.error)
            if summary is not NO_EDITS:
                return None
            work.turn(WORKING)
            audio = understand_line(self.folder, line, self.model, work.report)
            if len(self._waiting) % SAVED_EACH == 0:
                self.folder.save()
            return audio

    def _run(self, work: Work, do: Callable[[], object]) -> None:
        """Do something for a line, and keep how it ended; nothing is raised."""
        try:
            work.turn(WORKING if work.thread is not None else work.status)
            do()
            work.turn(READY)
        except (LipMotionError, OSError) as error:
            work.turn(FAILED, str(error))
        except Exception as error:  # a bug, which must not stop the others
            LOG.error("line %d: %s: %s", work.number, type(error).__name__, error)
            work.turn(FAILED, f"a bug: {type(error).__name__}: {error}")
        if work.status == FAILED and work.thread is not None:
            _close(work)


def _close(work: Work) -> None:
    if work.thread is not None:
        work.thread.shutdown(wait=False, cancel_futures=True)
    work.line = work.thread = None
