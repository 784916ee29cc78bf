"""A corpus as a voice: are sentences understood that are joined from its recordings?

    python benchmarks/corpus_voice.py --corpus build/grid-s1 --model build/selection-train.lipmotion [--split test]
        [--others ../shared/corpora/speech-open]

Two kinds of sentences are said by the recordings of the training list: those of a list that the model never saw, whose
words were recorded, and the open ones of ``open_sentences.txt``, of which no word was recorded, but all phones were.
One JSON object a line for each kind of sound: ``joined``, two synthetic voices and, of the list, ``recorded``; with
``--others`` also what other people say in a folder of transcribed recordings. Right: 1 minus substitutions, deletions
and insertions, as a share, with the 95 % bootstrap interval over sentences: ``phones`` of the network hama, which is
not trained here, against the dictionary, in the 39 classes of Lee & Hon 1989; ``words`` of
pocketsphinx, the words of all these sentences in any order.
``joins``: a sentence; and the shares of joins around which (50 ms on both sides) the velocity of the opening, and the
cepstrum over 40 ms, change by no more than around 95 % of the frames of the recordings. ``pairs``: the share of the
sentences' pairs of successive phones that the speaker said in succession, by the dictionary.
"""

from __future__ import annotations

import argparse
import json
import logging
import tempfile
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pocketsphinx import Decoder, get_model_path
from scipy.ndimage import maximum_filter1d

from lipmotion import Corpus, Model, load_model
from lipmotion.corpora.source_recordings import AUDIO_SUFFIXES
from lipmotion.engines.base import SelectsRecordings
from lipmotion.formats.label_files import labels_beside
from lipmotion.measures.bootstrap import bootstrap_interval
from lipmotion.pipeline.generate.corpus_voice import speak_from_corpus
from lipmotion.speech.features.analysed_audio import analysed
from lipmotion.speech.recognition.network.posteriors import recording_posteriors
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.voices.installed import speak_sentences, voice_named
from lipmotion.types import FRAME_RATE_HZ, Audio, Generation, SpokenText, Utterance
from lipmotion.units import Lexicon, words_of
from lipmotion.units.ipa_phones import token_phones
from lipmotion_lab.minnis_breen2000.minnis2000 import velocity_change

OPEN = Path(__file__).with_name("open_sentences.txt")
VOICES = ("espeak-ng:en-us+m3", "flite:rms")
CLASSES = {"ao": "aa", "ax": "ah", "ix": "ih", "axr": "er", "el": "l", "em": "m", "en": "n", "zh": "sh"}
STATIC, STEP, AROUND, PERCENTILE = 13, 2, 11, 95
Array = NDArray[np.float64]
LEXICON = Lexicon()


def main() -> None:
    """Print one JSON object for each kind of sentences and of sound."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--corpus", type=Path, default=Path("build/grid-s1"))
    parser.add_argument("--model", type=Path, required=True)
    parser.add_argument("--split", default="test")
    parser.add_argument("--others", type=Path, help="folder of transcribed recordings of other people")
    options = parser.parse_args()
    logging.getLogger("lipmotion").setLevel(logging.ERROR)
    corpus, model = Corpus.open(options.corpus), load_model(options.model)
    utterances = [corpus.utterance(name) for name in corpus.names(options.split)]
    opened = OPEN.read_text(encoding="utf-8").splitlines()
    check_open(opened, corpus, model)
    listed = [" ".join(utterance.words or ()) for utterance in utterances]
    show("of the list", "recorded", listed, [utterance.audio for utterance in utterances])
    bounds = [
        np.percentile(np.concatenate(each), PERCENTILE) for each in zip(*map(own_changes, utterances), strict=True)
    ]
    for kind, texts in (("of the list", listed), ("open", opened)):
        said = [speak_from_corpus(text, corpus, model) for text in texts]
        joins = join_figures(said, bounds) | {"pairs": recorded_pairs(texts, corpus, model)}
        show(kind, "joined", texts, [sound for sound, _ in said], joins=joins)
        for voice in VOICES:
            show(kind, voice, texts, [audio for audio, _ in speak_sentences(texts, voice_named(voice))])
    if options.others is not None:
        found = list(transcribed(options.others))
        show("open", "other people", [text for text, _ in found], [audio for _, audio in found])


def show(kind: str, sound: str, texts: Sequence[str], sounds: Sequence[Audio], **more: Any) -> None:
    """Print the figures of some sentences."""
    words = [list(words_of(text)) for text in texts]
    vocabulary = tuple(sorted({word for each in words for word in each}))
    readings: dict[str, tuple[Callable[[Audio], list[str]], list[list[str]]]] = {
        "phones": (recognised_phones, [expected_phones(each) for each in words]),
        "words": (lambda audio: loop_words(audio, vocabulary), words),
    }
    right = {}
    for name, (recognise, expected) in readings.items():
        errors = [np.array([distance(each, recognise(audio))]) for each, audio in zip(expected, sounds, strict=True)]
        counts = [np.array([len(each)]) for each in expected]
        share = [1 - np.sum(errors) / np.sum(counts)]
        share += bootstrap_interval(lambda wrong, said: 1 - np.sum(wrong) / np.sum(said), errors, counts, 0)
        right[name] = np.round(share, 3).tolist()
    about = {"sentences": kind, "sound": sound, "number": len(texts), "words": sum(map(len, words))}
    print(json.dumps(about | {"right": right} | more), flush=True)


def check_open(texts: Sequence[str], corpus: Corpus, model: Model) -> None:
    """Raise SystemExit unless no word of some sentences sounds as one that was recorded, but all phones were."""
    assert isinstance(model.engine, SelectsRecordings)
    recorded = {word for each in recorded_words(corpus, model) for word in each}
    said = {pronunciation for word in recorded for pronunciation in LEXICON.pronunciations(word)}
    missing = set(model.engine.stand_ins(model.learned))
    for word in sorted({word for text in texts for word in words_of(text)}):
        phones = LEXICON.pronunciations(word)[0]
        if phones in said or missing & set(phones):
            raise SystemExit(f"{word!r} is no word that the corpus says from parts of others: {' '.join(phones)}")


def recorded_words(corpus: Corpus, model: Model) -> list[tuple[str, ...]]:
    """Return the words of all recordings of a model."""
    assert isinstance(model.engine, SelectsRecordings)
    return [corpus.utterance(name).words or () for name in model.engine.recordings(model.learned)]


def recorded_pairs(texts: Sequence[str], corpus: Corpus, model: Model) -> float:
    """Return the share of the pairs of successive phones of some sentences that were recorded."""
    known = {pair for words in recorded_words(corpus, model) for pair in pairwise(expected_phones(words))}
    return round(
        float(np.mean([pair in known for text in texts for pair in pairwise(expected_phones(words_of(text)))])), 3
    )


def join_figures(said: Sequence[SpokenText], bounds: Sequence[float]) -> dict[str, float]:
    """Return the joins a sentence, and the shares of them where motion and sound change by no more than ``bounds``."""
    within: list[list[bool]] = []
    for sound, generation in said:
        changes = changes_around(generation.motion["opening"], sound)
        for time_s in joins_s(generation):
            frame = min(round(time_s * FRAME_RATE_HZ), len(changes[0]) - 1, len(changes[1]) - 1)
            within.append([each[frame] <= bound for each, bound in zip(changes, bounds, strict=True)])
    motion, cepstrum = np.mean(within, axis=0).round(3).tolist()
    return {"a sentence": round(len(within) / len(said), 1), "motion": motion, "sound": cepstrum}


def joins_s(generation: Generation) -> list[float]:
    """Return when phones begin that were not recorded after the one before."""
    found = []
    for before, after in pairwise(generation.units):
        (recording, times_s), (other, others_s) = (each.label.unit.split(" ")[:2] for each in (before, after))
        gap_s = float(others_s.split("-")[0]) - float(times_s.split("-")[1])
        if recording != other or abs(gap_s) > 1e-3:
            found.append(after.start_s)
    return found


def own_changes(utterance: Utterance) -> tuple[Array, Array]:
    """Return ``changes_around`` of a recording."""
    motion = utterance.track.motion
    time_s = np.arange(0, utterance.audio.duration_s, 1 / FRAME_RATE_HZ)
    return changes_around(np.interp(time_s, motion.time_s, motion["opening"]), utterance.audio)


def changes_around(opening: NDArray[np.floating[Any]], audio: Audio) -> tuple[Array, Array]:
    """Return the largest changes of the velocity, and of the cepstrum, around every frame [each shape=(T,)]."""
    cepstra = np.pad(np.asarray(analysed(audio).mfcc().values)[:, :STATIC], ((STEP, STEP), (0, 0)), mode="edge")
    apart = np.linalg.norm(cepstra[2 * STEP :] - cepstra[: -2 * STEP], axis=1)
    return maximum_filter1d(velocity_change(opening), AROUND), maximum_filter1d(apart, AROUND)


def transcribed(folder: Path) -> Iterator[tuple[str, Audio]]:
    """Yield the English transcripts of the recordings of a folder, with their sound."""
    for path in sorted(path for path in folder.iterdir() if path.suffix.lower() in AUDIO_SUFFIXES):
        words = labels_beside(path).words
        if words and " ".join(words).isascii():
            yield " ".join(words), read_audio(path)


def expected_phones(words: Sequence[str]) -> list[str]:
    """Return the classes of the phones of some words."""
    return [CLASSES.get(phone, phone) for word in words for phone in LEXICON.pronunciations(word)[0]]


def recognised_phones(audio: Audio) -> list[str]:
    """Return the classes of the phones on the best path of the network."""
    best = recording_posteriors("hama", analysed(audio)).best_tokens
    return [CLASSES.get(phone, phone) for phone, _ in token_phones([found.token for found in best])]


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
    """Return a recogniser of words in any order, all of one probability."""
    folder = Path(get_model_path()) / "en-us"
    acoustics = {"hmm": str(folder / "en-us"), "dict": str(folder / "cmudict-en-us.dict"), "loglevel": "FATAL"}
    lines = "\n".join(f"{-np.log10(len(vocabulary) + 1):.4f} {word}" for word in ("</s>", *vocabulary))
    with tempfile.TemporaryDirectory() as made:
        path = Path(made) / "loop.arpa"
        path.write_text(f"\\data\\\nngram 1={len(vocabulary) + 2}\n\n\\1-grams:\n-99 <s>\n{lines}\n\n\\end\\\n")
        return Decoder(lm=str(path), wip=0.2, **acoustics)


def distance(one: Sequence[str], two: Sequence[str]) -> int:
    """Return the edit distance of two sequences."""
    row = list(range(len(two) + 1))
    for i, item in enumerate(one, start=1):
        previous, row[0] = row[0], i
        for j, other in enumerate(two, start=1):
            previous, row[j] = row[j], min(row[j] + 1, row[j - 1] + 1, previous + (item != other))
    return row[-1]


if __name__ == "__main__":
    main()
