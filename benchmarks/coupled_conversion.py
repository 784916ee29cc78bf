"""How long the coupled engine takes for recordings that it can hear as one: CPU seconds a second of speech, warm.

    python benchmarks/coupled_conversion.py MODEL CORPUS [--split val] [--rounds 5]

MODEL is from ``lipmotion train --engine coupled``. The features and phones are found beforehand; the figure is that of
the engine alone, words unknown, median of the rounds, one thread for matrix products (OMP_NUM_THREADS=1).
"""

from __future__ import annotations

import argparse
import statistics
from pathlib import Path
from time import process_time

import numpy as np

import lipmotion
from lipmotion.pipeline.understand import hear_unsaid
from lipmotion.speech.recogniser import cached_recogniser


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("--split", default="val")
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    model, corpus = lipmotion.load_model(options.model), lipmotion.Corpus.open(options.corpus)
    phones = cached_recogniser(model.phones, "auto", model.adaptation)
    heard = []
    for name in corpus.names(options.split):
        said = corpus.utterance(name)
        features = type(said.features)(np.asarray(said.features.values), said.features.duration_s)
        found = phones.recognise(said.audio, features)
        heard.append(hear_unsaid(model.engine, model.learned, said.audio, features, phones, lambda found=found: found))
    seconds = sum(speech.features.duration_s for speech in heard)
    taken = []
    for _ in range(options.rounds + 1):
        start_s = process_time()
        for speech in heard:
            model.engine.generate(model.learned, speech)
        taken.append(process_time() - start_s)
    print(f"{len(heard)} recordings, {seconds:.1f} s: real-time factor {statistics.median(taken[1:]) / seconds:.4f}")


if __name__ == "__main__":
    main()
