"""The commands that ``kills.py`` kills, and their inputs."""

from __future__ import annotations

import shutil
import subprocess
import wave
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

CLIPS, TRAINING_CLIPS, BATCH_LINES = 3, 6, 96
"""Recordings to track; utterances to train on; utterances for which two processes share the training."""


@dataclass(frozen=True)
class Job:
    """A command.

    replaces : the outputs of a verb that cannot continue after a stop: each is the old file or the complete new one
    events   : the stream on which it writes JSON lines, if it does
    weight   : its share of the kills
    """

    name: str
    arguments: tuple[str, ...]
    replaces: tuple[str, ...] = ()
    events: str = ""
    weight: int = 2

    @property
    def shown(self) -> str:
        """The command line, with file names instead of paths."""
        return " ".join(["lipmotion", *(Path(word).name if "/" in word else word for word in self.arguments)])


def make_inputs(folder: Path, command: Sequence[str], names: Sequence[str]) -> Path:
    """Write what jobs of these names use: recordings, sounds with motion, corpora and a model; return the folder."""
    from lipmotion.corpora.store import Corpus
    from lipmotion.testing.toy import toy_utterances, write_toy_recordings

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


def _animate(inputs: Path) -> Job:
    speech = (
        str(inputs / "recordings" / "toy00.mp4"),
        "--model",
        str(inputs / "model.lipmotion"),
        "--recogniser",
        "own",
    )
    return Job("animate", ("animate", *speech, "-o", "a.json", "a.mp4"), ("a.json", "a.mp4"))


def _cues(inputs: Path) -> Job:
    speech = (
        str(inputs / "recordings" / "toy00.mp4"),
        "--model",
        str(inputs / "model.lipmotion"),
        "--recogniser",
        "own",
    )
    return Job("cues", ("cues", *speech, "-o", "a.tsv", "--machine-readable"), ("a.tsv",), "stderr")


def _adapt(inputs: Path) -> Job:
    recordings = [str(inputs / "recordings" / f"toy{n:02}.mp4") for n in range(CLIPS)]
    arguments = ("adapt", *recordings, "--model", str(inputs / "model.lipmotion"), "-o", "a.lipmotion")
    return Job("adapt", arguments, ("a.lipmotion",))


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
}
