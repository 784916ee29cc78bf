"""How far each phone is being said at a time: cross-fades between phones in time."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lipmotion.types import Timeline, Unit

Array = NDArray[np.float64]

FADE_S = 0.06
"""Longest half of a cross-fade between two phones, in seconds; of short phones, half of the phone."""
LEAST_FADE_S = 0.025
"""Shortest half of a cross-fade: no curve jumps, and a phone under 50 ms is not wholly said."""


def crossfade_phones(units: Timeline[Unit], time_s: Array, kind: Callable[[str], str]) -> dict[str, Array]:
    """Return how far each kind of phone is being said, 0 to 1 [each shape=(T,)]; at every time they add up to 1.

    kind : the kind of each phone; before the first and after the last unit, and in gaps, it is that of an empty phone
    Neighbours are cross-faded by half a cosine around the border between them. The middle of a phone of 50 ms or
    more is wholly its own.
    """
    names, borders, halves = _segments(units, kind)
    weights: dict[str, Array] = {name: np.zeros(len(time_s)) for name in names}
    rising = [np.ones(len(time_s)), *(_step((time_s - at) / half) for at, half in zip(borders, halves, strict=True))]
    reached = rising[0]
    for number, name in enumerate(names):
        after = np.minimum(rising[number + 1], reached) if number + 1 < len(rising) else np.zeros(len(time_s))
        weights[name] += reached - after
        reached = after
    return weights


def _segments(units: Timeline[Unit], kind: Callable[[str], str]) -> tuple[list[str], list[float], list[float]]:
    """Return the kinds in order, the borders between them in seconds, and half the length of each cross-fade."""
    names, starts, ends = [kind("")], [float("-inf")], [float("inf")]
    for span in units:
        if span.duration_s <= 0:
            continue
        if span.start_s > starts[-1] and ends[-1] > span.start_s:
            ends[-1] = span.start_s
        if ends[-1] < span.start_s:
            names.append(kind(""))
            starts.append(ends[-1])
            ends.append(span.start_s)
        names.append(kind(span.label.phone))
        starts.append(span.start_s)
        ends.append(span.end_s)
    if len(names) > 1:
        names.append(kind(""))
        starts.append(ends[-1])
        ends.append(float("inf"))
    lengths = [end - start for start, end in zip(starts, ends, strict=True)]
    halves = [max(min(FADE_S, left / 2, right / 2), LEAST_FADE_S) for left, right in pairwise(lengths)]
    return names, starts[1:], halves


def _step(position: Array) -> Array:
    """Return half a cosine from 0 at −1 to 1 at 1."""
    return (1 + np.sin(np.pi / 2 * np.clip(position, -1, 1))) / 2
