"""``PYTHONPATH=tests python benchmarks/versions.py OLD NEW [--repeats 7]``: start-up and ``animate`` of two checkouts.

Each job runs in a process of its own with the tree's ``src`` first on the path, old and new in turn, so that a noisy
machine slows both. Printed are medians of wall-clock seconds, and the ratio of new to old.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

VERB = "import sys; from lipmotion.cli.main import main; sys.exit(main(sys.argv[1:]))"
IMPORT, LONG_S = "import lipmotion", 60


def main() -> None:
    """Print a line for each job."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("old", type=Path)
    parser.add_argument("new", type=Path)
    parser.add_argument("--repeats", type=int, default=7)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        long = _long_recording(Path(folder))
        welcome, said = (options.new / "examples" / f"welcome.{kind}" for kind in ("flac", "txt"))
        jobs = {
            "import lipmotion": [IMPORT],
            "--help": [VERB, "--help"],
            "animate, 5 s, audio only": [VERB, "animate", welcome, "-o", Path(folder) / "a.npz"],
            "animate, 5 s, transcript": [VERB, "animate", welcome, "--transcript", said, "-o", Path(folder) / "a.npz"],
            f"animate, {LONG_S} s, audio only": [VERB, "animate", long, "-o", Path(folder) / "a.npz"],
            "animate, 5 s, to a video": [VERB, "animate", welcome, "-o", Path(folder) / "a.mp4"],
        }
        for name, job in jobs.items():
            seconds: dict[Path, list[float]] = {options.old: [], options.new: []}
            for _ in range(options.repeats + 1):
                for tree, found in seconds.items():
                    found.append(_seconds(tree, job))
            old, new = (median(found[1:]) for found in seconds.values())  # the first run fills caches
            print(f"{name:28} {old:7.3f} s {new:7.3f} s   ratio {new / old:.2f}")


def _seconds(tree: Path, job: list[object]) -> float:
    environment = os.environ | {"PYTHONPATH": str(tree.resolve() / "src")}
    start_s = time.perf_counter()
    subprocess.run([sys.executable, "-c", *map(str, job)], env=environment, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - start_s


def _long_recording(folder: Path) -> Path:
    """Write the toy corpus's sentences one after another, as long as ``LONG_S``; return the file."""
    import wave

    import numpy as np

    from testing.toy import toy_sentences

    samples = np.concatenate([sentence.audio.samples for sentence in toy_sentences(30)])[: LONG_S * 16_000]
    path = folder / "long.wav"
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(16_000)
        file.writeframes(np.round(samples * 32767).astype("<i2").tobytes())
    return path


if __name__ == "__main__":
    main()
