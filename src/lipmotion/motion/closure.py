"""Closures of the lips in p, b and m: the frames in which they may close, and how the mouth closes."""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.types import FRAME_RATE_HZ, WEIGHT, Channel, Example, Motion, Timeline, Unit
from lipmotion.units import mark_closing_phones

Array = NDArray[np.float64]
OPENING = "opening"
REACH_S = 0.02  # seconds before and after the span of a phone in which the lips may close: the accuracy of alignments
CLOSED_PERCENTILE = 2.0
"""Lips that touch are open no further than this percentile of all frames, nor than that of the frames of speech. Of six
GRID speakers with transcripts the median over p, b and m is no more than either; of recognised phones it may be
anything."""


@dataclass(frozen=True, eq=False)
class Closure:
    """The opening of closed lips, and how the other dimensions of motion change with the opening."""

    column: int  # of the opening in the motion space
    closed: float  # the opening at which the lips touch, as the tracker measures it, in eye distances
    follow: NDArray[np.float64]  # change of each dimension per unit of opening (regression) [shape=(Q,)]


def is_never_negative(channel: Channel) -> bool:
    """Return whether a channel has no values under 0: the opening, and weights."""
    return channel.name == OPENING or channel.unit == WEIGHT


def clip_at_zero(motion: Motion) -> None:
    """Raise values under 0 to 0, in place, in the channels that have none."""
    bounded = [is_never_negative(channel) for channel in motion.channels]
    motion.values[:, bounded] = np.maximum(motion.values[:, bounded], 0)


def frames_within(start_s: float, end_s: float, rate_hz: float, frames: int) -> tuple[int, int]:
    """Return the first frame in a time, both ends included, and the one after the last; cut to so many frames."""
    first = max(int(np.ceil(start_s * rate_hz - 1e-6)), 0)
    stop = min(int(np.floor(end_s * rate_hz + 1e-6)) + 1, frames)
    return first, stop


def find_closable_ranges(
    units: Timeline[Unit], frames: int, closing_units: Container[str] = (), reach_s: float = REACH_S
) -> list[slice]:
    """Return, for each p, b and m, the range of frames at 100 Hz in which it may close the lips.

    frames        : length of the recording
    closing_units : units all of whose phones close the lips; they count where a label has no phone
    reach_s       : seconds before and after the phone that belong to the range; negative: seconds at both its ends that
                    do not; its middle always does
    """
    ranges = []
    for span, closing in zip(units, mark_closing_phones(units), strict=True):
        label = span.label
        if closing or (not label.phone and label.unit in closing_units):
            inside_s = min(-reach_s, span.duration_s / 2)
            first, stop = frames_within(span.start_s + inside_s, span.end_s - inside_s, FRAME_RATE_HZ, frames)
            stop = max(stop, min(first + 1, frames)) if reach_s < 0 else stop
            if first < stop:
                ranges.append(slice(first, stop))
    return ranges


def estimate_closed_opening(smallest: Sequence[float], *groups: NDArray[np.float64]) -> float:
    """Return the opening at which a person's lips touch, in the unit of the openings, at least 0.

    smallest : smallest opening in each p, b and m; may be empty, and wrong where phones were recognised
    groups   : openings in groups of frames, for instance in all frames and in those of speech [each shape=(N,)]
    The median over p, b and m, but no more than ``CLOSED_PERCENTILE`` of each group that has a frame: phones that were
    recognised in a single clip may be others, and then the lips would never meet.
    """
    bounds = [float(np.percentile(group, CLOSED_PERCENTILE)) for group in groups if len(group)]
    middle = [float(np.median(smallest))] if len(smallest) else []
    return max(min([*middle, *bounds], default=0.0), 0.0)


def choose_closed_frames(closure: Closure, opening: Array, ranges: Sequence[slice], pinned: Sequence[int]) -> list[int]:
    """Return the frames in which the lips must be made to close: the least open one of each p, b and m that is open.

    opening : generated opening [shape=(T,)]
    ranges  : the frames of each p, b and m, from ``find_closable_ranges``
    pinned  : frames whose opening the user pinned; a range that contains one is left as the user wants it
    """
    closed = []
    for frames in ranges:
        smallest = frames.start + int(opening[frames].argmin())
        if opening[smallest] > closure.closed and not any(frames.start <= frame < frames.stop for frame in pinned):
            closed.append(smallest)
    return closed


def fit_closure(names: Sequence[str], values: Sequence[Array], examples: Sequence[Example]) -> Closure | None:
    """Return the closure of the lips in motion of examples; None without a channel ``opening``.

    names  : of the dimensions that are channels, the first ones of the motion space
    values : motion of each example in the motion space [each shape=(T, Q)]
    ``closed`` is from ``estimate_closed_opening``, of all measured frames.
    """
    if OPENING not in names:
        return None
    column = names.index(OPENING)
    smallest = [
        float(x[frames][example.valid[frames], column].min())
        for x, example in zip(values, examples, strict=True)
        for frames in find_closable_ranges(example.speech.units, len(x))
        if example.valid[frames].any()
    ]
    poses = np.concatenate([x[example.valid] for x, example in zip(values, examples, strict=True)])
    centred = poses - poses.mean(axis=0)
    opening = centred[:, column]
    closed = estimate_closed_opening(smallest, poses[:, column])
    return Closure(column, closed, opening @ centred / max(float(opening @ opening), 1e-12))
