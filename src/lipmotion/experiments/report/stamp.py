"""Where and with what the figures of a report were made."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
from importlib import metadata
from pathlib import Path
from typing import Any

from lipmotion.kernels.threads import blas_kernels

PACKAGES = ("lipmotion", "numpy", "scipy", "numba", "av", "pocketsphinx", "hama", "matplotlib")
"""Packages on which figures, or pictures, depend."""
ROOT = Path(__file__).parents[4]
"""The root of a checkout of the source, where the package is in one."""
CPU_INFO = Path("/proc/cpuinfo")
"""Where Linux names the processor."""


def machine_stamp() -> dict[str, Any]:
    """Return commit, machine and versions, by name; None for what is not known or not installed."""
    return {
        "commit": commit(ROOT),
        "machine": {
            "cores": os.cpu_count(),
            "processor": _processor(),
            "system": platform.platform(),
            "linear algebra": ", ".join(map(str, blas_kernels())),
        },
        "versions": {"Python": platform.python_version(), **{name: _version(name) for name in PACKAGES}},
    }


def commit(root: Path) -> str | None:
    """Return the commit of a checkout of the source, and whether its ``src`` was changed since; None: it is none."""
    git = shutil.which("git")
    if git is None or not (root / ".git").exists():
        return None

    def said(*arguments: str) -> str | None:
        done = subprocess.run([git, "-C", str(root), *arguments], capture_output=True, text=True, check=False)
        return done.stdout.strip() if done.returncode == 0 else None

    found = said("rev-parse", "HEAD")
    return f"{found}, changed since" if found and said("status", "--porcelain", "--", "src") else found


def _processor() -> str:
    try:
        lines = CPU_INFO.read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return named[0] if named else platform.processor() or platform.machine()


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None
