"""Which part of which unit in which context a frame belongs to."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.motion.rest import away_from_speech, speech_intervals
from lipmotion.types import FRAME_RATE_HZ, Span, Timeline, Unit
from lipmotion.units import PHONES, SILENCE, UNIT_SETS, UnitSet, is_silent, unknown_phone_message

RESTING = -1
"""The part of silence that is no part of it."""


class FullContextState(NamedTuple):
    """A part of a unit between its neighbours."""

    left: str
    unit: str
    right: str
    part: int

    @property
    def context(self) -> tuple[str, str, str]:
        """The unit between its neighbours, what decision trees ask about."""
        return self.left, self.unit, self.right


@dataclass(frozen=True)
class StateLayout:
    """How units are cut into parts.

    speech, silence : parts of a unit, and of one that is silence only; odd numbers
    edge_s : the parts before and after the middle one last an equal share, but no longer than this: it is the middle of
             a long sound that gets longer
    units  : the unit of every phone
    """

    speech: int
    silence: int
    edge_s: float
    units: UnitSet = UNIT_SETS["phone"]

    def parts(self, unit: str) -> int:
        """Return how many parts a unit has."""
        return self.silence if self.units.silent(unit) else self.speech

    def name(self, place: FullContextState) -> str:
        """Return the part alone, as ``speech.2`` or ``silence.6``."""
        return f"{'silence' if self.units.silent(place.unit) else 'speech'}.{place.part}"

    @property
    def names(self) -> list[str]:
        """All parts by name."""
        kinds = (("speech", self.speech), ("silence", self.silence))
        return [f"{kind}.{part}" for kind, count in kinds for part in range(count)]

    @property
    def rest(self) -> FullContextState:
        """The place of frames in silence away from speech."""
        quiet = self.units.unit(SILENCE)
        return FullContextState(quiet, quiet, quiet, RESTING)

    @property
    def rest_s(self) -> float:
        """The mouth rests in silence this far from speech."""
        return self.silence // 2 * self.edge_s


def with_neighbours(units: Timeline[Unit]) -> Iterator[tuple[str, Span[Unit], str]]:
    """Give each span between the phones beside it; beyond the ends lies silence."""
    phones = [SILENCE, *(span.label.phone for span in units), SILENCE]
    return zip(phones, units, phones[2:], strict=False)


def with_unit_names(spans: Timeline[Unit], units: UnitSet = UNIT_SETS["phone"]) -> Timeline[Unit]:
    """Return the timeline with the unit of each phone named, between its neighbours; units without phones stay."""
    quiet = units.unit(SILENCE)
    said = [quiet, *(units.unit_of(span.label) for span in spans), quiet]
    found = []
    for before, span, unit, after in zip(said, spans, said[1:], said[2:], strict=False):
        name = f"{before}-{unit}+{after}" if span.label.phone else unit
        found.append(replace(span, label=replace(span.label, unit=name)))
    return Timeline(tuple(found))


def full_context_states(units: Timeline[Unit], frames: int, layout: StateLayout) -> list[FullContextState]:
    """Return the place of every frame [length ``frames``].

    Silence (the phone, whatever its unit) further than ``layout.rest_s`` from speech, and frames outside all units, are
    ``layout.rest``.
    Raises InputError: a phone outside the inventory.
    """
    for span in units:
        if span.label.phone not in PHONES:
            raise InputError(unknown_phone_message(span.label.phone, f" at {span.start_s} s"))
    result = [layout.rest] * frames
    speech_s = speech_intervals(units)
    for left, span, right in with_neighbours(units):
        edges = np.ceil(np.array([span.start_s, span.end_s]) * FRAME_RATE_HZ - 1e-6)
        first, stop = np.clip(edges, 0, frames).astype(int).tolist()
        time_s = np.arange(first, stop) / FRAME_RATE_HZ
        before, unit, after = map(layout.units.unit, (left, span.label.phone, right))
        rests = is_silent(span.label.phone) & away_from_speech(time_s, speech_s, layout.rest_s)
        part = _parts(time_s, span.start_s, span.end_s, layout.parts(unit), layout.edge_s)
        for i in np.nonzero(~rests)[0]:
            result[first + i] = FullContextState(before, unit, after, int(part[i]))
    return result


def _parts(time_s: NDArray[np.float64], start_s: float, end_s: float, parts: int, edge_s: float) -> NDArray[np.intp]:
    step = min((end_s - start_s) / parts, edge_s)
    half = parts // 2
    from_start, from_end = (time_s - start_s) / step, (end_s - time_s) / step
    before = np.floor(from_start + 1e-9)
    after = parts - np.ceil(from_end - 1e-9)
    part = np.where(from_start < half, before, np.where(from_end <= half + 1e-9, after, half))
    return np.clip(part, 0, parts - 1).astype(np.intp)
