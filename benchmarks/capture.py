"""One's own capture trains a model: takes of Live Link Face with sound → corpus → model → a new take, and how well.

    python benchmarks/capture.py FACEGOOD WORK

FACEGOOD : the folder of that corpus, real curves with sound; they are written again as the app writes takes: 60 rows
           a second at uneven times, some of them lost, 61 curves with a timecode. The first recording is held out
WORK     : an empty folder for takes, corpus, model and the result
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
import wave
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
from lipmotion.corpora.facegood import read_bare_motion, read_channels
from lipmotion.corpora.source_recordings import MotionFile
from lipmotion.formats import read_motion
from lipmotion.types import WEIGHT, Channel, Motion
from meshes.live_link_app import write_take

HELD_OUT = "1114_2_01"
TAKEN = {
    "jawOpen": ["mouth_stretch_c"],
    "mouthPucker": ["mouth_pucker_l", "mouth_pucker_r"],
    "mouthFunnel": ["mouth_funnel_dl", "mouth_funnel_dr", "mouth_funnel_ul", "mouth_funnel_ur"],
    "mouthLowerDownLeft": ["mouth_lowerLipDepress_l"],
    "mouthLowerDownRight": ["mouth_lowerLipDepress_r"],
    "mouthUpperUpLeft": ["mouth_upperLipRaise_l"],
    "mouthUpperUpRight": ["mouth_upperLipRaise_r"],
    "mouthPressLeft": ["mouth_press_l"],
    "mouthPressRight": ["mouth_press_r"],
    "mouthSmileLeft": ["mouth_lipCornerPull_l"],
    "mouthSmileRight": ["mouth_lipCornerPull_r"],
    "mouthRollLower": ["mouth_suck_dl", "mouth_suck_dr"],
    "mouthRollUpper": ["mouth_suck_ul", "mouth_suck_ur"],
    "mouthStretchLeft": ["mouth_lipStretch_l"],
    "mouthStretchRight": ["mouth_lipStretch_r"],
}
"""ARKit's curves, each the mean of FACEGOOD's that are nearest to it; FACEGOOD's others are left out."""
LOST_SHARE, JITTER_S = 0.01, 0.003
"""Share of the rows that the app loses, and how uneven their times are."""


def write_takes(corpus: Path, folder: Path) -> dict[str, Motion]:
    """Write every recording as a take with its sound; return their curves."""
    folder.mkdir(parents=True)
    channels = read_channels(next(corpus.glob("*_bs_name.npy")))
    takes, chance = {}, np.random.default_rng(17)
    for sound in sorted(corpus.glob("*.wav")):
        whole = read_bare_motion(MotionFile(corpus / f"bs_value_{sound.stem}.npy", 30.0, channels))
        columns = [np.mean([whole[name] for name in names], axis=0) for names in TAKEN.values()]
        motion = Motion(np.stack(columns, axis=1), 30.0, tuple(Channel(name, WEIGHT) for name in TAKEN))
        with wave.open(str(sound)) as file:
            rows = int(file.getnframes() / file.getframerate() * 60)
        times_s = np.arange(rows) / 60 + chance.uniform(-JITTER_S, JITTER_S, rows)
        kept = chance.random(rows) >= LOST_SHARE
        kept[[0, -1]] = True
        write_take(folder / f"{sound.stem}.csv", motion, np.maximum(times_s, 0)[kept])
        (folder / sound.name).write_bytes(sound.read_bytes())
        takes[sound.stem] = motion
    (folder / "test.txt").write_text(f"{HELD_OUT}\n")
    return takes


def timed(*arguments: object) -> None:
    """Run a command of lipmotion; print how long it took."""
    before, start_s = os.times(), time.monotonic()
    subprocess.run([sys.executable, "-m", "lipmotion.cli.main", *map(str, arguments)], check=True)
    after = os.times()
    used_s = after.children_user + after.children_system - before.children_user - before.children_system
    print(f"{arguments[0]}: {time.monotonic() - start_s:.1f} s, {used_s:.1f} s of processor time", flush=True)


def main() -> None:
    """Write takes, train, animate the held-out sound, and compare."""
    corpus, work = map(Path, sys.argv[1:3])
    takes = write_takes(corpus, work / "takes")
    timed("corpus", "prepare", work / "takes", "-o", work / "corpus")
    timed("train", work / "corpus", "-o", work / "mine.lipmotion")
    made = work / "new.livelink.csv"
    timed("animate", work / "takes" / f"{HELD_OUT}.wav", "--model", work / "mine.lipmotion", "-o", made)
    motion, original = read_motion(made)[0], takes[HELD_OUT]
    print(f"{made.name}: {len(motion.values)} rows at {motion.rate_hz:g} Hz, {len(motion.names)} curves")
    held = original.at(motion.time_s)
    scores = {}
    for column, name in enumerate(original.names):
        if held[:, column].std() > 0.01:
            scores[name] = float(np.corrcoef(held[:, column], motion[name])[0, 1])
    for name, score in sorted(scores.items(), key=lambda item: -item[1]):
        print(f"{name:22} {score:.2f}")
    print(f"mean of {len(scores)} curves that move: {np.mean(list(scores.values())):.2f}")


if __name__ == "__main__":
    main()
