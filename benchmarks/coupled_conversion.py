"""Real-time factor of generation with the coupled engine: CPU seconds per second of speech, after a warm-up.

    python benchmarks/coupled_conversion.py MODEL CORPUS [--split val] [--rounds 5]

MODEL is from ``lipmotion train --engine coupled``. Features and phones are computed beforehand; the figure is that of
the engine alone, without transcripts, median of the rounds, one thread for matrix products (OMP_NUM_THREADS=1).
"""

from __future__ import annotations

import argparse
import statistics
from pathlib import Path
from time import process_time

import numpy as np

import lipmotion
from lipmotion.pipeline.understand.understood_speech import recognised_speech
from lipmotion.speech.recognition.recogniser import cached_recogniser


def main() -> None:
    """Print the real-time factor."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("--split", default="val")
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    model, corpus = lipmotion.load_model(options.model), lipmotion.Corpus.open(options.corpus)
    phones = cached_recogniser(model.phones, "auto", model.adaptation)
    recordings = []
    for name in corpus.names(options.split):
        utterance = corpus.utterance(name)
        features = type(utterance.features)(np.asarray(utterance.features.values), utterance.features.duration_s)
        found = phones.recognition(utterance.audio, features)
        given = model.engine, model.learned, utterance.audio, features, phones
        recordings.append(recognised_speech(*given, lambda found=found: found))
    seconds = sum(speech.features.duration_s for speech in recordings)
    times_s = []
    for _ in range(options.rounds + 1):
        start_s = process_time()
        for speech in recordings:
            model.engine.generate(model.learned, speech)
        times_s.append(process_time() - start_s)
    factor = statistics.median(times_s[1:]) / seconds
    print(f"{len(recordings)} recordings, {seconds:.1f} s: real-time factor {factor:.4f}")


if __name__ == "__main__":
    main()
