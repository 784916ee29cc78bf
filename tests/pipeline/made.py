"""What tests of several rooms make: corpora of utterances, and sounds of noise."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from scipy.io import wavfile

from lipmotion import Corpus
from lipmotion.types import Utterance


def corpus_of(folder: Path, utterances: Iterable[Utterance]) -> Corpus:
    corpus = Corpus.create(folder)
    for utterance in utterances:
        corpus.add(utterance)
    return corpus


def write_noise(path: Path, seconds: float = 1.0, seed: int = 0, rate_hz: int = 16_000) -> None:
    """Write noise as a WAV file, whatever its suffix is."""
    path.parent.mkdir(parents=True, exist_ok=True)
    samples = np.random.default_rng(seed).integers(-9000, 9000, int(seconds * rate_hz))
    wavfile.write(path, rate_hz, samples.astype("<i2"))
