"""The project's own acoustic phone models, trained from recordings and what is said in them."""

from __future__ import annotations

from collections.abc import Sequence

from lipmotion.speech.mfcc import LOG_ENERGY
from lipmotion.stats.em import Monitor
from lipmotion.stats.hmm.model import HmmConfig, UnitHmm
from lipmotion.stats.hmm.train import Transcribed, UnitInventory, train_hmm
from lipmotion.types import Features
from lipmotion.units import PAUSE, SILENCE, Lexicon


def train_phones(
    spoken: Sequence[tuple[Features, tuple[str, ...]]], lexicon: Lexicon, config: HmmConfig, monitor: Monitor
) -> UnitHmm:
    """Train phone models from recordings and the words said in them.

    Raises CorpusError: no transcript fits into its recording.
    """
    utterances = [
        Transcribed(features.values, tuple(lexicon.pronunciations(word) for word in words))
        for features, words in spoken
    ]
    return train_hmm(utterances, UnitInventory(SILENCE, PAUSE, LOG_ENERGY), config, monitor)
