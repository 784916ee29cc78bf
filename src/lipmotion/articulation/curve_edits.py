"""Edits applied after generation: pins, gains, drawn values of a curve; gains, holds and locks of the whole mouth."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.contact import EDITED, gap_to_opening, read_gap
from lipmotion.articulation.delivery import intensify
from lipmotion.articulation.phone_targets import SAID, with_gestures
from lipmotion.articulation.rest import find_rest_frames
from lipmotion.errors import InputError
from lipmotion.motion.closure import OPENING
from lipmotion.motion.generation import bend_through_pins, find_pinned_frame
from lipmotion.types import WEIGHT, CurveEdit, DrawnCurve, Gain, Generation, Hold, Motion, Pin, Timeline, Unit
from lipmotion.types.edits import Locked

Curve = NDArray[np.float64]

PIN_REACH_S = 0.1  # a pin bends a curve within this time before and after it
GAIN_EDGE_S = 0.1  # a gain grows and fades in this time
SAME_GAP = 1e-6
LOCK_EDGE_S = 0.05  # motion goes over into a locked span, or one that is held, and out of it, in this time


def apply_curve_edits(
    motion: Motion, units: Timeline[Unit], edits: Sequence[CurveEdit], *, held: Collection[str] = ()
) -> Motion:
    """Return motion with edits of its channels; those of other channels change nothing.

    A pinned value holds exactly in the frame nearest to its time, also where a gain acts; the curve bends towards it
    within ``PIN_REACH_S``. A gain multiplies weights, and the distance of other channels to their rest pose. What is
    drawn replaces the curve, and what the gains before it did there. Weights stay between 0 and 1.
    units : phones in time, whose silences show the rest pose
    held  : channels that phones make, and that stay where the mouth is held (``hold_mouth``)
    Raises InputError: a pin outside the motion, or a weight that is to be less than 0 or more than 1.
    """
    locked = [edit for edit in edits if isinstance(edit, Locked)]
    others = [edit for edit in edits if not isinstance(edit, Locked)]
    acting = [edit for edit in others if edit.channel in motion.names or isinstance(edit, Hold)]
    phonetic = np.isin(motion.names, list(held))
    if not any(edit.channel or phonetic.any() for edit in acting):
        return motion
    time_s, values, rest = motion.time_s, motion.values.astype(np.float64), find_rest_frames(motion, units)
    pins = []
    for edit in acting:
        if isinstance(edit, Hold):
            frame = min(round(edit.start_s * motion.rate_hz), len(values) - 1)
            share = weigh_span(time_s, edit.start_s, edit.end_s, LOCK_EDGE_S)[:, None] * phonetic
            values += share * (values[frame] - values)
            continue
        column = motion.column(edit.channel)
        is_weight = motion.channels[column].unit == WEIGHT
        if isinstance(edit, Pin):
            frame = find_pinned_frame(edit, len(motion.values), motion.rate_hz, is_weight=is_weight)
            pins.append((frame, column, edit.value))
            continue
        if isinstance(edit, DrawnCurve):
            check_drawn(edit, is_weight=is_weight)
            inside = np.flatnonzero((time_s >= edit.start_s - 1e-9) & (time_s <= edit.end_s + 1e-9))
            if len(inside):  # the curve goes over into what is drawn smoothly
                from scipy.interpolate import PchipInterpolator

                drawn = PchipInterpolator(np.linspace(edit.start_s, edit.end_s, len(edit.values)), edit.values)
                lacking = drawn(time_s[inside]) - values[inside, column]
                nearest = np.clip(np.arange(len(values)), inside[0], inside[-1]) - inside[0]
                share = weigh_span(time_s, time_s[inside[0]], time_s[inside[-1]], PIN_REACH_S)
                values[:, column] += lacking[nearest] * share
            continue
        still = 0.0 if is_weight else float(np.median(values[rest, column]))
        factor = 1 + (edit.factor - 1) * weigh_span(time_s, edit.start_s, edit.end_s, GAIN_EDGE_S)
        values[:, column] = still + factor * (values[:, column] - still)
        if edit.channel == OPENING:  # closed lips are closer than at rest
            values[:, column] = np.maximum(values[:, column], 0)
    bend_through_pins(values, pins, max(round(PIN_REACH_S * motion.rate_hz), 1))
    edited = {edit.channel for edit in acting}
    weights = [each.unit == WEIGHT and each.name in edited for each in motion.channels]
    values[:, weights] = np.clip(values[:, weights], 0, 1)
    for lock in locked:
        before = apply_curve_edits(motion, units, lock.edits, held=held).values
        values += weigh_span(time_s, lock.start_s, lock.end_s, LOCK_EDGE_S)[:, None] * (before - values)
    return replace(motion, values=values)


def check_drawn(edit: DrawnCurve, *, is_weight: bool) -> None:
    """Raise InputError if values that are drawn are not possible; ``is_weight``: whether the curve is 0 to 1."""
    if is_weight and not 0 <= min(edit.values) <= max(edit.values) <= 1:
        drawn = f"{min(edit.values):g} and {max(edit.values):g}"
        raise InputError(f"{edit.channel} is drawn between {drawn}, required 0 to 1")


def intensify_span(generation: Generation, gain: Gain) -> Generation:
    """Return a generation whose mouth moves more, or less, for a time; what is closed stays so (``intensify``)."""
    weight = weigh_span(generation.motion.time_s, gain.start_s, gain.end_s, GAIN_EDGE_S)
    return apply_stretch(generation, _cut_stretch(intensify(generation, gain.factor), weight))


def hold_mouth(generation: Generation, hold: Hold) -> Generation:
    """Return a generation whose mouth stays for a time as it is at the start of it, and goes over into that.

    All that phones ask of lips and tongue becomes channels (``SAID``), which stay, too; the opening alone decides how
    far the lips are apart (``EDITED``). They leave the hold no faster than ``LIP_SPEED``.
    """
    from lipmotion.articulation.mouth import LIP_SPEED, find_mouth

    units = generation.units
    generation = generation.with_motion(with_gestures(generation.motion, units, (*SAID, EDITED[OPENING])))
    motion = generation.motion
    frame, after_s = min(round(hold.start_s * motion.rate_hz), len(motion.values) - 1), LOCK_EDGE_S
    pose = motion.values[frame].copy()
    if OPENING in motion.names:
        column, gap = motion.column(OPENING), find_mouth(motion, units).gap[frame]
        if abs(gap - read_gap(motion)[frame]) > SAME_GAP:
            further = gap_to_opening(gap) - pose[column]
            pose[[motion.column(name) for name in (OPENING, "outer") if name in motion.names]] += further
        leaving = motion.values[slice(*np.searchsorted(motion.time_s, (hold.end_s, hold.end_s + PIN_REACH_S))), column]
        after_s = max(after_s, np.pi / 2 * np.abs(leaving - pose[column]).max(initial=0.0) / LIP_SPEED)
    pose[motion.column(EDITED[OPENING])] = 1.0
    still = replace(motion, values=np.broadcast_to(pose, motion.values.shape))
    weight = weigh_span(motion.time_s, hold.start_s, hold.end_s, LOCK_EDGE_S, after_s)
    return apply_stretch(generation, _cut_stretch(replace(generation, motion=still), weight))


def mark_edited(motion: Motion, edits: Sequence[CurveEdit]) -> Motion:
    """Return motion that says where pins and what is drawn have decided its channels (``EDITED``)."""
    for channel, name in EDITED.items():
        decided = [edit for edit in edits if edit.channel == channel and isinstance(edit, Pin | DrawnCurve)]
        share = weigh_edits(motion.time_s, decided)
        if share.any():
            motion = with_gestures(motion, Timeline(()), [name])
            values = motion.values.copy()
            values[:, motion.column(name)] = np.maximum(motion[name], share)
            motion = replace(motion, values=values)
    return motion


def weigh_edits(time_s: Curve, edits: Sequence[CurveEdit]) -> Curve:
    """Return how far some of the edits act at each time, 0 to 1 [shape=(T,)]."""
    ends = [(edit.time_s,) * 2 if isinstance(edit, Pin) else (edit.start_s, edit.end_s) for edit in edits]
    return np.max([np.zeros(len(time_s)), *(weigh_span(time_s, *each, PIN_REACH_S) for each in ends)], axis=0)


class MotionStretch(NamedTuple):
    """Motion of N frames at 100 Hz that takes the place of other motion."""

    names: tuple[str, ...]  # of its P channels
    frames: slice
    share: Curve  # how far it takes its place, 0 to 1 [shape=(N, 1)]
    values: NDArray[np.floating[Any]]  # of all P channels [shape=(N, P)]
    variance: NDArray[np.floating[Any]]  # [shape=(N, P)]


def cut_locked_stretch(generation: Generation, start_s: float, end_s: float) -> MotionStretch:
    """Return what a lock keeps of motion from ``start_s`` to ``end_s``, and beside this span."""
    return _cut_stretch(generation, weigh_span(generation.motion.time_s, start_s, end_s, LOCK_EDGE_S))


def _cut_stretch(generation: Generation, weight: Curve) -> MotionStretch:
    """Return the motion where a weight [shape=(T,)] is not 0, which is in one span."""
    inside = np.flatnonzero(weight)
    frames = slice(inside[0], inside[-1] + 1) if len(inside) else slice(0)
    motion = generation.motion
    return MotionStretch(
        motion.names, frames, weight[frames, None], motion.values[frames], generation.variance_of(frames)
    )


def apply_stretch(first: Generation, other: MotionStretch) -> Generation:
    """Return a generation, and its variances, that goes over to other motion as far as that takes its place.

    It has all channels of the other motion; what it has beside them stays.
    """
    values, variance = first.motion.values.astype(np.float64), np.array(first.variance)
    columns = [first.motion.column(name) for name in other.names]
    for ours, theirs in ((values[other.frames], other.values), (variance[other.frames], other.variance)):
        here = ours[:, columns]
        ours[:, columns] = np.where(other.share == 1, theirs, here + other.share * (theirs - here))
    return replace(first, motion=replace(first.motion, values=values), spread=variance)


def weigh_span(time_s: Curve, start_s: float, end_s: float, edge_s: float, after_s: float | None = None) -> Curve:
    """Return 1 within a span, falling to 0 in ``edge_s`` before it and ``after_s`` after it [shape=(T,)]."""
    outside = np.maximum(np.maximum((start_s - time_s) / edge_s, (time_s - end_s) / (after_s or edge_s)), 0)
    outside[outside < 1e-6] = 0.0  # the time of a frame is rounded
    weight: Curve = (1 + np.cos(np.pi * np.clip(outside, 0, 1))) / 2
    return weight
