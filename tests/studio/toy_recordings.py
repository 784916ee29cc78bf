"""Recordings that a voice can be trained on without tracking: sounds of the toy, with their motion and words."""

from pathlib import Path

import numpy as np

from pipeline.made import write_sound
from testing.toy import toy_motion, toy_sentences

SENTENCES = 4


def write_takes(folder: Path, count: int) -> None:
    """Write toy sentences into a new folder, as sounds with motion and words."""
    folder.mkdir(parents=True)
    for sentence in toy_sentences(count):
        write_sound(folder / f"{sentence.name}.wav", sentence.audio)
        motion = toy_motion(sentence.units, 100.0)
        table = np.column_stack([motion.time_s, motion.values])
        header = ",".join(("time_s", *motion.names))
        np.savetxt(folder / f"{sentence.name}.csv", table, "%.5f", ",", header=header, comments="")
        (folder / f"{sentence.name}.txt").write_text(" ".join(sentence.words), encoding="utf-8")


def write_recordings(folder: Path) -> Path:
    """Write takes, one of them for the test list, and one without sound."""
    write_takes(folder, SENTENCES)
    (folder / "empty.wav").touch()
    (folder / "empty.csv").write_text("time_s,opening\n0,0\n", encoding="utf-8")
    names = [f"toy{number:02d}" for number in range(SENTENCES)]
    (folder / "train.txt").write_text("\n".join([*names[:-1], "empty"]), encoding="utf-8")
    (folder / "test.txt").write_text(names[-1], encoding="utf-8")
    return folder
