"""Which part of which unit in which context a frame belongs to."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.types import FRAME_RATE_HZ, Span, Timeline, Unit
from lipmotion.units import PHONES, SILENCE, VISEME_OF


class Place(NamedTuple):
    """A part of a phone between its neighbours."""

    left: str
    phone: str
    right: str
    part: int


LEVELS = 5


def level_names(place: Place) -> tuple[str, ...]:
    """Return the names of a place from the most general to the most particular context.

    Any phone, its viseme class, the phone, the phone between viseme classes, the phone between phones: so an
    unseen context, and a phone never seen at all, resolve to the closest class that was seen.
    """
    left, phone, right, part = place
    around = f"[{VISEME_OF[left]}]-{phone}+[{VISEME_OF[right]}]"
    return tuple(f"{name}:{part}" for name in ("*", f"[{VISEME_OF[phone]}]", phone, around, f"{left}-{phone}+{right}"))


def with_neighbours(units: Timeline[Unit]) -> Iterator[tuple[str, Span[Unit], str]]:
    """Give each span between the phones beside it; beyond the ends lies silence."""
    phones = [SILENCE, *(span.label.phone for span in units), SILENCE]
    return zip(phones, units, phones[2:], strict=False)


def places(units: Timeline[Unit], frames: int, parts: int, edge_s: float) -> list[Place]:
    """Return the place of every frame [length ``frames``]; frames outside all units are silence.

    parts  : an odd number of parts a phone is cut into
    edge_s : the parts before and after the middle one last an equal share, but no longer than this:
             it is the middle of a long sound that gets longer
    Raises InputError: a phone outside the inventory.
    """
    result = [Place(SILENCE, SILENCE, SILENCE, parts // 2)] * frames
    for left, span, right in with_neighbours(units):
        if span.label.phone not in VISEME_OF:
            raise InputError(f"unknown phone {span.label.phone!r} at {span.start_s} s; the phones: {' '.join(PHONES)}")
        first, stop = (int(np.ceil(t * FRAME_RATE_HZ - 1e-6)) for t in (span.start_s, span.end_s))
        time_s = np.arange(first, min(stop, frames)) / FRAME_RATE_HZ
        for frame, part in enumerate(_parts(time_s, span.start_s, span.end_s, parts, edge_s), first):
            result[frame] = Place(left, span.label.phone, right, int(part))
    return result


def _parts(time_s: NDArray[np.float64], start_s: float, end_s: float, parts: int, edge_s: float) -> NDArray[np.intp]:
    step = min((end_s - start_s) / parts, edge_s)
    half = parts // 2
    from_start = np.minimum((time_s - start_s) / step, half)
    from_end = np.minimum((end_s - time_s) / step, half)
    before = np.floor(from_start + 1e-9)
    after = parts - np.ceil(from_end - 1e-9)
    part = np.where(from_start < half, before, np.where(from_end < half, after, half))
    return np.clip(part, 0, parts - 1).astype(np.intp)
