"""How exactly two recordings of one scene are brought into step: clips of GRID with a clap, a beep, or nothing.

    python benchmarks/sound_offset.py GRID [TRIALS]

GRID : the folder of one speaker, with ``clips``. Three clips in a row are the scene; a camera records it in a room (as
much energy in echoes as straight, noise), a recorder at the mouth, from another time on. In the rows "mark alone", the
recorder has silence after the mark.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
from lipmotion.errors import InputError
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.sound.sound_offset import sound_offset
from speech.recorded_twice import RATE_HZ, beep, clap, recorded_twice


def error_ms(clips: list[Path], mark: str, noise_db: float, alone: bool, chance: np.random.Generator) -> float | None:
    """Return the error of one trial, or None where the offset was refused as not clear."""
    spoken = [read_audio(path).samples for path in chance.choice(np.array(clips), 3)]
    scene = np.concatenate([np.zeros(int(2.5 * RATE_HZ)), *spoken, np.zeros(RATE_HZ)]).astype(float)
    at = int(chance.uniform(0.8, 1.3) * RATE_HZ)
    if mark:
        made = clap(chance) if mark == "clap" else beep()
        scene[at : at + len(made)] += made
    cut, before = int(chance.integers(0, RATE_HZ // 2)), int(chance.integers(0, 4 * RATE_HZ))
    camera, recorder, late_s = recorded_twice(scene, chance, cut, before, noise_db)
    if alone:
        scene[at + int(0.3 * RATE_HZ) :] = 0
        _, recorder, _ = recorded_twice(scene, chance, cut, before, noise_db)
    try:
        return abs(sound_offset(camera, recorder).late_s - late_s) * 1000
    except InputError:
        return None


def main() -> None:
    """Print one row for every kind of mark and noise."""
    clips = sorted((Path(sys.argv[1]) / "clips").iterdir())
    trials = int(sys.argv[2]) if len(sys.argv) > 2 else 50
    print("| in both | noise | refused | median error | largest error |\n|---|---|---|---|---|")
    for mark, alone in (("clap", False), ("clap", True), ("beep", False), ("beep", True), ("", False)):
        for noise_db in (20.0, 5.0):
            chance = np.random.default_rng(1)
            found = [error_ms(clips, mark, noise_db, alone, chance) for _ in range(trials)]
            errors = [error for error in found if error is not None]
            figures = f"{np.median(errors):.2f} ms | {max(errors):.2f} ms" if errors else "– | –"
            what = f"{mark} alone" if alone else f"{mark} and speech" if mark else "speech"
            print(f"| {what} | {noise_db:.0f} dB below | {found.count(None)} of {trials} | {figures} |", flush=True)


if __name__ == "__main__":
    main()
