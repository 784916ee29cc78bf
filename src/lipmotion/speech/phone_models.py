"""The project's own acoustic phone models, trained from recordings and what is said in them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle

from lipmotion.hmm.model import HmmConfig, UnitHmm
from lipmotion.hmm.train import TranscribedUtterance, UnitInventory, train_hmm
from lipmotion.speech.mfcc import LOG_ENERGY, mfcc
from lipmotion.storage.checkpoint import NO_CHECKPOINT, Checkpoint
from lipmotion.types import Audio, Monitor, ParallelMap
from lipmotion.units import PAUSE, SILENCE, Lexicon

WARP_CYCLE = (1.0, 0.88, 1.0, 0.94, 1.12, 1.06)
"""Warps of the recordings, in turns."""
FEWEST_WARPED = 60
"""With fewer recordings than this there is too little to learn one voice from, let alone several."""


def train_phone_models(
    spoken: Sequence[tuple[Audio, tuple[str, ...]]],
    lexicon: Lexicon,
    config: HmmConfig,
    monitor: Monitor,
    checkpoint: Checkpoint = NO_CHECKPOINT,
    each: ParallelMap = map,
) -> UnitHmm:
    """Train phone models from recordings and the words said in them.

    Many recordings take turns in being warped, as if by vocal tracts of other lengths: one voice is then no longer
    all that the models know.
    Raises CorpusError: no transcript fits into its recording.
    Source: Jaitly & Hinton 2013 (vocal tract length perturbation), without random draws or more data.
    """
    turns = WARP_CYCLE if len(spoken) >= FEWEST_WARPED else (1.0,)
    utterances = [
        TranscribedUtterance(mfcc(audio, warp).values, tuple(lexicon.pronunciations(word) for word in words))
        for (audio, words), warp in zip(spoken, cycle(turns), strict=False)
    ]
    return train_hmm(utterances, UnitInventory(SILENCE, PAUSE, LOG_ENERGY), config, monitor, checkpoint, each)
