"""Phones in time without gaps."""

from __future__ import annotations

import math

from lipmotion.types import FRAME_RATE_HZ, Span, Timeline, Unit
from lipmotion.units.phones import SILENCE


def without_gaps(units: Timeline[Unit], duration_s: float) -> Timeline[Unit]:
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
