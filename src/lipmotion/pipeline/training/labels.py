"""What is said in every utterance of a corpus, some at a time, so that a stopped run goes on where it was."""

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
"""Utterances that are labelled between one checkpoint and the next."""
Labeller = Callable[[Utterance], Timeline[Unit]]
PhonesOrReason = Timeline[Unit] | str
"""Phones in time, or the reason why there are none."""


def label_utterances(
    utterances: Sequence[Utterance], label: Labeller, monitor: Monitor, checkpoint: Checkpoint, each: ParallelMap
) -> Iterator[tuple[Utterance, PhonesOrReason]]:
    """Give every utterance with its phones.

    label : gives them; raises AlignmentError or InputError where it cannot
    each  : shares the work
    """
    parts = [
        utterances[start : start + UTTERANCES_PER_CHECKPOINT]
        for start in range(0, len(utterances), UTTERANCES_PER_CHECKPOINT)
    ]
    kept = [checkpoint.load(_stage(number)) for number in range(len(parts))]
    missing = [list(map(_without_pictures, part)) for part, arrays in zip(parts, kept, strict=True) if arrays is None]
    made = iter(each(partial(_all_labelled, label=label), missing))
    done = 0
    for number, (part, arrays) in enumerate(zip(parts, kept, strict=True)):
        found = _unpacked(arrays) if arrays is not None else next(made)
        if arrays is None:
            checkpoint.save(_stage(number), _packed(found))
        for utterance, phones in zip(part, found, strict=True):
            if isinstance(phones, str):
                monitor(Item(utterance.name, "skipped", phones))
            yield utterance, phones
        done += len(part)
        monitor(Progress("finding the phones in the sound", done, len(utterances), done / len(utterances)))


def _stage(number: int) -> str:
    return f"labels-{number}"


def _without_pictures(utterance: Utterance) -> Utterance:
    """Return what can be sent to another process fast."""
    return replace(utterance, track=replace(utterance.track, crops=None))


def _all_labelled(utterances: Sequence[Utterance], label: Labeller) -> list[PhonesOrReason]:
    return [_labelled(utterance, label) for utterance in utterances]


def _labelled(utterance: Utterance, label: Labeller) -> PhonesOrReason:
    try:
        return label(utterance)
    except (AlignmentError, InputError) as error:
        return str(error)


def _packed(found: Sequence[PhonesOrReason]) -> dict[str, NDArray[Any]]:
    spans = [span for phones in found if not isinstance(phones, str) for span in phones]
    labels = [span.label for span in spans]
    return {
        "counts": np.array([-1 if isinstance(phones, str) else len(phones) for phones in found]),
        "problems": np.array([phones if isinstance(phones, str) else "" for phones in found]),
        "times": np.array([(span.start_s, span.end_s) for span in spans]).reshape(-1, 2),
        "labels": np.array([(label.phone, label.unit, label.word) for label in labels], np.str_).reshape(-1, 3),
    }


def _unpacked(arrays: Mapping[str, NDArray[Any]]) -> list[PhonesOrReason]:
    spans = iter(
        Span(start_s, end_s, Unit(*label))
        for (start_s, end_s), label in zip(arrays["times"].tolist(), arrays["labels"].tolist(), strict=True)
    )
    return [
        problem if count < 0 else Timeline(tuple(next(spans) for _ in range(count)))
        for count, problem in zip(arrays["counts"].tolist(), arrays["problems"].tolist(), strict=True)
    ]
