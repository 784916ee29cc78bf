"""Corpora that differ from the toy corpus in one way, and sentences that are seen in part."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from lipmotion import Corpus
from lipmotion.types import Channel, Utterance
from lipmotion_lab.runner import ExperimentSettings
from testing.toy import SMALL

SETTINGS = ExperimentSettings(recogniser=SMALL)


def copied(corpus: Corpus, folder: Path, change: Callable[[Utterance], Utterance]) -> Corpus:
    result = Corpus.create(folder / "copy")
    for name in corpus.names():
        result.add(change(corpus.utterance(name)))
    return result


def renamed(corpus: Corpus, folder: Path, *names: str) -> Corpus:
    """Return a copy of the corpus with the first channels under other names, and without the others."""

    def change(utterance: Utterance) -> Utterance:
        motion = utterance.track.motion
        channels, values = tuple(map(Channel, names)), motion.values[:, : len(names)]
        return replace(
            utterance, track=replace(utterance.track, motion=replace(motion, channels=channels, values=values))
        )

    return copied(corpus, folder, change)
