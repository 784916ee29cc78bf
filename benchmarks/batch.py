"""Speed, memory, and kills of ``lipmotion batch``.

    python benchmarks/batch.py speed  [--lines 300] [--seconds 3] [--jobs 2] [--to json] [--speech FOLDER]
    python benchmarks/batch.py memory [--lines 10000] [--seconds 1] [--keep FOLDER]
    python benchmarks/batch.py kills  [--lines 1000] [--seconds 1] [--kills 1] [--seed 0]

The lines are cut out of the recordings in a folder (default: ``examples``) at moments that follow from their number, so
that no two are alike. ``speed`` prints wall and processor time a second of sound, with and without the start of the
processes; ``memory`` the memory of all processes at every tenth of the work; ``kills`` sends ``kill -9`` at random
moments, runs the same command again, and compares every file with those of a run that nobody disturbed, and the ledger:
every output written once. POSIX and Linux only.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time
import wave
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

COMMAND = [sys.executable, "-m", "lipmotion.cli.main", "batch"]
RATE_HZ = 16_000
PAGE = os.sysconf("SC_PAGE_SIZE")


def main() -> None:
    """Run one measurement; print one JSON object a figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["speed", "memory", "kills"])
    parser.add_argument("--lines", type=int)
    parser.add_argument("--seconds", type=float)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--to", default="json")
    parser.add_argument("--recogniser", default="fast")
    parser.add_argument("--speech", type=Path, default=Path(__file__).parent.parent / "examples")
    parser.add_argument("--kills", type=int, default=1)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, help="folder for lines and outputs, which is not deleted")
    options = parser.parse_args()
    lines, seconds = {"speed": (300, 3.0), "memory": (10_000, 1.0), "kills": (1000, 1.0)}[options.what]
    options.lines, options.seconds = options.lines or lines, options.seconds or seconds
    with place(options.keep) as folder:
        write_lines(folder / "lines", options)
        {"speed": speed, "memory": memory, "kills": kills}[options.what](folder, options)


@contextmanager
def place(kept: Path | None) -> Iterator[Path]:
    if kept:
        yield kept
        return
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)


def write_lines(folder: Path, options: argparse.Namespace) -> None:
    """Write the recordings of the batch, in folders of 500."""
    from lipmotion.speech.sound.audio_files import read_audio

    sounds = [read_audio(path).samples for path in sorted(options.speech.iterdir()) if path.suffix in SUFFIXES]
    count = round(options.seconds * RATE_HZ)
    sounds = [sound for sound in sounds if len(sound) > count]
    draw = np.random.default_rng(options.seed)
    for number in range(options.lines):
        sound = sounds[number % len(sounds)]
        start = int(draw.integers(len(sound) - count))
        path = folder / f"scene{number // 500:02}" / f"line{number:05}.wav"
        path.parent.mkdir(parents=True, exist_ok=True)
        with wave.open(str(path), "wb") as file:
            file.setnchannels(1)
            file.setsampwidth(2)
            file.setframerate(RATE_HZ)
            cut = np.clip(sound[start : start + count], -1, 1)
            file.writeframes(np.round(cut * 32767).astype("<i2").tobytes())


SUFFIXES = (".wav", ".flac", ".opus", ".ogg", ".mp3")


def command(folder: Path, out: str, options: argparse.Namespace) -> list[str]:
    """Return the command line of the batch."""
    how = ["--to", options.to, "--recogniser", options.recogniser, "--jobs", str(options.jobs), "--machine-readable"]
    return [*COMMAND, str(folder / "lines"), "--out", str(folder / out), *how]


def speed(folder: Path, options: argparse.Namespace) -> None:
    """Time the whole batch, and a batch of one line a process, which is almost all start-up."""
    few = folder / "few"
    few.mkdir()
    for path in sorted((folder / "lines").rglob("*.wav"))[: options.jobs]:
        (few / path.name).symlink_to(path)
    start = timed([*COMMAND, str(few), *command(folder, "out-few", options)[len(COMMAND) + 1 :]])
    whole = timed(command(folder, "out", options))
    sound_s = options.lines * options.seconds
    show("lines", options.lines, f"of {options.seconds:g} s, --to {options.to}, {options.jobs} processes")
    show("load of the machine", os.getloadavg()[0], "")
    for name, number in (("wall", 0), ("processor", 1)):
        show(f"{name} time", whole[number], "s")
        show(f"{name} time a second of sound", whole[number] / sound_s, "s")
        show(f"{name} time a second of sound, without the start", (whole[number] - start[number]) / sound_s, "s")


def timed(words: list[str]) -> tuple[float, float]:
    """Return wall and processor time of a command and its processes."""
    before, start_s = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return time.perf_counter() - start_s, used_s


def memory(folder: Path, options: argparse.Namespace) -> None:
    """Print the memory of all processes while the work goes on."""
    tenth, done, start_s = max(options.lines // 10, 1), 0, time.perf_counter()
    with subprocess.Popen(command(folder, "out", options), stdout=subprocess.PIPE, text=True) as process:
        for line in process.stdout:
            if json.loads(line)["type"] == "item":
                done += 1
                if done % tenth == 0:
                    first, workers = resident(process.pid)
                    show(f"after {done} lines, first process", first / 1e6, "MB")
                    show(f"after {done} lines, all workers", workers / 1e6, "MB")
    show("exit code", process.returncode, "")
    show("wall time", time.perf_counter() - start_s, "s")
    for name in ("report.html", "report.csv", "batch.jsonl"):
        show(name, (folder / "out" / name).stat().st_size / 1e6, "MB")


def resident(process: int) -> tuple[int, int]:
    """Return the resident bytes of a process, and those of the processes below it."""
    sizes, parents = {}, {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                parents[int(entry.name)] = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
                sizes[int(entry.name)] = int((entry / "statm").read_text().split()[1]) * PAGE
            except OSError:  # it has just ended
                continue
    below, found = {process}, -1
    while len(below) != found:
        found = len(below)
        below |= {child for child, parent in parents.items() if parent in below}
    return sizes.get(process, 0), sum(sizes.get(each, 0) for each in below - {process})


def kills(folder: Path, options: argparse.Namespace) -> None:
    """Kill at random moments and go on, ``--kills`` times in a row before the last run; compare with a whole run."""
    start_s = time.perf_counter()
    subprocess.run(command(folder, "whole", options), check=True, stdout=subprocess.DEVNULL)
    duration_s = time.perf_counter() - start_s
    wanted = contents(folder / "whole")
    draw = random.Random(options.seed)  # noqa: S311
    done = []
    for _ in range(options.kills):
        after_s = draw.uniform(0, duration_s)
        process = subprocess.Popen(command(folder, "out", options), stdout=subprocess.DEVNULL)
        time.sleep(after_s)
        process.send_signal(signal.SIGKILL)
        process.wait()
        done.append(written(folder / "out"))
        show(f"killed after {after_s:.1f} of {duration_s:.1f} s; lines in the ledger", done[-1], "")
    subprocess.run(command(folder, "out", options), check=True, stdout=subprocess.DEVNULL)
    found = contents(folder / "out")
    times = Counter(row["name"] for row in rows(folder / "out"))
    show("files that differ from an undisturbed run", sum(found.get(k) != wanted.get(k) for k in found | wanted), "")
    show("lines", len(times), "")
    show("lines written more than once", sum(count > 1 for count in times.values()), "")
    left = [path.name for path in (folder / "out").iterdir() if path.name.startswith(".")]
    show("unfinished files left", len(left), ", ".join(left))


def rows(out: Path) -> list[dict[str, str]]:
    """Return the rows of the ledger; the last one may have been cut by the kill."""
    path = out / "batch.jsonl"
    return [json.loads(line) for line in path.read_bytes().splitlines(keepends=True) if line.endswith(b"\n")]


def written(out: Path) -> int:
    """Return the number of lines in the ledger."""
    return len(rows(out)) if (out / "batch.jsonl").is_file() else 0


def contents(out: Path) -> dict[str, str]:
    """Return a digest of every output by name, without the reports and the ledger, which hold times."""
    return {
        str(path.relative_to(out)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(out.rglob("*"))
        if path.is_file() and path.name not in ("report.csv", "report.html", "batch.jsonl")
    }


def show(name: str, value: float, unit: str) -> None:
    """Print one figure."""
    print(json.dumps({"figure": name, "value": round(value, 5), "unit": unit}), flush=True)


if __name__ == "__main__":
    main()
