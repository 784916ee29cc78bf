"""Training of a corpus's own acoustic phone models, from recordings and their transcripts."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle

from lipmotion.hmm.model import HmmConfig, UnitHmm
from lipmotion.hmm.unit_training import TranscribedUtterance, UnitInventory, train_hmm
from lipmotion.speech.features.analysed_audio import analysed
from lipmotion.speech.features.mfcc import LOG_ENERGY
from lipmotion.storage.archive import NO_CHECKPOINT, Checkpoint
from lipmotion.types import Audio, Monitor, ParallelMap
from lipmotion.units import PAUSE, SILENCE, Lexicon

WARP_CYCLE = (1.0, 0.88, 1.0, 0.94, 1.12, 1.06)
"""Warps of the frequencies, of one recording after the other."""
FEWEST_WARPED_RECORDINGS = 60
"""Fewer recordings than this are not warped: they are too few to train models of one speaker on, let alone several."""


def train_phone_models(
    spoken: Sequence[tuple[Audio, tuple[str, ...]]],
    lexicon: Lexicon,
    config: HmmConfig,
    monitor: Monitor,
    checkpoint: Checkpoint = NO_CHECKPOINT,
    each: ParallelMap = map,
) -> UnitHmm:
    """Return phone models trained on recordings and their words.

    spoken : recordings, each with its words, lower case
    The frequencies of many recordings are warped as by vocal tracts of other lengths (``WARP_CYCLE``), so that the
    models also fit other speakers.
    Raises CorpusError: no transcript fits into its recording.
    Source: Jaitly & Hinton 2013 (vocal tract length perturbation), without random draws or more data.
    """
    turns = WARP_CYCLE if len(spoken) >= FEWEST_WARPED_RECORDINGS else (1.0,)
    utterances = [
        TranscribedUtterance(analysed(audio).mfcc(warp).values, tuple(lexicon.pronunciations(word) for word in words))
        for (audio, words), warp in zip(spoken, cycle(turns), strict=False)
    ]
    return train_hmm(utterances, UnitInventory(SILENCE, PAUSE, LOG_ENERGY), config, monitor, checkpoint, each)
