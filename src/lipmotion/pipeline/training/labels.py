"""Phones in time of the utterances of a corpus, with checkpoints, so that a stopped training continues."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import AlignmentError, InputError
from lipmotion.storage.checkpoint import Checkpoint
from lipmotion.types import Item, Monitor, ParallelMap, Progress, Span, Timeline, Unit, Utterance

UTTERANCES_PER_CHECKPOINT = 32
"""Utterances that are labelled between two checkpoints."""
Labeller = Callable[[Utterance], Timeline[Unit]]
"""A function that returns phones in time; raises AlignmentError or InputError if it cannot."""
PhonesOrReason = Timeline[Unit] | str
"""Phones in time of an utterance, or the reason why it has none."""


def label_utterances(
    utterances: Sequence[Utterance], labeller: Labeller, monitor: Monitor, checkpoint: Checkpoint, each: ParallelMap
) -> Iterator[tuple[Utterance, PhonesOrReason]]:
    """Yield every utterance with its phones in time, or with the reason why it has none.

    monitor    : called with the progress, and with the utterances without phones
    checkpoint : stores the phones of every ``UTTERANCES_PER_CHECKPOINT`` utterances
    each       : applies a function to many items, perhaps in several processes
    """
    starts = range(0, len(utterances), UTTERANCES_PER_CHECKPOINT)
    blocks = [utterances[start : start + UTTERANCES_PER_CHECKPOINT] for start in starts]
    stored = [checkpoint.load(_stage(number)) for number in range(len(blocks))]
    unlabelled = (block for block, arrays in zip(blocks, stored, strict=True) if arrays is None)
    missing = [list(map(_without_pictures, block)) for block in unlabelled]
    labelled = iter(each(partial(_label_block, labeller=labeller), missing))
    done = 0
    for number, (block, arrays) in enumerate(zip(blocks, stored, strict=True)):
        results = _from_arrays(arrays) if arrays is not None else next(labelled)
        if arrays is None:
            checkpoint.save(_stage(number), _to_arrays(results))
        for utterance, phones in zip(block, results, strict=True):
            if isinstance(phones, str):
                monitor(Item(utterance.name, "skipped", phones))
            yield utterance, phones
        done += len(block)
        monitor(Progress("phones: alignment and recognition", done, len(utterances), done / len(utterances)))


def _stage(number: int) -> str:
    """Return the name of a block in the checkpoint."""
    return f"labels-{number}"


def _without_pictures(utterance: Utterance) -> Utterance:
    """Return an utterance without mouth pictures, which takes less time to send to another process."""
    return replace(utterance, track=replace(utterance.track, crops=None))


def _label_block(utterances: Sequence[Utterance], labeller: Labeller) -> list[PhonesOrReason]:
    return [_label(utterance, labeller) for utterance in utterances]


def _label(utterance: Utterance, labeller: Labeller) -> PhonesOrReason:
    try:
        return labeller(utterance)
    except (AlignmentError, InputError) as error:
        return str(error)


def _to_arrays(results: Sequence[PhonesOrReason]) -> dict[str, NDArray[Any]]:
    """Serialise the labels of a block: counts of spans (-1: none), reasons, times in seconds, labels."""
    spans = [span for phones in results if not isinstance(phones, str) for span in phones]
    labels = [span.label for span in spans]
    return {
        "counts": np.array([-1 if isinstance(phones, str) else len(phones) for phones in results]),
        "problems": np.array([phones if isinstance(phones, str) else "" for phones in results]),
        "times": np.array([(span.start_s, span.end_s) for span in spans]).reshape(-1, 2),
        "labels": np.array([(label.phone, label.unit, label.word) for label in labels], np.str_).reshape(-1, 3),
    }


def _from_arrays(arrays: Mapping[str, NDArray[Any]]) -> list[PhonesOrReason]:
    """Deserialise the labels of a block."""
    spans = iter(
        Span(start_s, end_s, Unit(*label))
        for (start_s, end_s), label in zip(arrays["times"].tolist(), arrays["labels"].tolist(), strict=True)
    )
    return [
        reason if count < 0 else Timeline(tuple(next(spans) for _ in range(count)))
        for count, reason in zip(arrays["counts"].tolist(), arrays["problems"].tolist(), strict=True)
    ]
