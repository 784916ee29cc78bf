"""Where, when and with what the figures of an experiment were made."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import shlex
import shutil
import subprocess
from collections.abc import Sequence
from datetime import datetime, timezone
from importlib import metadata
from pathlib import Path
from time import perf_counter
from typing import Any

from lipmotion.corpora.source_recordings import SPLITS
from lipmotion.corpora.store import Corpus
from lipmotion.engines import ENGINES
from lipmotion.kernels.threads import blas_kernels
from lipmotion.pipeline.training.labels import digest_corpus
from lipmotion_lab.runner import ExperimentSettings

PACKAGES = ("lipmotion", "numpy", "scipy", "numba", "av", "pocketsphinx", "hama", "matplotlib")
"""Packages on which figures, or pictures, depend."""
ROOT = Path(__file__).parents[3]
"""The root of a checkout of the source, where the package is in one."""
DIGITS = 8
"""Digits of a SHA-256 that name an engine's options."""
CPU_INFO = Path("/proc/cpuinfo")
"""Where Linux names the processor."""


class Stamp:
    """What the figures of an experiment are stamped with; its time begins when it is made."""

    def __init__(self) -> None:
        self._begun = datetime.now(timezone.utc)
        self._start_s = perf_counter(), sum(os.times()[:4])

    def content(self, command: Sequence[str], corpus: Corpus, settings: ExperimentSettings) -> dict[str, Any]:
        """Return command, time, corpus, seed, options, commit, engines, machine and versions, by name.

        command : its words; of absolute paths the last name is kept, for figures are given to others
        The time is that of this call: a call that goes on after a stop does not count what was finished before.
        Processor seconds are those of this process and of its processes that have ended. None: not known, or not
        installed.
        """
        seconds, used = perf_counter() - self._start_s[0], sum(os.times()[:4]) - self._start_s[1]
        words = (word.rpartition("=") for word in command)
        lists = {split: len(corpus.names(split)) for split in SPLITS}
        lexicon = "the user's" if settings.lexicon else "none but the dictionary"
        return {
            "command": shlex.join(
                f"{option}{equals}{Path(value).name if Path(value).is_absolute() else value}"
                for option, equals, value in words
            ),
            "begun": self._begun.isoformat(timespec="seconds"),
            "seconds": round(seconds, 1),
            "processor seconds": round(used, 1),
            "corpus": {"name": corpus.path.resolve().name, "SHA-256": digest_corpus(corpus), **lists},
            "seed": settings.seed,
            "options": {"workers": settings.workers, "lexicon": lexicon},
            "commit": commit(ROOT),
            "engines": {name: engine_digest(name) for name in ENGINES.built_in},
            **_machine(),
        }


def engine_digest(name: str) -> str:
    """Return the digits that name the default options of an engine."""
    options = json.dumps(ENGINES.load(name).Config().as_mapping(), sort_keys=True)
    return hashlib.sha256(options.encode()).hexdigest()[:DIGITS]


def _machine() -> dict[str, Any]:
    try:
        lines = CPU_INFO.read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    versions: dict[str, str | None] = {"Python": platform.python_version()}
    for package in PACKAGES:
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            versions[package] = None
    machine = {
        "cores": os.cpu_count(),
        "processor": named[0] if named else platform.processor() or platform.machine(),
        "system": platform.platform(),
        "linear algebra": ", ".join(map(str, blas_kernels())),
    }
    return {"machine": machine, "versions": versions}


def commit(root: Path) -> str | None:
    """Return the commit of a checkout of the source, and whether its ``src`` was changed since; None: it is none."""
    git = shutil.which("git")
    if git is None or not (root / ".git").exists():
        return None

    def ask(*arguments: str) -> str | None:
        done = subprocess.run([git, "-C", str(root), *arguments], capture_output=True, text=True, check=False)
        return done.stdout.strip() if done.returncode == 0 else None

    head = ask("rev-parse", "HEAD")
    return f"{head}, changed since" if head and ask("status", "--porcelain", "--", "src") else head
