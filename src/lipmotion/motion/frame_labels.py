"""Frames of phones in time: their states, silence, rest, and how far phones can be relied on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.types import ENERGY_FEATURE, FRAME_RATE_HZ, Span, Speech, Timeline, Unit, frames_of
from lipmotion.units import PHONES, SILENCE, UNIT_SETS, UnitSet, describe_unknown_phone, is_silent

Array = NDArray[np.float64]
BEFORE_SPEECH_S = 0.05  # mouths open or close for the first phone this long before it
MIN_SILENCE_S, FLOOR_MARGIN = 0.05, 1e-4
DISTORTIONS = (0.2, 0.35)
"""Recognised phones are relied on up to the first distortion of the sound, and from the second one on not at all. The
network finds 0.17 to 0.27 in quiet recordings of its speaker, 0.40 to 0.50 in white noise at 20 dB, 0.45 to 0.63 in
babble at 20 dB."""
DISTORTION_S = 1.0  # seconds before and after a frame over which the distortion is averaged


def is_away_from_speech(time_s: Array, speech_s: Sequence[tuple[float, float]], margin_s: float) -> NDArray[np.bool_]:
    """Return which times are further than ``margin_s`` seconds from all speech, before and after it [shape=(T,)].

    time_s   : times in seconds [shape=(T,)]
    speech_s : start and end of every interval of speech, in seconds, in order and without overlap
    Cost: O(T log N) for N intervals.
    """
    starts_s = np.array([-np.inf, *(start_s for start_s, _ in speech_s), np.inf])
    ends_s = np.array([-np.inf, *(end_s for _, end_s in speech_s), np.inf])
    last = np.searchsorted(starts_s, time_s, side="right") - 1  # the last interval that begins at or before a time
    return (time_s > ends_s[last] + margin_s) & (time_s < starts_s[last + 1] - margin_s)


def find_runs(mask: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return first frame and the one after the last of each run of True in a mask [shape=(T,)] [shape=(R, 2)]."""
    return np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]))).reshape(-1, 2)


def list_speech_intervals(units: Timeline[Unit]) -> list[tuple[float, float]]:
    """Return start and end, in seconds, of every phone that is not silence."""
    return [(span.start_s, span.end_s) for span in units if not is_silent(span.label.phone)]


def mark_distant(units: Timeline[Unit], frames: int, margin_s: float) -> NDArray[np.bool_]:
    """Return which frames are further than ``margin_s`` seconds from all speech, before and after it [shape=(T,)]."""
    return is_away_from_speech(np.arange(frames) / FRAME_RATE_HZ, list_speech_intervals(units), margin_s)


def find_digital_silence(features: NDArray[np.floating], units: Timeline[Unit]) -> NDArray[np.bool_]:
    """Return the frames of digital silence, in which the mouth rests: without even a breath [shape=(T,)].

    features : acoustic features [shape=(T, D)]
    The log energy stays at its floor for ``MIN_SILENCE_S``, and speech is further away than ``BEFORE_SPEECH_S``.
    """
    energy = features[:, ENERGY_FEATURE]
    at_floor = energy <= energy.min() + FLOOR_MARGIN
    silent = np.zeros(len(energy), bool)
    for first, stop in find_runs(at_floor):
        silent[first:stop] = stop - first >= MIN_SILENCE_S * FRAME_RATE_HZ
    return silent & mark_distant(units, len(energy), BEFORE_SPEECH_S)


def rate_phones(speech: Speech, distortion: Array | None, frames: int) -> Array:
    """Return how far the phones of speech can be relied on, 0 to 1 [shape=(frames,)].

    distortion : 0 to 1, of the sound in every frame, as a predictor finds it (None: there is none)
    Fully, where they are known; also where there are none: noise alone moves no mouth.
    """
    if speech.units_known or distortion is None or not list_speech_intervals(speech.units):
        return np.ones(frames)
    reach, numbers = int(DISTORTION_S * FRAME_RATE_HZ), np.arange(frames)
    total = np.concatenate([[0.0], np.cumsum(distortion)])
    first, stop = np.maximum(numbers - reach, 0), np.minimum(numbers + reach + 1, frames)
    mean = (total[stop] - total[first]) / (stop - first)
    clear = np.clip((DISTORTIONS[1] - mean) / (DISTORTIONS[1] - DISTORTIONS[0]), 0, 1)
    return np.maximum(clear, speech.confidence)


REST_STATE = -1  # the number of the one state of the rest pose: silence far from speech


class FullContextState(NamedTuple):
    """A state of a unit in the context of its neighbours."""

    left: str  # name of the unit before
    unit: str  # of the unit
    right: str  # of the unit after
    state: int  # number of the state within the unit, from 0; ``REST_STATE`` for the rest pose

    @property
    def context(self) -> tuple[str, str, str]:
        """The unit before, the unit, and the unit after: what the questions of decision trees are about."""
        return self.left, self.unit, self.right


@dataclass(frozen=True)
class StateLayout:
    """The number of states of every unit, and their durations."""

    speech: int  # states of a unit of speech: an odd number
    silence: int  # states of a unit that is silence only: an odd number
    # all states of a short unit last an equal share of it, in a long unit only the middle state becomes longer
    edge_s: float  # seconds that a state before or after the middle one lasts at most
    units: UnitSet = UNIT_SETS["phone"]  # the unit of every phone

    def states(self, unit: str) -> int:
        """Return how many states a unit has."""
        return self.silence if self.units.silent(unit) else self.speech

    def name(self, state: FullContextState) -> str:
        """Return the name of a state without its context: ``speech.2`` or ``silence.6``, for instance."""
        return f"{'silence' if self.units.silent(state.unit) else 'speech'}.{state.state}"

    @property
    def names(self) -> list[str]:
        """The names of all states without context, those of speech first."""
        kinds = (("speech", self.speech), ("silence", self.silence))
        return [f"{kind}.{state}" for kind, count in kinds for state in range(count)]

    @property
    def rest(self) -> FullContextState:
        """The state of frames in silence away from speech: the rest pose."""
        silence = self.units.unit(SILENCE)
        return FullContextState(silence, silence, silence, REST_STATE)

    @property
    def rest_s(self) -> float:
        """Seconds: frames in silence further than this from speech are in the state of the rest pose."""
        return self.silence // 2 * self.edge_s


def with_neighbours(units: Timeline[Unit]) -> Iterator[tuple[str, Span[Unit], str]]:
    """Return, for each span, the phone before it, the span, and the phone after it; silence beyond both ends."""
    phones = [SILENCE, *(span.label.phone for span in units), SILENCE]
    return zip(phones, units, phones[2:], strict=False)


def with_unit_names(spans: Timeline[Unit], units: UnitSet = UNIT_SETS["phone"]) -> Timeline[Unit]:
    """Return the timeline with the full-context name of each phone's unit (``sil-p+aa``); others keep theirs."""
    silence = units.unit(SILENCE)
    sequence = [silence, *(units.unit_of(span.label) for span in spans), silence]
    renamed = []
    for left, span, unit, right in zip(sequence, spans, sequence[1:], sequence[2:], strict=False):
        name = f"{left}-{unit}+{right}" if span.label.phone else unit
        renamed.append(replace(span, label=replace(span.label, unit=name)))
    return Timeline(tuple(renamed))


def label_full_context(units: Timeline[Unit], frames: int, layout: StateLayout) -> list[FullContextState]:
    """Return the full-context state of every frame at 100 Hz [length ``frames``].

    Frames in silence (the phone, whatever its unit) further than ``layout.rest_s`` from speech, and frames outside all
    spans, are in the state ``layout.rest``.
    Raises InputError: a phone outside the inventory.
    """
    for span in units:
        if span.label.phone not in PHONES:
            raise InputError(describe_unknown_phone(span.label.phone, f" at {span.start_s} s"))
    result = [layout.rest] * frames
    away = mark_distant(units, frames, layout.rest_s)
    for left, span, right in with_neighbours(units):
        first, stop = frames_of(span, frames)
        time_s = np.arange(first, stop) / FRAME_RATE_HZ
        left_unit, unit, right_unit = map(layout.units.unit, (left, span.label.phone, right))
        count = layout.states(unit)
        named = [FullContextState(left_unit, unit, right_unit, number) for number in range(count)]
        rests = is_silent(span.label.phone) & away[first:stop]
        step = min((span.end_s - span.start_s) / count, layout.edge_s)
        half = count // 2
        from_start, from_end = (time_s - span.start_s) / step, (span.end_s - time_s) / step
        before = np.floor(from_start + 1e-9)
        after = count - np.ceil(from_end - 1e-9)
        numbers = np.where(from_start < half, before, np.where(from_end <= half + 1e-9, after, half))
        state = np.minimum(np.maximum(numbers, 0), count - 1).astype(np.intp)
        for frame, number, at_rest in zip(range(first, stop), state.tolist(), rests.tolist(), strict=True):
            if not at_rest:
                result[frame] = named[number]
    return result
