"""Memory and processor time that the reading of one input takes."""

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
    """Measures by how much one input makes this process grow, and limits its size.

    most_mb : growth that counts as a defect; the address space is limited to three times as much
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
        """Start a new measurement."""
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
