"""Conversion between units in time and units in frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.hmm.multistream.recognise import RecognisedUnit
from lipmotion.types import FRAME_RATE_HZ, Span, Timeline, Unit, frames_of


def units_to_frames(
    units: Timeline[Unit], frames: int, silence: str, unit_of: Callable[[Unit], str] = attrgetter("phone")
) -> tuple[tuple[str, ...], NDArray[np.intp]]:
    """Return the units of a recording, and the first frame of each, with the frame count at the end.

    frames  : T > 0; frame n belongs to the unit at n · 10 ms
    silence : the unit for gaps between the given ones
    unit_of : gives the name of a unit; by default its phone
    A unit without a frame of its own is left out.
    Raises InputError: no frames.
    """
    if frames < 1:
        raise InputError(f"{frames} frames, required one or more")
    names: list[str] = []
    firsts: list[int] = []
    end = 0
    for span in units:
        first, stop = (max(edge, end) for edge in frames_of(span, frames))
        if first > end:
            names.append(silence)
            firsts.append(end)
        if stop > first:
            names.append(unit_of(span.label))
            firsts.append(first)
        end = max(end, stop)
    if end < frames:
        names.append(silence)
        firsts.append(end)
    return tuple(names), np.array([*firsts, frames], np.intp)


def frames_to_units(
    recognised: Sequence[RecognisedUnit], duration_s: float, label_of: Callable[[str], Unit] = Unit
) -> Timeline[Unit]:
    """Return recognised units in time: frame n covers (n ± ½) · 10 ms; together they last from 0 s to ``duration_s``.

    label_of : gives the label of a unit's name; by default the name is the phone
    """
    edges = np.clip((np.array([unit.first for unit in recognised]) - 0.5) / FRAME_RATE_HZ, 0, duration_s).tolist()
    spans = zip(edges, [*edges[1:], duration_s], recognised, strict=True)
    return Timeline(tuple(Span(start_s, end_s, label_of(unit.unit)) for start_s, end_s, unit in spans))
