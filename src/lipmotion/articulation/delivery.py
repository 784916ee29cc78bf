"""Changes to generated motion on its way to an output: earlier than the sound, later on a timeline, larger, or held.

Each function returns a new generation; without options the motion stays as the engine made it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.contact import CLOSED_OPENING, EDITED, find_closures, read_edited, smooth_step
from lipmotion.articulation.expression import is_mood
from lipmotion.articulation.rest import find_rest_frames
from lipmotion.errors import InputError
from lipmotion.types import EYE_DISTANCE, WEIGHT, CurveEdit, Generation, Motion, Pin, Span, StateTrace, Timeline, Unit
from lipmotion.types.delivery import Delivery as Delivery  # noqa: PLC0414 (part of this module's interface)
from lipmotion.types.edits import Locked
from lipmotion.units import is_silent


def choose_holds(rows: NDArray[np.float64], hold: int, fixed: Sequence[int] = ()) -> list[int]:
    """Return the first frame of every held pose, in order, and the number of frames after them [B + 1 numbers].

    rows  : curves over time, scaled so that their differences count alike [shape=(T, D)]
    hold  : minimum frames of a pose, > 0; with fewer than 2 · ``hold`` frames in all, one pose has them all
    fixed : frames to be shown as they are: a pose with one or several of them is their mean
    Every other pose is the mean of its frames. Poses have ``hold`` to 2 · ``hold`` - 1 frames; of all such divisions
    this has the smallest sum of squared differences between curves and poses (dynamic programming, exact).
    Without fixed frames longer poses never do better, for two are never worse than one. With fixed frames they can.
    Cost: O(T · hold · D) time, O(T · D) memory.
    """
    frames = len(rows)
    if frames < 2 * hold or not frames:
        return [0, frames] if frames else [0]
    if hold == 1:
        return list(range(frames + 1))
    centred = rows - rows.mean(axis=0)
    marked = np.zeros(frames)
    marked[list(fixed)] = 1
    sums, squares, counts, marked_sums = (  # of the first n rows
        np.concatenate([np.zeros((1, *each.shape[1:])), np.cumsum(each, axis=0)])
        for each in (centred, (centred**2).sum(axis=1), marked, centred * marked[:, None])
    )
    best = np.full(frames + 1, np.inf)
    best[0] = 0.0
    before = np.zeros(frames + 1, np.intp)
    for stop in range(hold, frames + 1):
        starts = np.arange(max(stop - 2 * hold + 1, 0), stop - hold + 1)
        length, total = stop - starts, sums[stop] - sums[starts]
        count, shown = counts[stop] - counts[starts], marked_sums[stop] - marked_sums[starts]
        is_fixed = count > 0
        pose = np.where(is_fixed[:, None], shown, total) / np.where(is_fixed, count, length)[:, None]
        cost = squares[stop] - squares[starts] - (pose * (2 * total - length[:, None] * pose)).sum(axis=1)
        reached = best[starts] + cost
        chosen = int(reached.argmin())
        best[stop], before[stop] = reached[chosen], starts[chosen]
    borders = [frames]
    while borders[-1] > 0:
        borders.append(int(before[borders[-1]]))
    return borders[::-1]


Curve = NDArray[np.float64]

UNSCALED_GAP = 0.03
"""Lips that have just parted by less than this, in eye distances, move less than in proportion to the intensity."""
INTENSIFIED = ("protrusion", "spread")
"""The articulatory channels that grow with the intensity; the others state what touches what."""
POSE_CHANNELS = ("opening", "width", "outer")
"""The channels that decide where held poses begin, where the motion has them."""


def shift_in_time(generation: Generation, delivery: Delivery) -> Generation:
    """Return a generation whose mouth moves earlier by the anticipation, and everything later by the offset.

    It becomes longer by the offset. What falls before time 0 is cut; missing frames at the edges repeat the nearest
    pose. Frames are interpolated, but not those in which p, b or m closes the lips: these would open.
    Raises InputError: nothing is left.
    """
    motion, rate_hz = generation.motion, generation.motion.rate_hz
    later_s, by_s = delivery.offset_ms / 1000, (delivery.offset_ms - delivery.anticipation_ms) / 1000
    if not (by_s or later_s) or not len(motion.values):
        return generation
    motion_s = (len(motion.values) - 1) / rate_hz
    duration_s = motion_s + later_s
    if duration_s < 0:
        what = f"the offset is {delivery.offset_ms:g} ms, and the motion lasts {motion_s:.2f} s: nothing is left"
        raise InputError(f"{what}; give a smaller one")
    position: Curve = np.arange(int(np.floor(duration_s * rate_hz + 1e-6)) + 1.0) - by_s * rate_hz
    nearest = np.clip(np.rint(position), 0, len(motion.values) - 1).astype(int)
    if abs(by_s * rate_hz - round(by_s * rate_hz)) < 1e-6:
        values = motion.values[nearest]
    else:
        values = motion.at(position / rate_hz)
        for time_s in (*find_closed_times(generation), *generation.pinned_s):
            frame = int(time_s * rate_hz + 0.5)
            if 0 <= (at := round(frame + by_s * rate_hz)) < len(values):
                values[at] = motion.values[frame]
    end_s = max(duration_s, later_s, *(span.end_s + later_s for span in generation.units))
    return replace(
        generation,
        motion=Motion(values, rate_hz, motion.channels),
        spread=generation.change_frames(lambda rows: rows[nearest]),
        units=shift_units(generation.units, by_s, end_s),
        trace=StateTrace(generation.trace.states, generation.trace.frames[nearest]),
        curve_edits=_shift_edits(generation.curve_edits, by_s, duration_s),
        pinned_s=tuple(each + by_s for each in generation.pinned_s if 0 <= each + by_s <= duration_s),
    )


def _shift_edits(edits: Sequence[CurveEdit], by_s: float, duration_s: float) -> tuple[CurveEdit, ...]:
    """Return edits later by ``by_s``, without pins that are then outside."""
    shifted: list[CurveEdit] = []
    for edit in edits:
        if not isinstance(edit, Pin):
            later = replace(edit, start_s=edit.start_s + by_s, end_s=edit.end_s + by_s)
            if isinstance(later, Locked):
                later = replace(later, edits=_shift_edits(later.edits, by_s, duration_s))
            shifted.append(later)
        elif 0 <= edit.time_s + by_s <= duration_s:
            shifted.append(replace(edit, time_s=edit.time_s + by_s))
    return tuple(shifted)


def shift_units(units: Timeline[Unit], by_s: float, end_s: float) -> Timeline[Unit]:
    """Return phones later by ``by_s``, cut to 0 … ``end_s``; silence at an edge is stretched to it."""
    first, last = 0, len(units) - 1
    spans = []
    for number, span in enumerate(units):
        silent = is_silent(span.label.phone)
        start_s = 0.0 if silent and number == first and by_s > 0 else max(span.start_s + by_s, 0.0)
        stop_s = min(span.end_s + by_s, end_s)
        stop_s = end_s if silent and number == last and by_s < 0 else stop_s
        if stop_s > start_s:
            spans.append(Span(start_s, stop_s, span.label))
    return Timeline(tuple(spans))


def intensify(
    generation: Generation, intensity: float | Curve, opening: Curve | None = None, *, in_place: bool = False
) -> Generation:
    """Return a generation whose movements away from the rest pose are ``intensity`` times as large.

    intensity : one number, or one for each frame [shape=(T,)]; frames of 1 do not change
    opening   : distance of the lips in every frame [shape=(T,)]; None: the channel ``opening``
    in_place  : whether the motion is nobody else's: hours of it would not fit twice
    Each frame has one factor for the whole face, so that distances and points agree. The factor is the intensity where
    the mouth is open, and 1 where the lips touch or are as close as at rest (silence, p b m); without an opening it is
    the intensity everywhere. Openings above the motion's largest level off at twice that. Weights stay in 0 to 1.
    """
    motion = generation.motion
    factor = intensity = np.broadcast_to(np.asarray(intensity, np.float64), len(motion.values))
    if not len(changed := np.flatnonzero(intensity != 1)):
        return generation
    if opening is None and "opening" in motion.names:
        opening = motion["opening"].astype(np.float64)
    rest = find_rest_frames(motion, generation.units, opening)
    if opening is not None:
        closed = float(np.median(opening[rest]))
        further, touching = opening - closed, max(CLOSED_OPENING - closed, 0.0)
        widest = max(float(further.max()), 1e-9)
        wanted = np.maximum(intensity * further, 0)
        limited = np.where(wanted > widest, widest + widest * np.tanh((wanted - widest) / widest), wanted)
        change = np.divide(limited, further, out=np.ones_like(further), where=further > 0) - 1
        factor = 1 + smooth_step((further - touching) / UNSCALED_GAP) * change
    values = motion.values if in_place else motion.values.copy()
    for column, channel in enumerate(motion.channels):  # by columns: hours of all channels would not fit twice
        curve = values[:, column].astype(np.float64)
        if channel.name in INTENSIFIED:
            curve = 1 - np.clip(1 - curve, 0, 1) ** np.sqrt(intensity)
        elif channel.name not in ARTICULATORY and not is_mood(channel.name):
            still = np.median(curve[rest])
            curve = still + factor * (curve - still)
            curve = np.clip(curve, 0, 1) if channel.unit == WEIGHT else curve
        values[changed, column] = curve[changed]
    spread = generation.change_frames(lambda rows: (rows * factor[:, None] ** 2).astype(rows.dtype))
    return replace(generation, motion=replace(motion, values=values), spread=spread)


ARTICULATORY = ("tongue", "lip_tuck", "lip_press", "teeth", "oval", *INTENSIFIED, *EDITED.values())
"""Channels that are not movements away from a rest pose (docs/articulation.md)."""


def hold_poses(generation: Generation, frames: int, closed_s: Sequence[float] = ()) -> Generation:
    """Return a generation whose poses are each held for at least ``frames`` frames, and then change at once.

    frames   : less than 2: the curves stay as they are
    closed_s : times in seconds at which the lips are closed in p, b and m (``find_closed_times``)
    Where the poses begin is chosen so that they differ least from the curves (``choose_holds``). The pose
    that shows p, b or m is that of the frame in which the lips are closed; every other pose is the mean of its frames.
    """
    motion = generation.motion
    count = len(motion.values)
    if frames < 2 or not count:
        return generation
    closed = np.unique([min(round(time_s * motion.rate_hz), count - 1) for time_s in closed_s]).astype(int)
    is_measured = not {*POSE_CHANNELS}.isdisjoint(motion.names)  # then no other distance counts
    chosen = [each.name in POSE_CHANNELS or each.unit != EYE_DISTANCE or not is_measured for each in motion.channels]
    rows = motion.values[:, chosen].astype(np.float64)
    kinds = np.array([each.unit for each in motion.channels])[chosen]
    for kind in set(kinds.tolist()):  # each unit scaled to a standard deviation of 1
        rows[:, kinds == kind] /= max(float(rows[:, kinds == kind].std(axis=0).max()), 1e-12)
    borders = choose_holds(rows, frames, closed.tolist())
    starts, lengths = np.array(borders[:-1]), np.diff(borders)
    values = np.add.reduceat(motion.values.astype(np.float64), starts, axis=0) / lengths[:, None]
    poses = np.searchsorted(starts, closed, side="right") - 1
    for pose in np.unique(poses):
        values[pose] = motion.values[closed[poses == pose]].mean(axis=0)
    middle = np.repeat(starts + lengths // 2, lengths)
    return replace(
        generation,
        motion=replace(motion, values=np.repeat(values, lengths, axis=0)),
        spread=generation.change_frames(lambda rows: rows[middle]),
        trace=StateTrace(generation.trace.states, generation.trace.frames[middle]),
    )


def close_on_frame_grid(generation: Generation, rate_hz: float) -> Generation:
    """Return a generation whose closures of p, b and m lie at times n / ``rate_hz`` s, where that rate shows them."""
    motion, time_s = generation.motion, generation.sample_times(rate_hz)
    values = motion.values.copy()
    for frame, *_ in find_closures(motion, generation.units):
        position = time_s[min(round(frame / motion.rate_hz * rate_hz), len(time_s) - 1)] * motion.rate_hz
        first, last = int(np.floor(position + 1e-6)), int(np.ceil(position - 1e-6))
        values[min(first, len(values) - 1) : last + 1] = motion.values[frame]
    for channel in EDITED.keys() & {*motion.names}:
        edited = read_edited(motion, channel) > 1 - 1e-6  # where it is pinned, drawn or held
        values[edited, motion.column(channel)] = motion[channel][edited]
    return replace(generation, motion=replace(motion, values=values))


def find_closed_times(generation: Generation) -> list[float]:
    """Return the time in seconds at which each p, b and m closes the lips; none where no opening is known."""
    return [each.frame / generation.motion.rate_hz for each in find_closures(generation.motion, generation.units)]


def delay_units(units: Timeline[Unit], delivery: Delivery, end_s: float) -> Timeline[Unit]:
    """Return the phones in the time of the sound, for label files: later by the offset, without the anticipation."""
    later_s = delivery.offset_ms / 1000
    last_s = max(end_s, *(span.end_s for span in units), 0.0)
    return shift_units(units, later_s, last_s + later_s) if later_s else units
