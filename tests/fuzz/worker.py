"""A process in which readers are run, as bad input may crash or hang it, and what the reading of one input takes."""

from __future__ import annotations

import faulthandler
import math
import multiprocessing
import os
import re
import shutil
import signal
import sys
import tempfile
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from types import TracebackType
from typing import Any

from fuzz.inputs import Files, Good, Reader
from fuzz.judge import CRASH, HANG, LEFT, MEMORY, READ, REFUSED, Result, quiet, read_result

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

MB = 1 << 20
STATUS, PEAK = Path("/proc/self/status"), Path("/proc/self/clear_refs")


class Memory:
    """Measures by how much one input makes this process grow, and limits its size.

    most_mb : growth that counts as a defect; the address space is limited to three times as much
    """

    MAX_MB = 500

    def __init__(self, most_mb: int) -> None:
        self._most_mb = most_mb
        self._first_mb = self._before_mb = _now_mb("VmRSS")
        limit = round((_now_mb("VmSize") + 3 * most_mb) * MB)
        if resource is not None and sys.platform == "linux":
            resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))

    def begin(self) -> None:
        with suppress(OSError):
            PEAK.write_text("5")  # resets the peak
        self._before_mb = _now_mb("VmRSS")

    def excess_mb(self) -> float:
        """Return the largest growth since ``begin``, in megabytes, where it counts as a defect, else 0."""
        grown_mb = _now_mb("VmHWM") - self._before_mb
        return grown_mb if grown_mb > self._most_mb else 0.0

    def retains_much(self) -> bool:
        """Return whether the process keeps so much memory that it should be replaced."""
        return _now_mb("VmRSS") - self._first_mb > self._most_mb / 2


def _now_mb(name: str) -> float:
    """Return a figure of this process in megabytes; 0 where the system does not provide it."""
    lines = STATUS.read_text().splitlines() if STATUS.is_file() else []
    return next((int(line.split()[1]) / 1024 for line in lines if line.startswith(f"{name}:")), 0.0)


def busy_s(process: int) -> float:
    """Return the processor time of a process in seconds; infinite where the system does not provide it."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return math.inf
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


HANG_S = 20.0
PATIENCE = 3
"""Factor between clock time and processor time that is allowed where other processes keep the processor busy."""
START_S = 300.0  # longest start of the process: the first import compiles kernels
Readers = dict[str, Reader]


class Worker:
    """Runs readers on inputs in a process; a process that crashed or hangs is replaced by another.

    readers : a function that returns the readers by name; None: all readers
    hang_s  : processor time after which a reader counts as hanging; ``PATIENCE`` times as long by the clock
    """

    def __init__(
        self, good: Good, *, hang_s: float = HANG_S, memory_mb: int = Memory.MAX_MB, readers: Any = None
    ) -> None:
        self._arguments = (good, memory_mb, readers)
        self._hang_s = hang_s
        self._process: Any = None
        self._folder = tempfile.TemporaryDirectory(prefix="lipmotion-fuzz-")
        self._log = Path(self._folder.name) / "log"

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._end()
        self._folder.cleanup()

    def read_input(self, reader: str, files: Files) -> Result:
        if self._process is None:
            self._start()
        try:
            self._pipe.send((reader, files))
            if self._answered():
                result, replace_process = self._pipe.recv()
                if replace_process:
                    self._end()
                return result
        except (EOFError, OSError):
            return self._died()
        return self._hung()

    def _answered(self) -> bool:
        """Return whether an answer arrives before the reader counts as hanging."""
        before_s = busy_s(self._process.pid)
        for _ in range(4 * PATIENCE):
            if self._pipe.poll(self._hang_s / 4):
                return True
            if busy_s(self._process.pid) - before_s > self._hang_s:
                break
        return False

    def _start(self) -> None:
        spawn = multiprocessing.get_context("spawn")
        self._pipe, theirs = spawn.Pipe()
        self._log.write_bytes(b"")
        self._process = spawn.Process(target=serve, args=(theirs, self._folder.name, *self._arguments), daemon=True)
        self._process.start()
        theirs.close()
        if not self._pipe.poll(START_S):
            raise RuntimeError(f"the reading process does not start: {self._log_text()}")
        try:
            self._pipe.recv()
        except EOFError as error:
            raise RuntimeError(f"the reading process ended: {self._log_text()}") from error

    def _died(self) -> Result:
        self._process.join()
        code = self._process.exitcode
        name = signal.Signals(-code).name if code < 0 else f"exit {code}"
        log_text = self._log_text()
        self._end()
        return Result(CRASH, f"{name} {_place(log_text)}", log_text)

    def _hung(self) -> Result:
        if hasattr(signal, "SIGUSR1"):
            os.kill(self._process.pid, signal.SIGUSR1)
            self._process.join(1.0)
        log_text = self._log_text()
        self._end()
        return Result(HANG, _place(log_text), log_text)

    def _log_text(self) -> str:
        return self._log.read_text(encoding="utf-8", errors="replace")[-4000:]

    def _end(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._pipe.close()
        self._process = None


def serve(pipe: Any, folder: str, good: Good, memory_mb: int, readers: Any) -> None:
    """Read the inputs that arrive through the pipe, in a folder that must stay empty."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is handled by the parent process
    here, log = Path(folder) / "here", (Path(folder) / "log").open("a")
    here.mkdir(exist_ok=True)
    for number in (1, 2):
        os.dup2(log.fileno(), number)
    faulthandler.enable(log)
    if hasattr(faulthandler, "register"):
        faulthandler.register(signal.SIGUSR1, log)
    os.chdir(here)
    tempfile.tempdir = str(here)
    quiet()
    known = import_module("fuzz.readers").READERS if readers is None else readers()
    memory = Memory(memory_mb)
    pipe.send("ready")
    with suppress(EOFError, OSError):
        while True:
            reader, files = pipe.recv()
            memory.begin()
            result = read_result(known[reader], files, Path(folder) / "bad", good)
            pipe.send((_checked(result, memory, here), memory.retains_much()))


def _checked(result: Result, memory: Memory, here: Path) -> Result:
    """Return the result; a defect instead, if the reader used too much memory or left files behind."""
    left = sorted(path.name for path in here.iterdir())
    for name in left:
        shutil.rmtree(here / name, ignore_errors=True) if (here / name).is_dir() else (here / name).unlink()
    if result.kind in (READ, REFUSED) and (excess_mb := memory.excess_mb()):
        return Result(MEMORY, result.where or result.kind, f"{excess_mb:.0f} MB; {result.detail}")
    if result.kind in (READ, REFUSED) and left:
        return Result(LEFT, "beside it", ", ".join(left))
    return result


def _place(log_text: str) -> str:
    """Return the innermost function of the package in a trace of faulthandler."""
    found = re.search(r'File ".*?lipmotion/([^"]*\.py)", line \d+ in (\S+)', log_text)
    return f"{Path(found[1]).name}:{found[2]}" if found else "outside"
