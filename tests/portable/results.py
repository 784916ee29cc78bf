"""``python -m portable.results OUT.npz``: write the results that are compared between processors, as arrays."""

import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

import lipmotion
from lipmotion import Corpus, Model, Selection, train
from lipmotion.engines import engine_named
from lipmotion.motion import posterior_network
from lipmotion.speech.features.f0 import log_f0
from lipmotion.speech.features.mfcc import mfcc
from lipmotion.types import Audio, Generation
from testing.heard import hear_once
from testing.toy import SMALL, toy_sentences, toy_utterances

RATE_HZ = 16_000
WELCOME = Path(__file__).parents[2] / "examples" / "welcome.flac"
TRAINED = {
    "trajectory": ("trajectory", {"predictor": "prior"}),
    "network": ("trajectory", {}),
    "joint": ("joint", {"mixtures": 1}),
    "coupled": ("coupled", {"chains": "sVis 2vis", "mixtures": 1, "articulation": False}),
}
"""Engines and options of the models that are trained."""
Results = Iterator[tuple[str, NDArray[np.generic]]]


def without_speech() -> dict[str, Audio]:
    """Return sounds of which all features are 0."""
    values = {"silence": np.zeros(RATE_HZ), "a minute of silence": np.zeros(60 * RATE_HZ)}
    values |= {"constant": np.full(RATE_HZ, 0.3), "faint constant": np.full(3 * RATE_HZ, 1e-6)}
    values |= {"half the sampling rate": np.tile([0.5, -0.5], RATE_HZ)}
    return {name: Audio(samples.astype(np.float32), RATE_HZ) for name, samples in values.items()}


def front_ends() -> Results:
    for name, audio in without_speech().items():
        yield f"features of {name}", mfcc(audio).values
    speech = toy_sentences(3)[1].audio
    yield "features of speech", mfcc(speech).values
    yield "F0 of speech", np.nan_to_num(log_f0(speech))


def generated(name: str, made: Generation) -> Results:
    yield f"{name}: motion", made.motion.values
    yield f"{name}: phones", np.array([span.label.phone for span in made.units])
    yield f"{name}: times", np.array([span.end_s for span in made.units])


def animated(name: str, model: Model | None, speech: Audio | Path) -> Results:
    silent = Audio(np.zeros(2 * RATE_HZ, np.float32), RATE_HZ)
    yield from generated(f"{name}, speech", lipmotion.animate(speech, model=model))
    yield from generated(f"{name}, silence", lipmotion.animate(silent, model=model))


def trained() -> Results:
    """Yield the results of models that are trained here; of networks by few steps: every one rounds anew."""
    posterior_network.STEPS = posterior_network.RECURRENT_STEPS = 6.0
    with TemporaryDirectory() as folder:
        corpus = Corpus.create(Path(folder) / "toy")
        for utterance in toy_utterances(8):
            corpus.add(utterance)
        for name, (engine_name, options) in TRAINED.items():
            engine = engine_named(engine_name, options)
            model, _ = train(corpus, engine=engine, recogniser=SMALL, selection=Selection(None))
            yield from animated(f"{name}, trained here", model, toy_sentences(3)[0].audio)


def main(output: str) -> None:
    with hear_once():
        results = dict(front_ends()) | dict(animated("the shipped model", None, WELCOME)) | dict(trained())
    np.savez(output, **results)


if __name__ == "__main__":
    main(sys.argv[1])
