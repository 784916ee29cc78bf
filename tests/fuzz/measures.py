"""What the reading of one input takes: lines of the package that it reaches, memory and processor time."""

import math
import os
import sys
from contextlib import suppress
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import lipmotion

ROOT = str(Path(lipmotion.__file__).parent)
FREQUENT_HITS, RARE_HITS = 500, 50
"""After so many calls without a new line, a function is traced only once in so many calls."""


class LineCoverage:
    """Records every line of the package when it first runs; later runs of the line cost little."""

    def __init__(self) -> None:
        self._new: set[str] = set()

    def taken(self) -> set[str]:
        """Return the lines that first ran since the last call."""
        new, self._new = self._new, set()
        return new

    def watch(self) -> None:
        self._missing: dict[CodeType, set[int]] = {}
        self._calls: dict[CodeType, int] = {}
        sys.settrace(self._called)

    def _called(self, frame: FrameType, *_: object) -> Any:
        code = frame.f_code
        missing = self._missing.get(code)
        if missing is None:
            own = code.co_filename.startswith(ROOT)
            missing = self._missing[code] = {line for *_, line in code.co_lines() if line} if own else set()
        if not missing:
            return None
        calls = self._calls[code] = self._calls.get(code, 0) + 1
        return self._run if calls < FREQUENT_HITS or calls % RARE_HITS == 0 else None

    def _run(self, frame: FrameType, *_: object) -> Any:
        code, line = frame.f_code, frame.f_lineno
        missing = self._missing[code]
        if line in missing:
            missing.remove(line)
            self._calls[code] = 0
            self._new.add(f"{code.co_filename[len(ROOT) + 1 :]}:{line}")
        return self._run if missing else None


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
        self._first_mb = _now_mb("VmRSS")
        self._before_mb = self._first_mb
        limit = round((_now_mb("VmSize") + 3 * most_mb) * MB)
        if resource is not None and sys.platform == "linux":
            resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))

    def begin(self) -> None:
        with suppress(OSError):
            PEAK.write_text("5")  # resets the peak
        self._before_mb = _now_mb("VmRSS")

    def grown_mb(self) -> float:
        """Return the largest growth since ``begin``, in megabytes."""
        return _now_mb("VmHWM") - self._before_mb

    def too_much(self) -> bool:
        """Return whether the growth counts as a defect."""
        return self.grown_mb() > self._most_mb

    def retains_much(self) -> bool:
        """Return whether the process keeps so much memory that it should be replaced."""
        return _now_mb("VmRSS") - self._first_mb > self._most_mb / 2


def _now_mb(name: str) -> float:
    """Return a figure of this process in megabytes; 0 where the system does not provide it."""
    try:
        lines = STATUS.read_text().splitlines()
    except OSError:
        return 0.0
    return next((int(line.split()[1]) / 1024 for line in lines if line.startswith(f"{name}:")), 0.0)


def busy_s(process: int) -> float:
    """Return the processor time of a process in seconds; infinite where the system does not provide it."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return math.inf
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
