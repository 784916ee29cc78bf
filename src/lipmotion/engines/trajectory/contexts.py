"""Which part of which unit in which context a frame belongs to."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.types import FRAME_RATE_HZ, Span, Timeline, Unit
from lipmotion.units import PHONES, SILENCE, VISEME_OF, is_silent


class Place(NamedTuple):
    """A part of a phone between its neighbours."""

    left: str
    phone: str
    right: str
    part: int


REST_MARGIN_S = 0.3
"""The mouth rests in silence this far from speech."""
LEVELS = 8


def level_names(place: Place) -> tuple[str, ...]:
    """Return the names of a place from the most general to the most particular context.

    Any phone; its viseme class, then beside the class to its left and to its right; the phone, then beside the
    classes to its left and right; the phone between phones. So an unseen context, and a phone never seen at
    all, resolve to the closest classes that were seen.
    """
    left, phone, right, part = place
    before, viseme, after = f"[{VISEME_OF[left]}]", f"[{VISEME_OF[phone]}]", f"[{VISEME_OF[right]}]"
    names = (
        "*",
        viseme,
        f"{before}-{viseme}",
        f"{viseme}+{after}",
        phone,
        f"{before}-{phone}",
        f"{phone}+{after}",
        f"{left}-{phone}+{right}",
    )
    return tuple(f"{name}:{part}" for name in names)


SPREAD_LEVELS = (0, 1, 4)
"""The levels that have variances of their own: any phone, viseme class, phone."""


def with_neighbours(units: Timeline[Unit]) -> Iterator[tuple[str, Span[Unit], str]]:
    """Give each span between the phones beside it; beyond the ends lies silence."""
    phones = [SILENCE, *(span.label.phone for span in units), SILENCE]
    return zip(phones, units, phones[2:], strict=False)


def places(units: Timeline[Unit], frames: int, parts: int, edge_s: float) -> list[Place]:
    """Return the place of every frame [length ``frames``].

    Silence further than ``REST_MARGIN_S`` from speech, and frames outside all units, are ``rest_place``.

    parts  : an odd number of parts a phone is cut into
    edge_s : the parts before and after the middle one last an equal share, but no longer than this:
             it is the middle of a long sound that gets longer
    Raises InputError: a phone outside the inventory.
    """
    result = [rest_place(parts)] * frames
    for left, span, right in with_neighbours(units):
        if span.label.phone not in VISEME_OF:
            raise InputError(f"unknown phone {span.label.phone!r} at {span.start_s} s; the phones: {' '.join(PHONES)}")
        edges = np.ceil(np.array([span.start_s, span.end_s]) * FRAME_RATE_HZ - 1e-6)
        first, stop = np.clip(edges, 0, frames).astype(int).tolist()
        time_s = np.arange(first, stop) / FRAME_RATE_HZ
        rests = _rests(time_s, left, span, right)
        part = _parts(time_s, span.start_s, span.end_s, parts, edge_s)
        for i in np.nonzero(~rests)[0]:
            result[first + i] = Place(left, span.label.phone, right, int(part[i]))
    return result


def rest_place(parts: int) -> Place:
    """Return the place of frames in silence away from speech."""
    return Place(SILENCE, SILENCE, SILENCE, parts // 2)


def _rests(time_s: NDArray[np.float64], left: str, span: Span[Unit], right: str) -> NDArray[np.bool_]:
    """Return which frames of a span are silence away from speech; beyond the recording's ends there is none."""
    if not is_silent(span.label.phone):
        return np.zeros(len(time_s), bool)
    after = np.full(len(time_s), is_silent(left)) | (time_s - span.start_s > REST_MARGIN_S)
    before = np.full(len(time_s), is_silent(right)) | (span.end_s - time_s > REST_MARGIN_S)
    return after & before


def _parts(time_s: NDArray[np.float64], start_s: float, end_s: float, parts: int, edge_s: float) -> NDArray[np.intp]:
    step = min((end_s - start_s) / parts, edge_s)
    half = parts // 2
    from_start, from_end = (time_s - start_s) / step, (end_s - time_s) / step
    before = np.floor(from_start + 1e-9)
    after = parts - np.ceil(from_end - 1e-9)
    part = np.where(from_start < half, before, np.where(from_end <= half + 1e-9, after, half))
    return np.clip(part, 0, parts - 1).astype(np.intp)
