"""The rest pose of a mouth: the frames that show it, and sizes in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.types import Motion, Span, Timeline, Unit
from lipmotion.units import SILENCE, is_silent

Array = NDArray[np.float64]
LARGEST_REST = 0.06
"""A rest pose more open than this, in eye distances, is speech: the recording has hardly any silence."""


def find_rest_frames(motion: Motion, units: Timeline[Unit], opening: Array | None = None) -> NDArray[np.bool_]:
    """Return the frames of the rest pose [shape=(T,), bool]: silence, or else the most closed tenth of the frames.

    units   : phones in time. Silence whose median opening is more than ``LARGEST_REST`` does not count
    opening : of the mouth, in eye distances [shape=(T,)]; None: the channel ``opening``. Where neither is known, the
              silences alone count, and without them all frames
    """
    time_s = motion.time_s
    rest = np.zeros(len(time_s), dtype=bool)
    silent_s = [(span.start_s, span.end_s) for span in units if is_silent(span.label.phone)]
    for first, stop in np.searchsorted(time_s, np.array(silent_s).reshape(-1, 2)).tolist():
        rest[first:stop] = True
    if opening is None:
        if "opening" not in motion.names:
            return rest if rest.any() else ~rest
        opening = motion["opening"].astype(np.float64)
    if rest.any() and float(np.median(opening[rest])) <= LARGEST_REST:
        return rest
    rest = np.zeros(len(time_s), dtype=bool)
    rest[np.argsort(opening, kind="stable")[: max(1, len(time_s) // 10)]] = True
    return rest


def add_rest(motion: Motion, units: Timeline[Unit], frames: slice) -> tuple[Motion, Timeline[Unit], slice]:
    """Return frames of a motion with their phones, beside silence in the rest pose of the whole, and where they are.

    So the rest pose of what is returned is that of the whole: there is more of that silence than of others in it. It
    comes before the frames; after them, where they are the first ones, which nothing then smooths.
    """
    values, rate_hz, rest = motion.values[frames], motion.rate_hz, find_rest_frames(motion, units)
    still = np.median(motion.values[rest], axis=0)
    count = int(np.count_nonzero(rest[frames])) + len(values) // 5 + 1
    start_s, long_s, silent_s = (number / rate_hz for number in (frames.start, len(values), count))
    said = units.between(start_s, start_s + long_s)
    silence, label = np.tile(still, (count, 1)), Unit(SILENCE)
    if frames.start == 0:
        spans = (*said, Span(long_s, long_s + silent_s, label))
        return replace(motion, values=np.concatenate([values, silence])), Timeline(spans), slice(0, len(values))
    spans = (Span(0.0, silent_s, label), *said.shifted(silent_s))
    together = np.concatenate([silence, values])
    return replace(motion, values=together), Timeline(spans), slice(count, len(together))


def measure_at_rest(name: str, curve: Array, rest: NDArray[np.bool_]) -> float:
    """Return the median of a curve at rest.

    name : of the curve, for the message
    rest : of ``find_rest_frames``
    Raises InputError: the median is not positive.
    """
    value = float(np.median(curve[rest]))
    if not value > 0:
        raise InputError(f"the {name} is {value:g} at rest, required more than 0")
    return value
