"""The rest pose of a mouth: the frames that show it, and sizes in it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.types import Motion, Timeline, Unit
from lipmotion.units import is_silent

Array = NDArray[np.float64]
LARGEST_REST = 0.06
"""A rest pose more open than this, in eye distances, is speech: the recording has hardly any silence."""


def rest_frames(motion: Motion, units: Timeline[Unit], opening: Array | None = None) -> NDArray[np.bool_]:
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


def size_at_rest(name: str, curve: Array, rest: NDArray[np.bool_]) -> float:
    """Return the median of a curve at rest.

    name : of the curve, for the message
    rest : of ``rest_frames``
    Raises InputError: the median is not positive.
    """
    value = float(np.median(curve[rest]))
    if not value > 0:
        raise InputError(f"the {name} is {value:g} at rest, required more than 0")
    return value
