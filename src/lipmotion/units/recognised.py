"""Which phones in time were recognised, and which are known: what label and motion files say of it.

Files hold the recognised phones twice: as phones, which people edit, and as they were recognised. A phone that is the
same in both is as doubtful as it was; every other one is known, for somebody has corrected it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

from lipmotion.types import Timeline, Unit

RECOGNISED = "recognised"
"""Name of the tier, and of the member of motion files."""


class RecognisedPhone(NamedTuple):
    """A phone as it was recognised: its times in seconds, its name or that of its unit, and its confidence, 0 to 1."""

    start_s: float
    end_s: float
    name: str
    confidence: float


def recognised_phones(units: Timeline[Unit]) -> list[RecognisedPhone]:
    """Return the phones in time that are recognised, not known."""
    return [
        RecognisedPhone(float(span.start_s), float(span.end_s), _name(span.label), float(span.label.confidence))
        for span in units
        if span.label.confidence is not None
    ]


def with_confidences(units: Timeline[Unit], recognised: Iterable[RecognisedPhone]) -> Timeline[Unit]:
    """Return phones in time in which those that are as they were recognised have their confidence.

    recognised : of ``recognised_phones``, when the phones were written
    """
    confidence_of = {phone[:3]: phone.confidence for phone in recognised}
    return Timeline(
        tuple(
            replace(
                span,
                label=replace(span.label, confidence=confidence_of.get((span.start_s, span.end_s, _name(span.label)))),
            )
            for span in units
        )
    )


def _name(label: Unit) -> str:
    return label.phone or label.unit
