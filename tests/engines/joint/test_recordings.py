"""The joint model on a few sentences of a real speaker.

Faces are not followed here (that takes a minute a sentence): the smoothed loudness stands for the opening of the lips.
"""

from pathlib import Path

import numpy as np
import pytest

from lipmotion.hmm.multistream.align import align
from lipmotion.hmm.multistream.generate import densities_of_path, generate
from lipmotion.hmm.multistream.model import JointConfig
from lipmotion.hmm.multistream.multistream_training import TrainingUtterance, train_joint
from lipmotion.hmm.multistream.recognise import JointRecogniser
from lipmotion.hmm.multistream.streams import stream_observations
from lipmotion.hmm.multistream.unit_frames import units_in_frames
from lipmotion.hmm.multistream.unit_states import Inventory
from lipmotion.speech.features.analysed_audio import analysed
from lipmotion.speech.features.f0 import log_f0
from lipmotion.speech.features.mfcc import LOG_ENERGY
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.types import Progress, Span, Timeline, Unit
from lipmotion.units import PHONES, Lexicon
from lipmotion.units.classes import phone_classes

TRAIN, TEST = 30, 6


def transcribed(grid: Path, name: str) -> TrainingUtterance:
    """Return a sentence; its phones share the time of their word."""
    audio, lexicon = read_audio(grid / "clips" / f"{name}.mkv"), Lexicon()
    features = analysed(audio).mfcc().values
    spans = []
    for line in (grid / "align" / f"{name}.align").read_text().split("\n"):
        if line.strip():
            start_s, end_s, word = (*(int(time) / 25_000 for time in line.split()[:2]), line.split()[2])
            phones = ("sil",) if word == "sil" else ("sp",) if word == "sp" else lexicon.pronunciations(word)[0]
            edges = np.linspace(start_s, end_s, len(phones) + 1).tolist()
            spans += [Span(a, b, Unit(phone)) for a, b, phone in zip(edges, edges[1:], phones, strict=False)]
    units, bounds = units_in_frames(Timeline(tuple(spans)), len(features), "sil")
    window = np.hanning(15) / np.hanning(15).sum()
    loudness = np.convolve(np.pad(features[:, LOG_ENERGY].astype(float), 7, "edge"), window, "valid")
    return TrainingUtterance(stream_observations(features, log_f0(audio), loudness[:, None]), units, bounds)


@pytest.mark.recordings
def test_thirty_sentences_are_enough_to_follow_another(recordings: Path) -> None:
    grid = recordings / "grid-s1"
    if not grid.is_dir():
        pytest.skip("no GRID recordings")
    data = [transcribed(grid, name) for name in (grid / "order.txt").read_text().split()[: TRAIN + TEST]]
    events: list[Progress] = []
    inventory = Inventory(("sil", "sp", *(p for p in PHONES if p not in ("sil", "sp"))), ("sil", "sp"), 3)
    hmm = train_joint(data[:TRAIN], inventory, phone_classes(), JointConfig(mixtures=2), events.append)
    for stage in ("units", "units in context"):
        assert (np.diff([event.figure for event in events if event.stage == stage]) > -1e-3).all()
    generated, original = [], []
    for utterance in data[TRAIN:]:
        said = JointRecogniser(hmm).recognise(utterance.observed)
        bounds = np.array([*(s.first for s in said), utterance.observed.frames])
        path = align(hmm, utterance.observed, [s.unit for s in said], bounds)
        generated.append(generate(densities_of_path(hmm, path)).values[:, 0])
        original.append(utterance.observed.streams["motion"].values[:, 0])
    inner = [np.s_[1:-1]] * TEST
    found = np.concatenate([g[i] for g, i in zip(generated, inner, strict=True)])
    wanted = np.concatenate([o[i] for o, i in zip(original, inner, strict=True)])
    assert np.corrcoef(found, wanted)[0, 1] > 0.7
