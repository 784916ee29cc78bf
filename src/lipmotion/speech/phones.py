"""The project's acoustic phone models, and phones in time out of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lipmotion.stats.checkpoint import NOTHING_KEPT, Checkpoint
from lipmotion.stats.hmm.align import align_units, choose_pronunciations
from lipmotion.stats.hmm.decode import decode_units
from lipmotion.stats.hmm.loudness import loud_frames
from lipmotion.stats.hmm.model import HmmConfig, UnitHmm
from lipmotion.stats.hmm.train import Transcribed, UnitInventory, train_hmm
from lipmotion.types import FRAME_RATE_HZ, Each, Features, Monitor, Span, Timeline, Unit
from lipmotion.units import PAUSE, SILENCE, Lexicon, is_silent, stand_in

LOG_ENERGY = 12
"""The column of the features that holds the log energy."""
LOUD_FRAMES = 11
"""The energy is averaged over so many frames before it rules silence out."""
SHORT_PAUSE_S = 0.2
"""Silence shorter than this is a pause between words."""


def train_phones(
    spoken: Sequence[tuple[Features, tuple[str, ...]]],
    lexicon: Lexicon,
    config: HmmConfig,
    monitor: Monitor,
    checkpoint: Checkpoint = NOTHING_KEPT,
    each: Each = map,
) -> UnitHmm:
    """Train phone models from recordings and the words said in them.

    Raises CorpusError: no transcript fits into its recording.
    """
    utterances = [
        Transcribed(features.values, tuple(lexicon.pronunciations(word) for word in words))
        for features, words in spoken
    ]
    return train_hmm(utterances, UnitInventory(SILENCE, PAUSE, LOG_ENERGY), config, monitor, checkpoint, each)


def align(hmm: UnitHmm, features: Features, words: Sequence[str], lexicon: Lexicon) -> Timeline[Unit]:
    """Return the phones of a known transcript in time.

    Which pronunciation was used, and where there were pauses, follows from the sound. A phone that the models
    have never heard borrows the sound of the nearest one that they have (``units.RELATIVES``).
    Raises AlignmentError: the transcript does not fit into the recording.
    """
    variants = [lexicon.pronunciations(word) for word in words]
    known = [unit for unit in hmm.table.units if not is_silent(unit)]
    heard = [[tuple(stand_in(p, known) for p in variant) for variant in choices] for choices in variants]
    loud = loud_frames(features.values[:, LOG_ENERGY], LOUD_FRAMES)
    said = choose_pronunciations(hmm, features.values, heard, PAUSE, loud)
    bounds = align_units(hmm, features.values, [unit for part in said for unit in part.units], loud)
    labels = [
        (phone, words[part.word] if part.word >= 0 else "")
        for part in said
        for phone in (variants[part.word][part.variant] if part.word >= 0 else part.units)
    ]
    return _timeline(labels, bounds, features.duration_s)


def recognise(hmm: UnitHmm, features: Features) -> Timeline[Unit]:
    """Return the phones that were most probably said, in time: Viterbi with a back-off bigram.

    Digital silence, of which all normalised features are 0, is silence.
    Source: Hofer 2008, Eq. 5.
    """
    if not features.values.any():
        return _timeline([(SILENCE, "")], np.array([0, len(features.values)]), features.duration_s)
    inventory = [unit for unit in hmm.table.units if unit != PAUSE]
    phones, bounds = decode_units(hmm, features.values, inventory)
    return _timeline([(phone, "") for phone in phones], bounds, features.duration_s)


def _timeline(labels: list[tuple[str, str]], bounds: NDArray[np.intp], duration_s: float) -> Timeline[Unit]:
    """Frame n covers (n ± ½) · 10 ms. Silence at both ends is silence however short, between words a pause."""
    edges = np.clip((bounds - 0.5) / FRAME_RATE_HZ, 0, duration_s)
    edges[-1] = duration_s
    spans = []
    for i, ((phone, word), start_s, end_s) in enumerate(
        zip(labels, edges[:-1].tolist(), edges[1:].tolist(), strict=True)
    ):
        name = phone
        if is_silent(phone):
            inside = 0 < i < len(labels) - 1
            name = PAUSE if inside and end_s - start_s < SHORT_PAUSE_S else SILENCE
        spans.append(Span(start_s, end_s, Unit(name, word=word)))
    return Timeline(tuple(spans))
