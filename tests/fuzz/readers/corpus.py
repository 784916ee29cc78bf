"""Prepared corpora."""

import json
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from fuzz.inputs import Files, Good, picked_up
from fuzz.plausible import check_motion, require
from lipmotion import Corpus
from lipmotion.types import Audio, Motion, Span, Timeline, Track, Unit, Utterance
from pipeline.made import features_of

SAMPLES, FRAMES = 8000, 13
PIXELS = (4, 6, 3)
AGES_S = 1e11
PHONES = Timeline((Span(0.0, 0.3, Unit("sil")), Span(0.3, 0.5, Unit("b"))))


def seeds(good: Good) -> list[Files]:
    """Return corpora of half a second: with labelled phones and tiny mouth pictures, without, without checksums."""
    corpus = Corpus.open(good.corpus)
    small = _half_a_second(corpus.utterance(corpus.names()[0]))
    track = replace(small.track, crops=np.zeros((FRAMES, *PIXELS), np.uint8))
    labelled = replace(small, speaker="anna", phones=PHONES, track=track)
    return [_corpus(labelled), _corpus(small), _without_checksums(_corpus(small))]


def _without_checksums(files: Files) -> Files:
    """Return a corpus without checksums, as earlier versions wrote it, so that damaged arrays are read."""
    (name,) = (name for name in files if name.endswith("entry.json"))
    entry = json.loads(files[name])
    entry.pop("checksums", None)
    return files | {name: json.dumps(entry).encode()}


def _half_a_second(utterance: Utterance) -> Utterance:
    audio = Audio(utterance.audio.samples[:SAMPLES].copy(), utterance.audio.rate_hz)
    motion = utterance.track.motion
    short = Motion(motion.values[:FRAMES], motion.rate_hz, motion.channels)
    return replace(utterance, audio=audio, features=features_of(audio), track=Track(short, np.ones(FRAMES, bool)))


def _corpus(utterance: Utterance) -> Files:
    with tempfile.TemporaryDirectory() as folder:
        corpus = Corpus.create(Path(folder) / "corpus")
        corpus.add(utterance)
        return picked_up(Path(folder))


def read(folder: Path, _: Good) -> None:
    """Open a corpus; check every array of every utterance."""
    corpus = Corpus.open(folder / "corpus")
    corpus.summary()
    require(all(0 <= seconds < AGES_S for _, seconds in corpus.speakers.values()), "ages of speech")
    for name in corpus.names():
        utterance = corpus.utterance(name)
        check_motion(utterance.track.motion)
        require(bool(np.isfinite(utterance.features.values).all()), "features that are not finite")
        if utterance.track.crops is not None:
            utterance.track.crops.mean()
