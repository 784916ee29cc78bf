"""Poses of video frames from motion and phones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.faces.character import gestures
from lipmotion.faces.character.pose import CharacterPose
from lipmotion.faces.drawn_motion import check_drawn, gap_in_pictures
from lipmotion.faces.liveliness import SEED, accent_of, liveliness
from lipmotion.motion.rest import against_rest, rest_frames
from lipmotion.types import Motion, Prosody, Timeline, Unit
from lipmotion.units import LIP_CLOSING

Curve = NDArray[np.float64]

CLOSED_BELOW = 0.012
"""Tracked lips that touch have openings up to this; smaller openings are drawn closed."""
OPEN_FROM, PARTED, GROWTH = 0.035, 0.02, 0.98
"""From this opening on the gap is the opening times the growth, plus the length: trackers read less of small openings
and more of wide ones (docs/results/head.md). Below it rises from 0, where the lips touch."""
WIDEST = 0.4
"""Largest drawn gap; openings of speech stay below 0.35."""
WIDTH_GAIN, WIDTH_REACH = 1.5, 0.34
"""Changes of width are exaggerated: small ones by the factor, none beyond the reach."""
WIDER = {"round": -0.13, "pucker": -0.07, "spread": 0.05, "oval": -0.09}
"""What gestures add to the width, relative to the rest pose."""
TUCKED_GAP = 0.054
"""How far the upper lip bares the upper teeth while the lower lip is on them."""
PUCKERED_GAP, HELD_GAP = 0.028, 0.036
"""Largest gap of W, whose lips are almost closed, and least gap of OO, whose lips stay a little open."""
TONGUE_GAP = 0.045
"""Least gap while the tongue is between the teeth."""
OVAL_GROWTH = 0.04
"""How much further the mouth opens in AA and the like."""
ROUND_GROWTH, TEETH_GAP, TONGUE_OUT_GAP, TONGUE_UP_GAP = 0.45, 0.010, -0.012, 0.02
"""Trackers read more of round lips, so that their gap grows so much less than that of others, and less where teeth or
the tongue fill the gap, to which a length is added."""
SPREAD_RISE = 0.58
"""Part of the gap by which the upper lip rises where lips are spread: the upper teeth show more than the lower ones."""
TONGUE_RISE = 0.002
"""How much further the upper lip rises while the tongue is between the teeth, so that they are seen."""
BITTEN_GAP = (0.12, 0.2)
"""Teeth stay together up to the first gap, and part until the second one."""
PAUSED_GAP = 0.03
"""Largest gap in pauses, in which people breathe with lips that hardly part."""
ARTICULATED = ("tongue", "lip_tuck", "protrusion", "spread", "lip_press", "teeth")
"""Articulatory channels that a motion may have (docs/articulation.md); what it lacks follows from the phones."""
RAISED = 0.6
"""The value of ``tongue`` with its tip behind the upper teeth; 1 is between the teeth."""
DRAWN = ("opening", "width", "outer", "y_152", *ARTICULATED)
"""The channels that are drawn."""


def head_poses(
    motion: Motion,
    units: Timeline[Unit],
    fps: float,
    *,
    seed: int = SEED,
    intensity: float = 1.0,
    prosody: Prosody | None = None,
) -> list[CharacterPose]:
    """Return the pose of every video frame, frame n at ``n / fps`` seconds, to the end of the motion.

    seed      : of blinks, glances and the movement of the head
    intensity : 1: as spoken; more: the same movements, larger. Closed lips stay closed at any intensity
    prosody   : of the speech, for accents of brows and head; None: they follow the opening
    Lips that close between two video frames are drawn closed in the nearer one; in every p, b and m there is a frame in
    which they are closed.
    Raises InputError: no channel ``opening``, no frames, a value that is not finite, or fps not positive.
    """
    check_drawn(motion, fps, DRAWN)
    time_s = np.arange(int(np.floor((len(motion.values) - 1) / motion.rate_hz * fps + 1e-9)) + 1) / fps
    rest = rest_frames(motion, units)
    said = _said(motion, units, time_s)
    pause = gestures.pause_weight(units, time_s)
    for name in ("round", "spread", "oval", "bite"):
        said[name] *= 1 - pause
    for name in ("tuck", "tongue_out"):
        said[name] *= 1 - said["press"]
    for name in ("round", "spread", "oval"):  # grows with the intensity, without a corner at 1
        said[name] = 1 - (1 - said[name]) ** np.sqrt(intensity)
    change = np.clip(intensity * _at(motion, _width(motion, rest), time_s), -WIDTH_REACH, WIDTH_REACH)
    narrow = np.clip(-change / 0.16, 0, 1) * (1 - said["spread"])
    roundness = np.maximum(said["round"], 0.4 * narrow)
    wide = np.clip(np.maximum(said["spread"], np.clip(change / 0.12, 0, 1)) - roundness, 0, 1)
    said |= {"roundness": roundness, "wide": wide, "pucker": said["pucker"] * roundness}
    parted = gap_in_pictures(motion, drawn_gap(motion["opening"].astype(float)), time_s, fps)
    gap = _articulated(np.minimum(intensity * parted, WIDEST), said, pause)
    gap = _closed(gap, units, time_s)
    bite = np.maximum(said["bite"], said["spread"] ** 1.5) * np.clip((BITTEN_GAP[1] - gap) / np.ptp(BITTEN_GAP), 0, 1)
    alive = liveliness(gap, pause, fps, seed=seed, accent=accent_of(prosody, time_s))
    curves = {
        "gap": gap,
        "upper_rise": _rise(gap, said),
        "jaw": _jaw(motion, rest, gap, time_s) * (1 - 0.85 * bite),
        "bite": np.maximum(bite, said["press"]),
        "width": 1 + change + sum(WIDER[name] * said[name] for name in WIDER),
        "fullness": _at(motion, _fullness(motion, rest), time_s) * (1 + 0.08 * roundness),
        "roundness": roundness,
        "spread": wide,
        "oval": said["oval"],
        "protrusion": 0.08 * roundness + 0.035 * said["pucker"],
        "press": said["press"],
        "tuck": said["tuck"],
        "tongue_out": said["tongue_out"],
        "tongue_up": said["tongue_up"] * (1 - said["tongue_out"]) * (1 - said["bite"]),
        "smile": 0.004 * wide,
        "shut": alive.shut,
        "brows": alive.brows,
    }
    rows = np.stack(list(curves.values()), axis=1).tolist()
    return [
        CharacterPose(**dict(zip(curves, row, strict=True)), gaze=(gaze[0], gaze[1]), turn=(turn[0], turn[1], turn[2]))
        for row, gaze, turn in zip(rows, alive.gaze.tolist(), alive.turn.tolist(), strict=True)
    ]


def _said(motion: Motion, units: Timeline[Unit], time_s: Curve) -> dict[str, Curve]:
    """Return the weights of all gestures: those of the motion's own articulatory channels where it has them."""
    said = {name: gesture.weight(units, time_s) for name, gesture in gestures.GESTURES.items()}
    given = {
        name: np.clip(_at(motion, motion[name].astype(float), time_s), 0, 1)
        for name in ARTICULATED
        if name in motion.names
    }
    for name, channel in (("tuck", "lip_tuck"), ("round", "protrusion"), ("spread", "spread"), ("press", "lip_press")):
        said[name] = given.get(channel, said[name])
    if "tongue" in given:
        said["tongue_out"] = np.clip((given["tongue"] - RAISED) / (1 - RAISED), 0, 1)
        said["tongue_up"] = np.minimum(given["tongue"] / RAISED, 1)
    if "teeth" in given:
        said["bite"] = np.clip(2 * given["teeth"] - 1, 0, 1)
    return said


def _articulated(gap: Curve, said: dict[str, Curve], pause: Curve) -> Curve:
    """Return the gap that suits what is said: teeth on the lip, tongue between the teeth, lips at rest in pauses."""
    gap = gap * (1 + OVAL_GROWTH * said["oval"])
    gap = gap - said["roundness"] * (1 - ROUND_GROWTH) * np.maximum(gap - PARTED, 0)
    added = TEETH_GAP * said["wide"] + TONGUE_OUT_GAP * said["tongue_out"] + TONGUE_UP_GAP * said["tongue_up"] ** 2
    gap = gap + added * np.clip(gap / 0.05, 0, 1)
    held = said["hold"] * (1 - said["press"])
    gap = gap + held * (np.maximum(gap, HELD_GAP) - gap)
    gap = gap + said["pucker"] * (np.minimum(gap, PUCKERED_GAP) - gap)
    gap = gap + said["tuck"] * (TUCKED_GAP - gap)
    gap = gap + said["tongue_out"] * (np.maximum(gap, TONGUE_GAP) - gap)
    gap = gap + pause * (np.minimum(gap, PAUSED_GAP) - gap)
    return np.maximum(gap * (1 - said["close"]), 0)


def _rise(gap: Curve, said: dict[str, Curve]) -> Curve:
    """Return how far the upper lip rises [shape=(T,)]: little in round lips; spread lips, TH and F bare the teeth."""
    rise = upper_share(gap)
    rise = rise + np.maximum(said["wide"], 0.9 * said["bite"]) * np.maximum(
        np.minimum(SPREAD_RISE * gap, 0.07) - rise, 0
    )
    rise = rise + TONGUE_RISE * said["tongue_out"] * np.clip(gap / 0.05, 0, 1)
    rise = rise + said["roundness"] * (0.48 * gap - rise)
    return np.minimum(rise + said["tuck"] * np.maximum(TUCKED_GAP - rise, 0), gap)


def drawn_gap(opening: Curve) -> Curve:
    """Return the gap to draw for a measured opening [shape=(T,)]; exactly 0 where the lips touch."""
    parted = GROWTH * opening + PARTED
    risen = np.clip((opening - CLOSED_BELOW) / (OPEN_FROM - CLOSED_BELOW), 0, 1)
    return np.clip(parted * risen, 0, WIDEST)


def upper_share(gap: Curve) -> Curve:
    """Return how far the upper lip rises for a gap [shape=(T,)]: at most about 5 mm; the rest is the lower lip's."""
    return np.asarray(0.055 * (1 - np.exp(-5.5 * gap)))


def _at(motion: Motion, curve: Curve, time_s: Curve) -> Curve:
    return np.interp(time_s, motion.time_s, curve)


def _closed(gap: Curve, units: Timeline[Unit], time_s: Curve) -> Curve:
    """Return the gap with one frame closed in every phone of closed lips: the one of least gap."""
    closed = gap.copy()
    for span in units:
        if span.label.phone in LIP_CLOSING and len(time_s):
            first, stop = np.searchsorted(time_s, (span.start_s, span.end_s))
            if first == stop:
                first = min(first, len(time_s) - 1)
                stop = first + 1
            closed[first + int(np.argmin(gap[first:stop]))] = 0
    return closed


def _width(motion: Motion, rest: NDArray[np.bool_]) -> Curve:
    """Return the change of width against the rest pose, as a part of it [shape=(T,)]."""
    if "width" not in motion.names:
        return -0.2 * np.clip(motion["opening"].astype(float), 0, WIDEST)
    change = against_rest("width", motion["width"].astype(float), rest) - 1
    return np.asarray(WIDTH_REACH * np.tanh(WIDTH_GAIN * change / WIDTH_REACH))


def _fullness(motion: Motion, rest: NDArray[np.bool_]) -> Curve:
    if "outer" not in motion.names:
        return 1 - 0.4 * np.clip(motion["opening"].astype(float), 0, WIDEST)
    thickness = (motion["outer"] - motion["opening"]).astype(float)
    return np.clip(against_rest("thickness of the lips (outer - opening)", thickness, rest), 0.75, 1.25)


def _jaw(motion: Motion, rest: NDArray[np.bool_], gap: Curve, time_s: Curve) -> Curve:
    """Return how far the chin drops: as tracked (point 152, y upwards), within limits that suit the gap."""
    usual = 0.85 * (gap - upper_share(gap))
    if "y_152" not in motion.names:
        return usual
    chin = motion["y_152"].astype(float)
    return np.clip(_at(motion, np.median(chin[rest]) - chin, time_s), 0.85 * usual, 1.2 * usual + 0.01)
