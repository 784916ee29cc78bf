"""Rest: the frames that show the rest pose of a mouth, and motion that rests in pauses between phrases."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.contact import CLOSED_OPENING, smooth_step
from lipmotion.errors import InputError
from lipmotion.types import EYE_DISTANCE, Generation, Motion, Span, Timeline, Unit, VoiceEvent
from lipmotion.types.audio import BREATH, LAUGHTER
from lipmotion.units import is_silent, mark_closing_phones

Curve = NDArray[np.float64]
LARGEST_REST = 0.06
"""A rest pose more open than this, in eye distances, is speech: the recording has hardly any silence."""


def find_rest_frames(motion: Motion, units: Timeline[Unit], opening: Curve | None = None) -> NDArray[np.bool_]:
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


def measure_at_rest(name: str, curve: Curve, rest: NDArray[np.bool_]) -> float:
    """Return the median of a curve at rest. Raises InputError: it is not positive."""
    value = float(np.median(curve[rest]))
    if not value > 0:
        raise InputError(f"the {name} is {value:g} at rest, required more than 0")
    return value


REST, NATURAL = "rest", "natural"
"""Lips close softly in pauses; or they do in pauses what the model learned, as people who breathe and hold a sound."""
MIN_PAUSE_S: Final = 0.25  # in shorter pauses the mouth goes on; silence at both ends of a line counts at any length
CLOSING_S, OPENING_S = 0.2, 0.12
"""Lips take so long to close after a phrase, and begin to part so long before the next one; less in short pauses."""
BREATH_GAP, BREATH_S = 0.03, 0.04
"""The lips are parted by this, in eye distances, for a breath, so long before a phrase that begins with open lips."""
MIN_BREATH_S: Final = 0.4  # pauses in which a breath is taken last at least so long
INHALING_GAP = 0.05
"""The lips are parted by this for a breath that is detected, as GRID speaker 1 does (docs/expression.md)."""
LAUGH_GAP, LAUGH_SHARE = 0.18, 0.4
"""In laughter the lips are parted by the first length in the loudest call, by this share of it between calls."""
CALL_S, EVENT_EDGE_S = 0.05, 0.08
"""How long a call of laughter opens the mouth (a standard deviation); laughter and breaths part the lips so long before
and let them close so long after."""
PINNED_S: Final = 0.15  # within this time of a pin the motion stays as it is


def find_pauses(units: Timeline[Unit]) -> list[tuple[float, float, bool, bool]]:
    """Return the pauses in which the mouth rests: start and end in seconds, and whether speech is before and after."""
    runs: list[list[float]] = []
    for span in units:
        if is_silent(span.label.phone):
            if runs and abs(runs[-1][1] - span.start_s) < 1e-6:
                runs[-1][1] = span.end_s
            else:
                runs.append([span.start_s, span.end_s])
    first = min((span.start_s for span in units if not is_silent(span.label.phone)), default=np.inf)
    last = max((span.end_s for span in units if not is_silent(span.label.phone)), default=-np.inf)
    pauses = [(start_s, end_s, first < end_s - 1e-9, last > start_s + 1e-9) for start_s, end_s in runs]
    return [each for each in pauses if each[1] - each[0] >= MIN_PAUSE_S - 1e-9 or not (each[2] and each[3])]


def weigh_pauses(units: Timeline[Unit], time_s: Curve) -> Curve:
    """Return how far the mouth rests at each time, 0 to 1 [shape=(T,)]: 0 in speech and in short pauses."""
    weight = np.zeros(len(time_s))
    for start_s, end_s, after_speech, before_speech in find_pauses(units):
        needed_s = CLOSING_S + OPENING_S if after_speech and before_speech else CLOSING_S
        share = min((end_s - start_s) / needed_s, 1.0)
        inside = slice(*np.searchsorted(time_s, (start_s - 1e-9, end_s + 1e-9)))
        closed = np.ones(len(time_s[inside]))
        if after_speech:
            closed = smooth_step((time_s[inside] - start_s) / max(share * CLOSING_S, 1e-9))
        if before_speech:
            closed = np.minimum(closed, smooth_step((end_s - time_s[inside]) / max(share * OPENING_S, 1e-9)))
        weight[inside] = np.maximum(weight[inside], closed)
    return weight


def share_short_pauses(units: Timeline[Unit]) -> Timeline[Unit]:
    """Return phones in time in which each pause that the mouth does not rest in is shared by the phones beside it."""
    starts_s, ends_s = np.array([(start_s, end_s) for start_s, end_s, *_ in find_pauses(units)]).reshape(-1, 2).T
    spans: list[Span[Unit]] = []
    short_s = 0.0
    for span in units:
        last = int(np.searchsorted(starts_s, span.start_s + 1e-6)) - 1  # the last pause that begins before it
        if is_silent(span.label.phone) and not (last >= 0 and span.end_s <= ends_s[last] + 1e-6):
            short_s += span.duration_s
        else:
            if short_s and spans:
                spans[-1] = replace(spans[-1], end_s=span.start_s - short_s / 2)
            spans.append(replace(span, start_s=span.start_s - short_s / 2) if short_s and spans else span)
            short_s = 0.0
    return Timeline(tuple(spans))


def rest_in_pauses(
    generation: Generation, style: str, pinned_s: Sequence[float] = (), events: Sequence[VoiceEvent] = ()
) -> Generation:
    """Return generated motion whose mouth is in its rest pose in pauses, with closed lips.

    style    : ``rest``; or ``natural``, which leaves the motion as it is
    pinned_s : times of pins, around which the motion stays as it is
    events   : breaths and laughter that are detected: the mouth opens for them, where it rests else
    Before phrases after a longer pause the lips part for a breath; where p, b or m is first they stay closed, for they
    would shut again within a few pictures. The motion may have any channels; without phones it stays as it is.
    """
    motion, units = generation.motion, generation.units
    if style == NATURAL or not find_pauses(units) or not len(motion.values):
        return generation
    time_s = motion.time_s
    free = np.ones(len(time_s))
    for pin_s in pinned_s:
        free *= np.clip(np.abs(time_s - pin_s) / PINNED_S - 1, 0, 1)
    weight = weigh_pauses(units, time_s) * free
    values, resting = motion.values.copy(), np.flatnonzero(weight)
    pose = np.median(values[find_rest_frames(motion, units)].astype(np.float64), axis=0)
    if "opening" in motion.names:
        pose[motion.column("opening")] = min(pose[motion.column("opening")], 0.5 * CLOSED_OPENING)
    values[resting] += weight[resting, None] * (pose - values[resting])
    if "opening" in motion.names and motion.channels[motion.column("opening")].unit == EYE_DISTANCE:
        column = motion.column("opening")
        values[:, column] = _begin_phrases(units, time_s, values[:, column].astype(np.float64), weight, free)
        if events:
            lacking = np.maximum(_open_for_events(events, time_s) * weight - values[:, column], 0)
            # by how much each channel changes with the opening, on average; motion that hardly opens the mouth says
            # nothing of that: the opening changes alone, and with it the outer lips
            centred = motion.values.astype(np.float64) - motion.values.astype(np.float64).mean(axis=0)
            opening = centred[:, column]
            follow = np.array([float(name in ("opening", "outer")) for name in motion.names])
            if float(opening.std()) >= 0.2 * BREATH_GAP:
                follow = opening @ centred / (opening @ opening)
            values += lacking[:, None] * follow
    return replace(generation, motion=Motion(values, motion.rate_hz, motion.channels))


def _begin_phrases(units: Timeline[Unit], time_s: Curve, opening: Curve, weight: Curve, free: Curve) -> Curve:
    """Return an opening that parts for a breath before phrases; where p, b or m is first it stays closed until then."""
    opening = opening.copy()
    phones = zip(units, mark_closing_phones(units), strict=True)
    spoken = [(span, closing) for span, closing in phones if not is_silent(span.label.phone)]
    begins_s = np.array([span.start_s for span, _ in spoken])
    for start_s, end_s, *_ in find_pauses(units):
        following = int(np.searchsorted(begins_s, end_s - 1e-6))
        if following == len(spoken):
            continue
        span, closing = spoken[following]
        start, middle, stop = np.searchsorted(time_s, (start_s, end_s, span.end_s)).tolist()
        if closing and start < middle < stop:
            rests = middle - 1 - int(weight[start:middle][::-1].argmax())
            closed = middle + int(opening[middle:stop].argmin())
            least = np.interp(np.arange(rests, closed), (rests, closed), opening[[rests, closed]])
            opening[rests:closed] -= free[rests:closed] * np.maximum(opening[rests:closed] - least, 0)
        elif not closing and end_s - start_s >= MIN_BREATH_S:
            near = slice(*np.searchsorted(time_s, (end_s - OPENING_S, end_s + OPENING_S)))
            share = 1 - np.abs(time_s[near] - end_s + BREATH_S) / (OPENING_S - BREATH_S)
            opening[near] = np.maximum(opening[near], BREATH_GAP * smooth_step(share) * (weight[near] < 1))
    return opening


def _open_for_events(events: Sequence[VoiceEvent], time_s: Curve) -> Curve:
    """Return the least opening for what is detected in pauses, in eye distances [shape=(T,)]."""
    opening = np.zeros(len(time_s))
    for event in events:
        if event.kind not in (BREATH, LAUGHTER):
            continue
        near = slice(*np.searchsorted(time_s, (event.start_s - EVENT_EDGE_S, event.end_s + EVENT_EDGE_S)))
        inside = np.minimum(time_s[near] - event.start_s, event.end_s - time_s[near]) + EVENT_EDGE_S
        gap = smooth_step(inside / (2 * EVENT_EDGE_S)) * (INHALING_GAP if event.kind == BREATH else LAUGH_GAP)
        if event.kind == LAUGHTER:
            calls = [loud * np.exp(-np.square((time_s[near] - call_s) / CALL_S) / 2) for call_s, loud in event.calls]
            gap *= LAUGH_SHARE + (1 - LAUGH_SHARE) * np.max(calls, axis=0, initial=0)
        opening[near] = np.maximum(opening[near], gap)
    return opening
