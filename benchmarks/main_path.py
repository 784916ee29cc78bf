"""Speed of the main path: start-up, animation, tracking; with --full also preparing and training.

    python benchmarks/main_path.py [--grid FOLDER] [--full]

Whole processes are timed from outside, after a first run (caches on disk, nothing in memory), median of ``--repeats``.
The speed of the machine is printed, too: compare ratios within one run, not absolute figures of different runs.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
import wave
from pathlib import Path

import numpy as np

COMMAND = [sys.executable, "-m", "lipmotion.cli.main"]
EXAMPLE = Path(__file__).parent.parent / "examples" / "welcome.flac"


def main() -> None:
    """Print one JSON object per figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--grid", type=Path, default=Path("../shared/corpora/grid-s1"))
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--full", action="store_true", help="also prepare and train on all of --grid (minutes)")
    options = parser.parse_args()
    show("machine: float32 GEMM 1024", gemm_seconds(), "s")
    show("import lipmotion", seconds([sys.executable, "-c", "import lipmotion"], options.repeats), "s")
    show("lipmotion --help", seconds([*COMMAND, "--help"], options.repeats), "s")
    with tempfile.TemporaryDirectory() as folder:
        speech = sixty_seconds(Path(folder) / "speech.wav")
        animate = [*COMMAND, "animate", str(speech), "-o", str(Path(folder) / "motion.json")]
        show("animate 60 s to .json, whole process", seconds(animate, options.repeats), "s")
        show("animate 60 s, warm, in one process", warm_seconds(speech, options.repeats), "s")
        if options.grid.is_dir():
            show("track, one process", frames_per_second(options.grid), "frames/s")
            if options.full:
                prepare_and_train(options.grid, Path(folder))


def show(name: str, value: float, unit: str) -> None:
    """Print one figure."""
    print(json.dumps({"figure": name, "value": round(value, 4), "unit": unit}), flush=True)


def seconds(command: list[str], repeats: int) -> float:
    """Return the median wall time of a whole process, after one run that is not counted."""
    times = []
    for _ in range(repeats + 1):
        start = time.perf_counter()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        times.append(time.perf_counter() - start)
    return statistics.median(times[1:])


def gemm_seconds() -> float:
    """Return the time of one matrix product of 2.1 GFLOP, the median of nine."""
    a = np.ones((1024, 1024), np.float32)
    times = []
    for _ in range(9):
        start = time.perf_counter()
        a @ a
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def sixty_seconds(path: Path) -> Path:
    """Write 60 s of sound: the example sentence repeated; return the path."""
    from lipmotion.speech.sound.audio_files import read_audio

    audio = read_audio(EXAMPLE)
    samples = np.resize(audio.samples, 60 * audio.rate_hz)
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(audio.rate_hz)
        file.writeframes((samples * 32767).astype("<i2").tobytes())
    return path


def warm_seconds(speech: Path, repeats: int) -> float:
    """Return the median time of ``lipmotion.animate`` with everything loaded."""
    import lipmotion

    lipmotion.animate(speech)
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        lipmotion.animate(speech)
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def frames_per_second(grid: Path, clips: int = 10) -> float:
    """Return the tracking speed over some clips, decoding and mouth crops included."""
    try:
        from lipmotion_faces.tracking.track import track
    except ImportError:
        return float("nan")
    videos = sorted((grid / "clips").iterdir())[: clips + 1]
    track(videos[0])
    start = time.perf_counter()
    frames = sum(len(track(video).motion.values) for video in videos[1:])
    return frames / (time.perf_counter() - start)


def prepare_and_train(grid: Path, folder: Path) -> None:
    """Measure the two long jobs once."""
    corpus, model = folder / "corpus", folder / "model.lipmotion"
    for name, command in (
        ("corpus prepare", ["corpus", "prepare", str(grid), "-o", str(corpus)]),
        ("train", ["train", str(corpus), "-o", str(model)]),
    ):
        start = time.perf_counter()
        subprocess.run([*COMMAND, *command], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        show(name, time.perf_counter() - start, "s")


if __name__ == "__main__":
    main()
