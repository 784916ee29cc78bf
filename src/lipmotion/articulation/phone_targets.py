"""Phone targets: what lips and tongue do in each phone that distances between lip points do not show.

This is the one table of phones for all faces, meshes and curve sets.

Every phone has a target for every channel, and a dominance: how strongly it pulls the channel towards its target. The
value at a time is the mean of all targets, weighted by the dominances there. A consonant that asks nothing of the lips
has little dominance over protrusion, so that the lips round before the vowel that needs it; a phone without which a
channel would be wrong (f for the tuck of the lip) has much.

Source: M. M. Cohen and D. W. Massaro, "Modeling coarticulation in synthetic visual speech", in Models and Techniques in
Computer Animation, 1993. Deviations: dominance is constant within a phone and falls off as a Gaussian beside it; the
targets are ours, set by eye, and those of diphthongs change within the phone.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.contact import EDITED
from lipmotion.storage.sources import read_shipped_table
from lipmotion.types import WEIGHT, Channel, Motion, Timeline, Unit
from lipmotion.units import LIP_CLOSING, mark_closing_phones

Curve = NDArray[np.float64]
GESTURES = ("tongue", "lip_tuck", "protrusion", "spread", "lip_press", "teeth")
"""The articulatory channels; each is a weight from 0 to 1 (docs/articulation.md)."""
OVAL = "oval"
"""How far the opening is tall and narrow instead of wide: for aa. Motion has it as a channel where edits hold it."""
SAID = (*GESTURES, OVAL)
"""All that phones ask of lips and tongue: a motion that has these channels asks its phones for nothing of it."""
TIP_UP, TIP_OUT = 0.6, 1.0
"""Values of ``tongue``: the tip is at the ridge behind the upper teeth; the tip is between the teeth."""
PURSED_PRESS = 0.5
"""Value of ``lip_press`` where w begins: with protruded lips, a hole that is almost closed; that of uw has 0."""
REACH = 4.0  # dominance is 0 further than so many widths from a phone


class GestureTarget(NamedTuple):
    """What a phone asks of a channel."""

    begin: float  # target at the first moment of the phone, 0 to 1
    end: float  # at the last one
    dominance: float  # weight beside other phones
    width_s: float  # standard deviation of the Gaussian by which dominance falls off beside the phone


@cache
def read_targets() -> dict[str, dict[str, GestureTarget]]:
    """Return the table ``phone_targets.csv``: by channel, the target of each phone; "" stands for all others."""
    targets: dict[str, dict[str, GestureTarget]] = {name: {} for name in SAID}
    for row in read_shipped_table("lipmotion.articulation", "phone_targets.csv"):
        target = GestureTarget(*(float(row[field]) for field in GestureTarget._fields))
        targets[row["channel"]] |= dict.fromkeys(row["phones"].split() or [""], target)
    return targets


def gesture_curves(units: Timeline[Unit], time_s: Curve, names: Collection[str] = GESTURES) -> dict[str, Curve]:
    """Return articulatory channels at rising times in seconds [each shape=(T,)], by name; values from 0 to 1.

    units  : the phones in time; an unknown phone asks nothing special
    names  : of ``GESTURES``, or ``OVAL``
    Without phones, ``teeth`` is that of speech, and all others are 0.
    """
    closing = mark_closing_phones(units)
    phones = [LIP_CLOSING[0] if closes else span.label.phone for span, closes in zip(units, closing, strict=True)]
    start_s, end_s = np.array([(span.start_s, span.end_s) for span in units]).reshape(-1, 2).T
    curves = {}
    for name in names:
        targets = read_targets()[name]
        chosen = [targets.get(phone, targets[""]) for phone in phones]
        begin, end, strength, width_s = np.array(chosen).reshape(-1, 4).T
        edges_s = (start_s - REACH * width_s, end_s + REACH * width_s)
        first, stop = (np.searchsorted(time_s, edge_s) for edge_s in edges_s)
        of = np.repeat(np.arange(len(chosen)), stop - first)
        frames = np.arange(len(of)) - np.repeat(np.cumsum(stop - first) - stop, stop - first)
        time = time_s[frames]
        outside = np.maximum(np.maximum(start_s[of] - time, time - end_s[of]), 0) / width_s[of]
        dominance = strength[of] * np.exp(-outside * outside)
        share = np.clip((time - start_s[of]) / np.maximum(end_s - start_s, 1e-9)[of], 0, 1)
        pull = np.bincount(frames, dominance * (begin[of] + share * (end - begin)[of]), len(time_s))
        total = 1e-6 + np.bincount(frames, dominance, len(time_s))
        curves[name] = np.clip((1e-6 * targets[""].begin + pull) / total, 0, 1)
    return curves


def with_gestures(motion: Motion, units: Timeline[Unit], names: Collection[str] = GESTURES) -> Motion:
    """Return the motion with the channels of ``SAID`` that it lacks, after its own channels; ``EDITED`` are 0."""
    missing = [name for name in names if name not in motion.names]
    curves = gesture_curves(units, motion.time_s, [name for name in missing if name in SAID])
    curves |= {name: np.zeros(len(motion.values)) for name in missing if name in EDITED.values()}
    if not curves:
        return motion
    values = np.hstack([motion.values, np.stack(list(curves.values()), axis=1).astype(motion.values.dtype)])
    return Motion(values, motion.rate_hz, (*motion.channels, *(Channel(name, WEIGHT) for name in curves)))


FADE_S = 0.06  # longest half of a cross-fade between two phones, in seconds; of short phones, half of the phone
MIN_FADE_S = 0.025  # shortest half of a cross-fade: no curve jumps, and a phone under 50 ms is not wholly said


def crossfade_phones(units: Timeline[Unit], time_s: Curve, kind: Callable[[str], str]) -> dict[str, Curve]:
    """Return how far each kind of phone is being said, 0 to 1 [each shape=(T,)]; at every time they add up to 1.

    kind : the kind of each phone; before the first and after the last unit, and in gaps, it is that of an empty phone
    Neighbours are cross-faded by half a cosine around the border between them. The middle of a phone of 50 ms or
    more is wholly its own.
    """
    names, starts, end_s = [kind("")], [-np.inf], np.inf  # every stretch lasts to the next one
    for span in units:
        if span.duration_s > 0:
            if span.start_s > end_s:
                names.append(kind(""))
                starts.append(end_s)
            names.append(kind(span.label.phone))
            starts.append(span.start_s)
            end_s = span.end_s
    if len(names) > 1:
        names.append(kind(""))
        starts.append(end_s)
    lengths = np.diff([*starts, np.inf])
    halves = [max(min(FADE_S, left / 2, right / 2), MIN_FADE_S) for left, right in pairwise(lengths)]
    rising = [np.ones(len(time_s))]
    for border, half in zip(starts[1:], halves, strict=True):
        rising.append((1 + np.sin(np.pi / 2 * np.clip((time_s - border) / half, -1, 1))) / 2)
    weights: dict[str, Curve] = {name: np.zeros(len(time_s)) for name in names}
    reached = rising[0]
    for name, following in zip(names, [*rising[1:], np.zeros(len(time_s))], strict=True):
        after = np.minimum(following, reached)
        weights[name] += reached - after
        reached = after
    return weights
