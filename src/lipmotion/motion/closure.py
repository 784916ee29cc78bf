"""The lips close on p, b and m."""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.types import FRAME_RATE_HZ, Example, Timeline, Unit
from lipmotion.units import LIP_CLOSING

OPENING = "opening"
REACH_S = 0.02
"""The lips may meet this long before or after the phone's own time: alignments are no better."""


@dataclass(frozen=True, eq=False)
class Closure:
    """How a closed mouth looks.

    column : of the opening in the model's space
    closed : the opening at which the lips touch, as the tracker sees it
    follow : float array [shape=(Q,)], what each other dimension does per unit of opening
    """

    column: int
    closed: float
    follow: NDArray[np.float64]


def closing_spans(units: Timeline[Unit], frames: int, closing_units: Container[str] = ()) -> list[slice]:
    """Return the frames in which each p, b and m may close the lips.

    closing_units : that close them whichever of their phones is said; they count where no phone is known
    """
    spans = []
    for span in units:
        label = span.label
        if label.phone in LIP_CLOSING or (not label.phone and label.unit in closing_units):
            first = max(int(np.ceil((span.start_s - REACH_S) * FRAME_RATE_HZ - 1e-6)), 0)
            stop = min(int(np.floor((span.end_s + REACH_S) * FRAME_RATE_HZ + 1e-6)) + 1, frames)
            if first < stop:
                spans.append(slice(first, stop))
    return spans


def fit_closure(
    values: Sequence[NDArray[np.float64]],
    seen: Sequence[NDArray[np.bool_]],
    timelines: Sequence[Timeline[Unit]],
    column: int,
) -> Closure:
    """Learn from motion in the model's space [each shape=(T, Q)], its frames that were seen, and the phones with it.

    ``closed`` is the median over all p, b, m of the smallest opening in each; without any, the first percentile.
    """
    least = [
        float(x[span][valid[span], column].min())
        for x, valid, units in zip(values, seen, timelines, strict=True)
        for span in closing_spans(units, len(x))
        if valid[span].any()
    ]
    everything = np.concatenate([x[valid] for x, valid in zip(values, seen, strict=True)])
    centred = everything - everything.mean(axis=0)
    opening = centred[:, column]
    closed = float(np.median(least)) if least else float(np.percentile(everything[:, column], 1))
    return Closure(column, max(closed, 0.0), opening @ centred / max(float(opening @ opening), 1e-12))


def closing_frames(
    closure: Closure, opening: NDArray[np.float64], spans: Sequence[slice], taken: Sequence[int]
) -> list[int]:
    """Return the frames in which a trajectory must be made to close: the least open one of each p, b and m.

    opening : [shape=(T,)], as generated
    spans   : the frames of each, from ``closing_spans``
    taken   : frames whose opening the user pinned; a phone that holds one is the user's own
    Phones in which the lips close anyway are left alone.
    """
    frames = []
    for span in spans:
        least = span.start + int(opening[span].argmin())
        if opening[least] > closure.closed and not any(span.start <= frame < span.stop for frame in taken):
            frames.append(least)
    return frames


def fit_closure_of(
    names: Sequence[str], values: Sequence[NDArray[np.float64]], examples: Sequence[Example]
) -> Closure | None:
    """Return how the lips of some examples close; None where nothing is called ``opening``.

    names  : of the first dimensions of the model's space
    values : the motion of each example in it [each shape=(T, Q)]
    """
    if OPENING not in names:
        return None
    masks, timelines = [example.valid for example in examples], [example.speech.units for example in examples]
    return fit_closure(values, masks, timelines, names.index(OPENING))
