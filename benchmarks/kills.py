"""Kill verbs at random moments, run them again, and compare every byte with an undisturbed run.

    PYTHONPATH=tests python benchmarks/kills.py [--kills 500] [--seed 0] [--job NAME ...] [--at-once 2] [-o FILE]

Ctrl-C (SIGINT), ``kill`` (SIGTERM) and ``kill -9`` (SIGKILL) are sent to the first process alone or to all of them, at
moments spread over the whole duration of an undisturbed run, some of them close to its end. Up to ``CHAIN`` kills hit
the same folder before a run may finish there. A run that ends before its signal is compared, but counts as no kill.
The recordings are the toy recordings of the tests. POSIX only.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import platform
import random
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
import wave
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

COMMAND = [sys.executable, "-m", "lipmotion.cli.main"]
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGKILL)
CHAIN = 4
END_SHARE, END_S = 0.2, 0.3
"""Share of the kills that are aimed at the end of a run, and the length of the end in seconds."""
PATIENCE_S = 300
OLD = b"an earlier output"


CLIPS, TRAINING_CLIPS, BATCH_LINES = 3, 6, 96
"""Recordings to track; utterances to train on; utterances for which two processes share the training."""


@dataclass(frozen=True)
class Job:
    """A command.

    replaces : the outputs of a verb that cannot continue after a stop: each is the old file or the complete new one
    differs  : files that no two runs write alike: they hold times
    events   : the stream on which it writes JSON lines, if it does
    weight   : its share of the kills
    """

    name: str
    arguments: tuple[str, ...]
    replaces: tuple[str, ...] = ()
    events: str = ""
    weight: int = 2
    differs: tuple[str, ...] = ()

    @property
    def shown(self) -> str:
        """The command line, with file names instead of paths."""
        return " ".join(["lipmotion", *(Path(word).name if "/" in word else word for word in self.arguments)])


def make_inputs(folder: Path, command: Sequence[str], names: Sequence[str]) -> Path:
    """Write what jobs of these names use: recordings, sounds with motion, corpora and a model; return the folder."""
    from lipmotion.corpora import Corpus
    from testing.toy import toy_utterances, write_toy_recordings

    folder.mkdir()
    write_toy_recordings(folder / "recordings", sentences=CLIPS)
    counts = {"corpus": TRAINING_CLIPS} | ({"large": BATCH_LINES} if "train-share" in names else {})
    utterances = toy_utterances(max(counts.values()))
    for name, count in counts.items():
        corpus = Corpus.create(folder / name)
        for utterance in utterances[:count]:
            corpus.add(utterance)
    (folder / "sounds").mkdir()
    for utterance in utterances[:TRAINING_CLIPS]:
        _write_sound(folder / "sounds" / f"{utterance.name}.wav", utterance)
    train = ["train", folder / "corpus", "-o", folder / "model.lipmotion", "--workers", "1", "--engine", "joint"]
    subprocess.run([*command, *map(str, train)], check=True, capture_output=True)
    shutil.rmtree(folder / "model.lipmotion.unfinished", ignore_errors=True)
    return folder


def _write_sound(path: Path, utterance: object) -> None:
    """Write the sound of an utterance, and its motion as a table beside it."""
    audio, motion = utterance.audio, utterance.track.motion  # type: ignore[attr-defined]
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(audio.rate_hz)
        file.writeframes(np.round(audio.samples * 32767).astype("<i2").tobytes())
    table = np.column_stack([motion.time_s, motion.values])
    np.savetxt(path.with_suffix(".csv"), table, "%.9f", ",", header=f"time_s,{','.join(motion.names)}", comments="")


def _train(name: str, corpus: Path, *more: str, **other: object) -> Job:
    arguments = ("train", str(corpus), "-o", "m.lipmotion", "--machine-readable", *more)
    return Job(name, arguments, events="stdout", **other)  # type: ignore[arg-type]


def _prepare(name: str, recordings: Path, workers: str) -> Job:
    return Job(name, ("corpus", "prepare", str(recordings), "-o", "corpus", "--workers", workers))


def _speech(inputs: Path) -> tuple[str, ...]:
    model = ("--model", str(inputs / "model.lipmotion"), "--recogniser", "own")
    return str(inputs / "recordings" / "toy00.mp4"), *model


def _animate(inputs: Path) -> Job:
    return Job("animate", ("animate", *_speech(inputs), "-o", "a.json", "a.mp4"), ("a.json", "a.mp4"))


def _cues(inputs: Path) -> Job:
    return Job("cues", ("cues", *_speech(inputs), "-o", "a.tsv", "--machine-readable"), ("a.tsv",), "stderr")


def _adapt(inputs: Path) -> Job:
    recordings = [str(inputs / "recordings" / f"toy{n:02}.mp4") for n in range(CLIPS)]
    arguments = ("adapt", *recordings, "--model", str(inputs / "model.lipmotion"), "-o", "a.lipmotion")
    return Job("adapt", arguments, ("a.lipmotion",))


def _batch(inputs: Path) -> Job:
    model = ("--model", str(inputs / "model.lipmotion"), "--recogniser", "own", "--jobs", "2")
    arguments = ("batch", str(inputs / "sounds"), "--out", "out", *model)
    return Job("batch", arguments, differs=("out/batch.jsonl", "out/report.html", "out/report.csv"))


def _live(inputs: Path) -> Job:
    arguments = ("live", str(inputs / "sounds" / "toy00.wav"), "--to", "a.csv", "--as-fast-as-possible")
    return Job("live", (*arguments, "--model", str(inputs / "model.lipmotion")), ("a.csv",))


COUPLED = ("--engine", "coupled", "--set", "chains=sVis 2vis", "--set", "mixtures=1", "--set", "states=2")
MAKERS: dict[str, Callable[[Path], Job]] = {
    "prepare": lambda inputs: _prepare("prepare", inputs / "recordings", "1"),
    "prepare-sounds": lambda inputs: _prepare("prepare-sounds", inputs / "sounds", "2"),
    "train": lambda inputs: _train("train", inputs / "corpus", "--workers", "1"),
    "train-joint": lambda inputs: _train("train-joint", inputs / "corpus", "--workers", "1", "--engine", "joint"),
    "train-coupled": lambda inputs: _train("train-coupled", inputs / "corpus", "--workers", "1", *COUPLED),
    "train-share": lambda inputs: _train("train-share", inputs / "large", "--workers", "2", weight=1),
    "animate": _animate,
    "cues": _cues,
    "adapt": _adapt,
    "batch": _batch,
    "live": _live,
}


LINE = "lipmotion: stopped; run the same command again to go on"
EARLY_SHARE = 0.5
"""Before this share of its usual duration, Python may still be starting, without the program's signal handlers."""


def verdict(number: int, code: int, out: str, err: str, share: float, job: Job) -> tuple[str, str]:
    """Return how a killed run ended, and what is wrong with it; an empty text if nothing is.

    number, code : the signal, and the exit code
    out, err     : standard output and standard error
    share        : time of the signal relative to the usual duration
    """
    early = not out and share < EARLY_SHARE
    if number == signal.SIGKILL:
        return "killed at once", "" if code == -number else f"exit code {code}: {err}"
    if "runpy" in err or (code == -number and early):
        return "before the program had begun", ""
    if code != 128 + number:
        what = "killed without a word" if code == -number else f"exit code {code}"
        return what, f"at {share:.0%} of its duration, with output {out[-200:]!r} and {err!r}"
    return _stopped(out, err, job)


def _stopped(out: str, err: str, job: Job) -> tuple[str, str]:
    events, others = events_and_lines(out if job.events == "stdout" else err)
    if job.events and (not events or events[-1].get("type") != "failure"):
        return "no failure event", f"said {out!r} and {err!r}"
    lines = err.splitlines() if job.events != "stderr" else others
    if lines != [LINE] and not (job.events == "stderr" and not lines):
        return "other words", f"said {err!r}"
    return "stopped with one line", ""


def events_and_lines(text: str) -> tuple[list[dict[str, object]], list[str]]:
    """Return the JSON objects among the lines, and the other lines."""
    events, others = [], []
    for line in text.splitlines():
        if line.startswith("{"):
            events.append(json.loads(line))
        else:
            others.append(line)
    return events, others


@dataclass
class KillRecord:
    """Outcomes of the kills of one job."""

    job: Job
    duration_s: float = 0.0
    kills: int = 0
    counts: Counter[str] = field(default_factory=Counter)
    problems: list[str] = field(default_factory=list)
    lock: threading.Lock = field(default_factory=threading.Lock)

    def count(self, what: str, problem: str = "", *, kill: bool = False) -> None:
        """Count one outcome, and record its problem, if there is one."""
        with self.lock:
            self.kills += kill
            self.counts[what] += 1
            if problem:
                self.problems.append(f"{what}: {problem}")


@dataclass(frozen=True)
class Goal:
    """Result of an undisturbed run: digests of its files by name, and its duration."""

    content: dict[str, str]
    duration_s: float


def main() -> int:
    """Print a table; return 1 if anything went wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=500, help="of all jobs together (default: 500)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--job", action="append", choices=sorted(MAKERS), help="this one only (repeatable)")
    parser.add_argument("--at-once", type=int, default=os.cpu_count() or 1, help="runs at a time (default: one a core)")
    parser.add_argument("-o", "--output", type=Path, help="write the table to this file, too")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        names = options.job or list(MAKERS)
        inputs = make_inputs(Path(folder) / "inputs", COMMAND, names)
        before = content(inputs)
        jobs = [MAKERS[name](inputs) for name in names]
        records = []
        with ThreadPoolExecutor(options.at_once) as pool:
            for job, kills in shared(jobs, options.kills):
                records.append(kill_often(job, Path(folder), kills, options.seed, pool))
                print(f"{job.name}: {records[-1].kills} kills, {len(records[-1].problems)} problems", file=sys.stderr)
        changed = sorted(name for name, found in content(inputs).items() if before.get(name) != found)
    text = written(records, changed, options)
    print(text)
    if options.output:
        options.output.write_text(text + "\n", encoding="utf-8")
    return int(bool(changed) or any(record.problems for record in records))


def shared(jobs: list[Job], kills: int) -> Iterator[tuple[Job, int]]:
    """Yield each job and its number of kills, in proportion to its weight."""
    left, weight = kills, sum(job.weight for job in jobs)
    for job in jobs:
        share = round(left * job.weight / weight)
        yield job, share
        left, weight = left - share, weight - job.weight


def kill_often(job: Job, folder: Path, kills: int, seed: int, pool: ThreadPoolExecutor) -> KillRecord:
    """Kill ``kills`` runs, in rounds that each end with a complete run; return the outcomes."""
    goal = undisturbed(job, folder, pool)
    record = KillRecord(job, goal.duration_s)

    def one_round(number: int) -> None:
        here, chance = folder / f"{job.name}-{number}", random.Random(f"{seed} {job.name} {number}")  # noqa: S311
        kill_and_finish(here, chance, min(CHAIN, kills - CHAIN * number), goal, record)
        shutil.rmtree(here)

    list(pool.map(one_round, range(-(-kills // CHAIN))))
    return record


def undisturbed(job: Job, folder: Path, pool: ThreadPoolExecutor) -> Goal:
    """Return the result of undisturbed runs, with the duration while as many run in parallel as later."""

    def whole(number: int) -> Goal:
        here = fresh(folder / f"{job.name}-whole-{number}", job)
        start_s = time.monotonic()
        done = run(job, here)
        if done.returncode:
            raise SystemExit(done.stderr)
        found = Goal(content(here, job), time.monotonic() - start_s)
        shutil.rmtree(here)
        return found

    goals = list(pool.map(whole, range(2)))
    if any(goal.content != goals[0].content for goal in goals):
        raise SystemExit(f"{job.name}: two undisturbed runs differ")
    return Goal(goals[0].content, statistics.median(goal.duration_s for goal in goals))


def fresh(here: Path, job: Job) -> Path:
    """Return a new folder; with outputs of an earlier run, if the verb replaces them."""
    shutil.rmtree(here, ignore_errors=True)
    here.mkdir()
    for name in job.replaces:
        (here / name).write_bytes(OLD)
    return here


def run(job: Job, here: Path) -> subprocess.CompletedProcess[str]:
    """Run a command to its end."""
    return subprocess.run([*COMMAND, *job.arguments], cwd=here, capture_output=True, text=True, check=False)


def kill_and_finish(here: Path, chance: random.Random, kills: int, goal: Goal, record: KillRecord) -> None:
    """Kill ``kills`` runs in one folder, then let one finish, and compare its result."""
    fresh(here, record.job)
    for _ in range(kills):
        missed = 0
        while not kill_once(here, moment_s(chance, goal.duration_s) / 2**missed, chance, goal, record):
            missed += 1  # ended before: aim earlier, since runs are shorter once other work on the machine has ended
            compare(here, goal, record, "had ended already")
            fresh(here, record.job)
    finished = run(record.job, here)
    if finished.returncode:
        record.count("could not go on", finished.stderr)
    else:
        compare(here, goal, record, "same bytes after going on")


def compare(here: Path, goal: Goal, record: KillRecord, what: str) -> None:
    """Record whether a complete run left exactly the expected files."""
    found = content(here, record.job)
    names = sorted(name for name in found.keys() | goal.content.keys() if found.get(name) != goal.content.get(name))
    record.count("other bytes, or other files" if names else what, ", ".join(names))


def moment_s(chance: random.Random, duration_s: float) -> float:
    """Return the time at which a signal is sent, in seconds after the start."""
    if chance.random() < END_SHARE:
        return max(chance.uniform(duration_s - END_S, duration_s + END_S / 3), 0.0)
    return chance.uniform(0, duration_s)


def kill_once(here: Path, after_s: float, chance: random.Random, goal: Goal, record: KillRecord) -> bool:
    """Start the job, kill it after ``after_s``, record its messages and files; return False if it had ended before."""
    number, to_all = chance.choice(SIGNALS), chance.random() < 0.5
    before, pipe = set(content(here)), subprocess.PIPE
    with subprocess.Popen(
        [*COMMAND, *record.job.arguments], cwd=here, stdout=pipe, stderr=pipe, text=True, start_new_session=True
    ) as process:
        time.sleep(after_s)
        if process.poll() is None:
            (os.killpg if to_all else os.kill)(process.pid, number)
        streams = process.communicate(timeout=PATIENCE_S)
    if process.returncode == 0:
        return False
    what, problem = verdict(number, process.returncode, *streams, after_s / goal.duration_s, record.job)
    left = unwanted(here, before, goal, record.job, number)
    problem = problem or (f"left {', '.join(left)}" if left else "")
    name = f"{signal.Signals(number).name} to {'all' if to_all else 'the first'}"
    record.count(f"{name}, {what}", f"{problem} (after {after_s:.3f} s)" if problem else "", kill=True)
    return True


def unwanted(here: Path, before: set[str], goal: Goal, job: Job, number: int) -> list[str]:
    """Return the files that a killed run should not have left: partial files, locks, incomplete outputs."""
    old, found = hashlib.sha256(OLD).hexdigest(), content(here)
    torn = [name for name in job.replaces if found.get(name) not in (old, goal.content[name])]
    new = [name for name in found if name not in before]
    temporary = [name for name in new if ".part-" in name]
    others = [name for name in new if job.replaces and name not in goal.content and name not in temporary]
    return torn + others + ([] if number == signal.SIGKILL else temporary)


def content(here: Path, job: Job | None = None) -> dict[str, str]:
    """Return a digest of every file by name; an empty text for folders, and for files that differ."""
    paths = sorted(here.rglob("*"))
    found = {str(path.relative_to(here)): path for path in paths}
    plain = {name for name, path in found.items() if path.is_file() and not (job and name in job.differs)}
    return {
        name: hashlib.sha256(path.read_bytes()).hexdigest() if name in plain else "" for name, path in found.items()
    }


def written(records: list[KillRecord], changed: list[str], options: argparse.Namespace) -> str:
    """Return the table as text."""
    machine = f"{platform.system()}, Python {platform.python_version()}, {os.cpu_count()} cores"
    kills, problems = sum(record.kills for record in records), sum(len(record.problems) for record in records)
    found = f"{kills} kills, {problems} problems, {len(changed)} inputs changed"
    lines = [f"{found}; seed {options.seed}; {machine}, {options.at_once} at once"]
    for record in records:
        lines += [
            "",
            f"{record.job.name}: {record.kills} kills, undisturbed {record.duration_s:.1f} s",
            f"  {record.job.shown}",
        ]
        lines += [f"  {count:5} {what}" for what, count in sorted(record.counts.items())]
        lines += [f"  WRONG {problem}" for problem in record.problems]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
