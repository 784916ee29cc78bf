"""A corpus as a voice: are sentences of its words understood?

    python benchmarks/corpus_voice.py --corpus build/grid-s1 --model build/selection-train.lipmotion [--split test]

The sentences of a list that the model never saw are said by the recordings of its training list, and recognised, as the
recordings of the list are: by the words recogniser of the package, whose language model expects other sentences, and by
the same recogniser with the words of the corpus in any order. Printed: the share of words that are right, 1 minus
substitutions, deletions and insertions.
"""

from __future__ import annotations

import argparse
import json
import time
from functools import cache
from pathlib import Path

import numpy as np
from pocketsphinx import Decoder, get_model_path

from lipmotion import Corpus, load_model
from lipmotion.pipeline.generate.corpus_voice import speak_from_corpus
from lipmotion.pipeline.understand.request import SpeechRequest
from lipmotion.pipeline.understand.words import recognise_words
from lipmotion.types import Audio


def main() -> None:
    """Print one JSON object for each kind of sound."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--corpus", type=Path, default=Path("build/grid-s1"))
    parser.add_argument("--model", type=Path, required=True)
    parser.add_argument("--split", default="test")
    options = parser.parse_args()
    corpus, model = Corpus.open(options.corpus), load_model(options.model)
    utterances = [corpus.utterance(name) for name in corpus.names(options.split)]
    texts = [" ".join(utterance.words or ()) for utterance in utterances]
    vocabulary = tuple(sorted({word for text in texts for word in text.split()}))
    start = time.perf_counter()
    said = [speak_from_corpus(text, corpus, model) for text in texts]
    seconds = time.perf_counter() - start
    pieces = [len(sources(generation)) for _, generation in said]
    for name, sounds in (("recorded", [u.audio for u in utterances]), ("joined", [sound for sound, _ in said])):
        errors = {"package": 0, "words of the corpus": 0}
        for text, sound in zip(texts, sounds, strict=True):
            recognised = recognise_words(SpeechRequest(sound)).words
            errors["package"] += distance(text.split(), [span.label.text for span in recognised])
            errors["words of the corpus"] += distance(text.split(), loop_words(sound, vocabulary))
        count = sum(len(text.split()) for text in texts)
        right = {key: round(1 - value / count, 3) for key, value in errors.items()}
        print(json.dumps({"sound": name, "sentences": len(texts), "words": count, "right": right}), flush=True)
    print(json.dumps({"seconds a sentence": round(seconds / len(texts), 2), "recordings a sentence": np.mean(pieces)}))


def sources(generation) -> set[str]:  # type: ignore[no-untyped-def]
    """Return the recordings that a generation was joined from."""
    return {span.label.unit.split(" ")[0] for span in generation.units}


def loop_words(audio: Audio, vocabulary: tuple[str, ...]) -> list[str]:
    """Return recognised words of a vocabulary, in any order."""
    decoder = loop(vocabulary)
    decoder.start_utt()
    decoder.process_raw((np.clip(audio.samples, -1, 1) * 32_767).astype("<i2").tobytes(), full_utt=True)
    decoder.end_utt()
    found = decoder.hyp()
    return found.hypstr.split() if found is not None else []


@cache
def loop(vocabulary: tuple[str, ...]) -> Decoder:
    """Return a recogniser of words in any order."""
    folder = Path(get_model_path()) / "en-us"
    decoder = Decoder(
        hmm=str(folder / "en-us"), dict=str(folder / "cmudict-en-us.dict"), lm=None, loglevel="FATAL", wip=0.2
    )
    grammar = f"#JSGF V1.0; grammar loop; public <loop> = ({' | '.join(vocabulary)})+ ;"
    decoder.add_jsgf_string("loop", grammar)
    decoder.activate_search("loop")
    return decoder


def distance(one: list[str], two: list[str]) -> int:
    """Return the edit distance of two sequences of words."""
    row = list(range(len(two) + 1))
    for i, word in enumerate(one, start=1):
        previous, row[0] = row[0], i
        for j, other in enumerate(two, start=1):
            previous, row[j] = row[j], min(row[j] + 1, row[j - 1] + 1, previous + (word != other))
    return row[-1]


if __name__ == "__main__":
    main()
