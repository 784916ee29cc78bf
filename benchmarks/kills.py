"""Kill ``corpus prepare`` and ``train`` at random moments, go on, and compare every byte with an uninterrupted run.

    python benchmarks/kills.py [--kills 100] [--seed 0] [--job prepare|train|share]

Ctrl-C (SIGINT), ``kill`` (SIGTERM) and ``kill -9`` (SIGKILL) are sent to the first process alone or to all of them, at
moments spread over the whole duration of an uninterrupted run; every other run is killed a second time. The recordings
are the package's own toy recordings. POSIX only.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

COMMAND = [sys.executable, "-m", "lipmotion.cli.main"]
LINE = "lipmotion: stopped; run the same command again to go on"
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGKILL)
LOCK = ".part-lock"
"""May be left where the signal came between making and holding it: it never blocks, and the next run removes it."""
CLIPS, MANY = 6, 96  # of so many utterances, enough are for training to be shared between two processes
PATIENCE_S = 300


@dataclass(frozen=True)
class Job:
    """A command, by name."""

    name: str
    arguments: tuple[str, ...]


@dataclass
class Tally:
    """What was seen."""

    counts: Counter[str] = field(default_factory=Counter)
    problems: list[str] = field(default_factory=list)


def main() -> int:
    """Print a table; return 1 if anything went wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=100, help="runs killed of each job (default: 100)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--job", choices=("prepare", "train", "share"))
    options = parser.parse_args()
    failed = False
    with tempfile.TemporaryDirectory() as folder:
        for job in jobs(Path(folder)):
            if options.job in (None, job.name):
                tally = kill_often(job, Path(folder), options.kills, random.Random(options.seed))  # noqa: S311
                failed = show(job, options.kills, tally) or failed
    return int(failed)


def jobs(folder: Path) -> Iterator[Job]:
    """Give the jobs: preparing recordings, training on them, training on more in two processes."""
    from lipmotion.corpora.store import Corpus
    from lipmotion.pipeline.toy import toy_utterances, write_toy_recordings

    write_toy_recordings(folder / "recordings", sentences=CLIPS)
    prepare = ("corpus", "prepare", str(folder / "recordings"), "-o", "corpus", "--workers", "2")
    yield Job("prepare", prepare)
    run(prepare, folder)
    yield Job("train", ("train", str(folder / "corpus"), "-o", "m.lipmotion"))
    large = Corpus.create(folder / "large")
    for utterance in toy_utterances(MANY):
        large.add(utterance)
    yield Job("share", ("train", str(large.path), "-o", "m.lipmotion", "--workers", "2"))


def kill_often(job: Job, folder: Path, kills: int, chance: random.Random) -> Tally:
    """Kill ``kills`` runs and finish each."""
    tally = Tally()
    whole, duration_s = uninterrupted(job, folder / f"whole-{job.name}")
    print(f"{job.name}: {duration_s:.1f} s uninterrupted", file=sys.stderr)
    for number in range(kills):
        here = folder / f"{job.name}-{number}"
        here.mkdir()
        kill_once(job, here, chance, duration_s, tally)
        if number % 2:
            kill_once(job, here, chance, duration_s / 2, tally)
        finished = run(job.arguments, here)
        if finished.returncode != 0:
            tally.problems.append(f"{number}: could not go on: {finished.stderr}")
        elif content(here) != whole:
            tally.problems.append(f"{number}: other bytes, or other files: {sorted(set(content(here)) ^ set(whole))}")
        else:
            tally.counts["same bytes after going on"] += 1
        shutil.rmtree(here)
    return tally


def uninterrupted(job: Job, here: Path) -> tuple[dict[str, str], float]:
    """Return what a run leaves that nobody disturbs, and how long it takes."""
    durations_s = []
    for _ in range(3):  # the first one fills the system's caches
        shutil.rmtree(here, ignore_errors=True)
        here.mkdir()
        start_s = time.monotonic()
        done = run(job.arguments, here)
        if done.returncode:
            raise SystemExit(done.stderr)
        durations_s.append(time.monotonic() - start_s)
    return content(here), min(durations_s)


def run(arguments: tuple[str, ...], here: Path) -> subprocess.CompletedProcess[str]:
    """Run a command to its end."""
    return subprocess.run([*COMMAND, *arguments], cwd=here, capture_output=True, text=True, check=False)


def kill_once(job: Job, here: Path, chance: random.Random, duration_s: float, tally: Tally) -> None:
    """Start the job, kill it at some moment, and look at what it says and leaves."""
    number, to_all = chance.choice(SIGNALS), chance.random() < 0.5
    moment_s, before = chance.uniform(0, duration_s), leftovers(here)
    pipe = subprocess.PIPE
    with subprocess.Popen(
        [*COMMAND, *job.arguments], cwd=here, stdout=pipe, stderr=pipe, text=True, start_new_session=True
    ) as process:
        time.sleep(moment_s)
        if to_all:
            os.killpg(process.pid, number)
        else:
            process.send_signal(number)
        _, said = process.communicate(timeout=PATIENCE_S)
    name = f"{signal.Signals(number).name} to {'all' if to_all else 'the first'}"
    tally.counts[name] += 1
    left = [] if number == signal.SIGKILL else [path for path in leftovers(here) if path not in before]
    problem = judged(number, process.returncode, said, left, tally)
    if problem:
        tally.problems.append(f"{name} after {moment_s:.3f} s: {problem}")


def judged(number: int, code: int, said: str, left: list[str], tally: Tally) -> str:
    """Return what is wrong with how a killed run ended, empty if nothing is."""
    if "runpy" in said:
        tally.counts["before Python had begun with the program"] += 1
        return ""
    if code == 0:
        tally.counts["had ended already"] += 1
    elif code == -number:
        tally.counts["killed at once"] += 1
    elif code != 128 + number:
        return f"exit code {code}: {said}"
    elif said.splitlines() != [LINE]:
        return f"said {said!r}"
    else:
        tally.counts["stopped with one line"] += 1
    if number != signal.SIGKILL and "Traceback" in said:  # a process whose parent is gone may well complain
        return f"said {said!r}"
    return f"left {left}" if left else ""


def leftovers(here: Path) -> list[str]:
    """Return unfinished files."""
    return [str(path.relative_to(here)) for path in here.rglob(".part-*") if path.name != LOCK]


def content(here: Path) -> dict[str, str]:
    """Return a digest of every file, by name."""
    files = (path for path in sorted(here.rglob("*")) if path.is_file())
    return {str(path.relative_to(here)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def show(job: Job, kills: int, tally: Tally) -> bool:
    """Print the table of one job; return whether something went wrong."""
    print(f"{job.name}: {kills} runs killed")
    for name, count in sorted(tally.counts.items()):
        print(f"  {count:5} {name}")
    for problem in tally.problems:
        print(f"  WRONG {problem}")
    return bool(tally.problems)


if __name__ == "__main__":
    sys.exit(main())
