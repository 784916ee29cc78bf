"""Which phones in time were recognised, and which are known: what label and motion files say of it.

Files hold the recognised phones twice: as phones, which people edit, and as they were recognised. A phone that is the
same in both is as doubtful as it was; every other one is known, for somebody has corrected it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

from lipmotion.types import FRAME_RATE_HZ, Span, Timeline, Unit
from lipmotion.units.phones import SILENCE


def close_gaps(units: Timeline[Unit], duration_s: float) -> Timeline[Unit]:
    """Return phones in time that follow each other from the start to the end of a recording.

    units      : a last end may be infinite: it becomes the end of the recording
    duration_s : length of the recording in seconds
    A gap is silence. One of less than a frame (10 ms), as rounded times leave, is added to the phone before it instead.
    Units without phones, of unit sets, are returned as they are.
    """
    if not all(span.label.phone for span in units):
        return units
    filled: list[Span[Unit]] = []
    end_s = 0.0
    for span in units:
        _close_gap(filled, end_s, span.start_s)
        end_s = span.end_s if math.isfinite(span.end_s) else max(span.start_s, duration_s)
        filled.append(Span(span.start_s, end_s, span.label))
    if duration_s - end_s >= 1 / FRAME_RATE_HZ:
        _close_gap(filled, end_s, duration_s)
    return Timeline(tuple(filled))


def _close_gap(spans: list[Span[Unit]], start_s: float, end_s: float) -> None:
    """Add silence from the last span to a time, or make the last span longer if that is less than a frame."""
    if end_s - start_s >= 1 / FRAME_RATE_HZ - 1e-9:
        spans.append(Span(start_s, end_s, Unit(SILENCE)))
    elif spans and end_s > start_s:
        spans[-1] = Span(spans[-1].start_s, end_s, spans[-1].label)


RECOGNISED = "recognised"
"""Name of the tier, and of the member of motion files."""


class RecognisedPhone(NamedTuple):
    """A phone as it was recognised: its times in seconds, its name or that of its unit, and its confidence, 0 to 1."""

    start_s: float
    end_s: float
    name: str
    confidence: float


def list_recognised_phones(units: Timeline[Unit]) -> list[RecognisedPhone]:
    """Return the phones in time that are recognised, not known."""
    return [
        RecognisedPhone(float(span.start_s), float(span.end_s), _name(span.label), float(span.label.confidence))
        for span in units
        if span.label.confidence is not None
    ]


def restore_confidences(units: Timeline[Unit], recognised: Iterable[RecognisedPhone]) -> Timeline[Unit]:
    """Return phones in time in which those that are as they were recognised have their confidence.

    recognised : of ``list_recognised_phones``, when the phones were written
    """
    score_words = {phone[:3]: phone.confidence for phone in recognised}
    return Timeline(
        tuple(
            replace(
                span,
                label=replace(span.label, confidence=score_words.get((span.start_s, span.end_s, _name(span.label)))),
            )
            for span in units
        )
    )


def _name(label: Unit) -> str:
    return label.phone or label.unit
