"""How much memory, and how much of a processor, one input takes."""

from __future__ import annotations

import math
import os
import sys
from contextlib import suppress
from pathlib import Path

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

MB = 1 << 20
STATUS, PEAK = Path("/proc/self/status"), Path("/proc/self/clear_refs")


class Memory:
    """Measures what one input adds to the memory of this process, and bounds it.

    most_mb : what is too much; three times as much, in address space, cannot be had at all
    """

    MOST_MB = 500

    def __init__(self, most_mb: int) -> None:
        self._most_mb = most_mb
        self._first_mb = _now_mb("VmRSS")
        self._before_mb = self._first_mb
        limit = round((_now_mb("VmSize") + 3 * most_mb) * MB)
        if resource is not None and sys.platform == "linux":
            resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))

    def begin(self) -> None:
        """Measure from here on."""
        with suppress(OSError):
            PEAK.write_text("5")  # of the peak alone
        self._before_mb = _now_mb("VmRSS")

    def grown_mb(self) -> float:
        """Return by how much the process has been larger than at the beginning."""
        return _now_mb("VmHWM") - self._before_mb

    def too_much(self) -> bool:
        """Whether that is too much."""
        return self.grown_mb() > self._most_mb

    def weary(self) -> bool:
        """Whether so much is kept that a new process is better."""
        return _now_mb("VmRSS") - self._first_mb > self._most_mb / 2


def _now_mb(name: str) -> float:
    """Return a figure of this process, 0 where the system does not tell."""
    try:
        lines = STATUS.read_text().splitlines()
    except OSError:
        return 0.0
    return next((int(line.split()[1]) / 1024 for line in lines if line.startswith(f"{name}:")), 0.0)


def busy_s(process: int) -> float:
    """Return the processor time of a process, infinite where the system does not tell."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return math.inf
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
