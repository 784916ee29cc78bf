"""One system, trained on some recordings and compared with others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np

from lipmotion.corpora.store import Corpus
from lipmotion.errors import CorpusError
from lipmotion.hmm.model import HmmConfig
from lipmotion.pipeline.evaluation.evaluate import OPENING, Clip, Recorded, clips, compared_channels, recorded
from lipmotion.pipeline.training.train import train
from lipmotion.speech.recogniser import recogniser as cached_recogniser
from lipmotion.types import Monitor, counted, part_of
from lipmotion.units import Lexicon


@dataclass(frozen=True, eq=False)
class Trial:
    """What a system makes of recordings that it was not trained on.

    found   : the recordings
    made    : the clips, by condition
    used    : names of the utterances that it was trained on
    seconds : of training, phone models and motion
    """

    found: Recorded
    made: Mapping[str, Sequence[Clip]]
    used: tuple[str, ...]
    seconds: float


def trial(
    corpus: Corpus,
    names: Sequence[str],
    held_out: Sequence[str],
    channels: Sequence[str],
    *,
    recogniser: HmmConfig | None,
    lexicon: Lexicon | None,
    monitor: Monitor,
    workers: int,
) -> Trial:
    """Train everything on ``names``, and generate ``channels`` of ``held_out``.

    The order of the names says nothing: they are sorted, so that all of a list give what ``lipmotion train`` gives.
    Raises as ``train`` and ``evaluate``.
    """
    training = part_of(monitor, 0, 0.8)
    start_s = perf_counter()
    model, report = train(
        corpus, names=sorted(names), recogniser=recogniser, lexicon=lexicon, monitor=training, workers=workers
    )
    seconds = perf_counter() - start_s
    phones, listening = cached_recogniser(model.phones), part_of(monitor, 0.8, 0.95)
    found = recorded(corpus, phones, names=sorted(held_out), channels=channels, lexicon=lexicon, monitor=listening)
    conditions = counted(list(found.conditions), "comparing", part_of(monitor, 0.95, 1))
    made = {condition: clips(found, condition, model.engine, model.learned) for condition in conditions}
    return Trial(found, made, report.used, seconds)


def channels_with_opening(corpus: Corpus, names: Sequence[str]) -> tuple[str, ...]:
    """Return the channels to compare in some utterances: to be called before the long work.

    Raises CorpusError: the opening is none of them, or the utterances have different ones.
    """
    channels, _ = compared_channels([corpus.utterance(name) for name in names])
    if OPENING not in channels:
        raise CorpusError(f"{corpus.path}: systems are compared by the channel {OPENING!r}, which is not in it")
    return channels


def shuffled(names: Sequence[str], seed: int) -> tuple[str, ...]:
    """Return the names in an order that depends on the seed alone."""
    return tuple(names[i] for i in np.random.default_rng(seed).permutation(len(names)))


def opening_row(figures: Mapping[str, Any]) -> dict[str, Any]:
    """Return what all tables show of the opening, out of the figures of a condition; shares of closings in %."""
    opening, closing, lips = figures["channels"][OPENING], figures["closures"], figures["closures_p_b_m"]
    return {
        "score": 100 * closing["score"],
        "precision": 100 * closing["precision"],
        "timing_ms": closing["timing_ms"],
        "closings": closing["original"],
        "generated_closings": closing["generated"],
        "recall_p_b_m": 100 * lips["recall"],
        "p_b_m": lips["intervals"],
        "acc": opening["acc"],
        "acc_95": figures["opening_acc_95"],
        "nrmse": opening["nrmse"],
        "global_variance": opening["global_variance"],
    }
