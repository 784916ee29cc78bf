"""Contact of the lips: how far apart they are for a measured opening, when they touch, and how pictures show it.

This module alone decides whether lips are closed. Faces, meshes and curve sets close them where it says so.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.motion.closure import frames_within
from lipmotion.motion.frame_labels import find_runs
from lipmotion.types import Motion, Timeline, Unit
from lipmotion.types.motion import interpolate_rows
from lipmotion.units import mark_closing_phones

Curve = NDArray[np.float64]
Mask = NDArray[np.bool_]

CLOSED_OPENING: Final = 0.012  # trackers measure openings up to this on lips that touch, in eye distances
TRACKER_DEFICIT, FULL_DEFICIT_GAP = 0.006, 0.03
"""Trackers measure this much less than the distance of parted lips; from the second length on, all of it is added."""
MEASURED_GAP, LARGEST_GAP = 0.3, 0.48
"""Up to the first gap, lips are as far apart as measured; further ones approach the second, in eye distances."""
MIN_GAP: Final = 0.006  # lips that do not touch are at least this far apart, in eye distances (0.5 mm on a face)
CONTACT_S: Final = (0.05, 0.09)
"""The lips are made to touch in p, b and m for ``CONTACT_SHARE`` of the phone, but for at least the first time (longer
than a picture at 24 a second), and for no longer than the second one."""
CONTACT_SHARE: Final = 0.6
FADE_S: Final = 0.04  # lips that are made to touch come together, and part, within this time
EDITED: Final = {"opening": "edited_opening", "width": "edited_width"}
"""By channels that edits have decided, the channels that say how far, 0 to 1: as far, phones change nothing of them."""
EDITED_GAP: Final = 0.15
"""Lips that are further apart than this in all of a p, b or m are left so: somebody edited or pinned them."""
GAP: Final = "lip_gap"
"""The channel of the distance between the inner lips itself, of motion that comes from a rig, in eye distances."""


def smooth_step(share: Curve) -> Curve:
    """Return a step from 0 at 0 to 1 at 1, level at both ends [shape=(T,)]."""
    inside = np.clip(share, 0, 1)
    return np.asarray(inside * inside * (3 - 2 * inside))


def opening_to_gap(opening: Curve) -> Curve:
    """Return the inner lips' distance for an opening, eye distances [shape=(T,)]; 0 where they touch; never falling."""
    share = np.clip((opening - CLOSED_OPENING) / (FULL_DEFICIT_GAP - CLOSED_OPENING), 0, 1)
    gap = (opening + TRACKER_DEFICIT) * share
    over = (LARGEST_GAP - MEASURED_GAP) * np.tanh(np.maximum(gap - MEASURED_GAP, 0) / (LARGEST_GAP - MEASURED_GAP))
    return np.minimum(gap, MEASURED_GAP) + over


def gap_to_opening(gap: Curve) -> Curve:
    """Return the opening that trackers measure for a distance between the inner lips [shape=(T,)]."""
    near, far = np.linspace(CLOSED_OPENING, FULL_DEFICIT_GAP, 24), np.linspace(FULL_DEFICIT_GAP, 1.0, 200)
    openings = np.concatenate([near, far[1:]])
    return np.where(gap > 0, np.interp(gap, opening_to_gap(openings), openings), CLOSED_OPENING - 0.002)


def read_gap(motion: Motion) -> Curve:
    """Return the distance between the inner lips in every frame [shape=(T,)]: ``lip_gap``, or that of ``opening``."""
    if GAP in motion.names:
        return np.maximum(motion[GAP].astype(np.float64), 0)
    return opening_to_gap(motion["opening"].astype(np.float64))


def read_edited(motion: Motion, channel: str) -> Curve:
    """Return how far an edit has decided a channel of ``EDITED`` in every frame, 0 to 1 [shape=(T,)]."""
    name = EDITED[channel]
    return np.clip(motion[name].astype(np.float64), 0, 1) if name in motion.names else np.zeros(len(motion.values))


class ClosedPhone(NamedTuple):
    """A p, b or m: the frame in which the lips are closest together, and when the phone begins and ends, in seconds."""

    frame: int
    start_s: float
    end_s: float


def find_closures(motion: Motion, units: Timeline[Unit]) -> list[ClosedPhone]:
    """Return the closures of p, b and m, of the frame of least gap each, ascending; one for phones of one frame."""
    if "opening" not in motion.names:
        return []
    gap, phones = read_gap(motion), dict[int, ClosedPhone]()
    for span, closing in zip(units, mark_closing_phones(units), strict=True):
        if closing:
            first, stop = frames_within(span.start_s, span.end_s, motion.rate_hz, len(gap))
            if first >= stop:  # a phone between two frames: the nearer one
                first = min(max(round((span.start_s + span.end_s) / 2 * motion.rate_hz), 0), len(gap) - 1)
                stop = first + 1
            closest = np.flatnonzero(gap[first:stop] <= gap[first:stop].min() + 1e-9)
            frame = first + int(closest[len(closest) // 2])
            phones.setdefault(frame, ClosedPhone(frame, span.start_s, span.end_s))
    return [phones[frame] for frame in sorted(phones)]


def close_lips(gap: Curve, motion: Motion, units: Timeline[Unit]) -> Curve:
    """Return a gap with the lips in contact in every p, b and m, for ``CONTACT_S`` or longer [shape=(T,)].

    gap : of the frames of the motion, with all that phones but p, b and m ask of it [shape=(T,)]
    It is 0 where the lips touch, and at least ``MIN_GAP`` where not. What edits have decided stays (``EDITED``).
    """
    time_s, open_share = motion.time_s, np.ones(len(gap))
    parted = np.concatenate([[-1], np.flatnonzero(gap >= MIN_GAP / 2), [len(gap)]])
    for frame, begin_s, end_s in find_closures(motion, units):
        length_s = float(np.clip(CONTACT_SHARE * (end_s - begin_s), *CONTACT_S))
        after = int(np.searchsorted(parted, frame))  # the first frame in which the lips are apart, from this one on
        touching_s = float(parted[after] - parted[after - 1]) / motion.rate_hz if parted[after] > frame else 0.0
        if gap[frame] > EDITED_GAP or touching_s >= length_s - 1e-9:
            continue
        # as near to the middle of the phone as the least open frame lets it be
        at_s = float(np.clip((begin_s + end_s) / 2, time_s[frame] - length_s / 2, time_s[frame] + length_s / 2))
        near = slice(*np.searchsorted(time_s, (at_s - 0.2, at_s + 0.2)))
        outside = np.abs(time_s[near] - at_s) - length_s / 2 - 1e-9
        open_share[near] = np.minimum(open_share[near], smooth_step(outside / FADE_S))
    gap = gap * np.maximum(open_share, read_edited(motion, "opening"))
    return np.where(gap < MIN_GAP / 2, 0.0, np.maximum(gap, MIN_GAP))


def show_contact(contact: Mask, rate_hz: float, time_s: Curve) -> Mask:
    """Return in which pictures the lips touch [shape=(len(time_s),), bool].

    contact : of frames at ``rate_hz`` [shape=(T,), bool]
    A picture shows contact if the frame nearest to it has it. Contact between two pictures is shown by the nearer one;
    contact that lasts as long as a picture is shown by the two that are nearest to its middle, so that it is seen.
    """
    frames = np.clip(np.rint(time_s * rate_hz).astype(int), 0, max(len(contact) - 1, 0))
    shown = contact[frames].copy()
    if len(time_s) > 1:
        step_s = float(time_s[-1] - time_s[0]) / (len(time_s) - 1)
        for first, stop in find_runs(contact).tolist():
            middle = ((first + stop - 1) / 2 / rate_hz - float(time_s[0])) / step_s
            count = 2 if stop - first >= max(0.95 * step_s * rate_hz, 2) else 1
            start = max(int(np.ceil(middle - count / 2)), 0)
            begin, end = np.searchsorted(frames, (first, stop))
            if end - begin < count and middle < len(shown) - 0.5:
                shown[start : start + count] = True
    return shown


def sample_pictures(rows: Curve, contact: Mask, rate_hz: float, time_s: Curve) -> Curve:
    """Return rows of curves in pictures, in which the lips touch in those of ``show_contact`` and in no other.

    rows   : one a frame [shape=(T,) or (T, N)], which lips touch where ``contact`` says so [shape=(T,), bool]
    time_s : of the pictures in seconds, evenly spaced
    A picture in which the lips touch shows the nearest frame in which they do. The others lie between frames, or, where
    the lips touch in one of these, show the other one.
    """
    table = rows.reshape(len(rows), -1)
    values = interpolate_rows(table, rate_hz, time_s)
    touching = show_contact(contact, rate_hz, time_s)
    position = time_s * rate_hz
    low = np.clip(np.floor(position + 1e-6).astype(int), 0, len(rows) - 1)
    high = np.clip(np.ceil(position - 1e-6).astype(int), 0, len(rows) - 1)
    values[low == high] = table[low[low == high]]
    mixed = np.flatnonzero((contact[low] != touching) | (contact[high] != touching))
    for kind in (True, False):
        frames, chosen = np.flatnonzero(contact == kind), mixed[touching[mixed] == kind]
        if len(frames) and len(chosen):
            after = np.clip(np.searchsorted(frames, position[chosen]), 0, len(frames) - 1)
            before = np.maximum(after - 1, 0)
            nearer = np.abs(frames[before] - position[chosen]) <= np.abs(frames[after] - position[chosen])
            values[chosen] = table[frames[np.where(nearer, before, after)]]
    return values.reshape(len(time_s), *rows.shape[1:])
