"""Mouth poses of video frames from motion and phones. Lengths are in eye distances."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.faces.drawn_motion import check_drawn, gap_in_pictures
from lipmotion.motion.gestures import GESTURES, OVAL, PURSED, TIP_OUT, TIP_UP, gesture_curves, pause_curve
from lipmotion.motion.rest import against_rest, rest_frames
from lipmotion.types import Motion, Timeline, Unit

Curve = NDArray[np.float64]

CLOSED_BELOW = 0.012
"""Tracked lips that touch have openings up to this; smaller openings are drawn closed."""
PARTED = 0.03
"""From this opening on the lips are drawn apart; below, down to ``CLOSED_BELOW``, the drawn gap falls to 0."""
DRAWN_GAPS = ((CLOSED_BELOW, 0.0), (PARTED, 0.05), (0.06, 0.085), (0.12, 0.15), (1.0, 1.18))
"""Openings, and the gaps at which the face tracker, by which openings were measured, sees them 1.3 times as large.

Small openings it hardly sees, on drawings as on people (docs/results/character.md): 0.045 is closed to it.
"""
WIDEST = 0.45
"""Largest drawn gap; openings of speech stay below 0.35."""
WIDTH_GAIN, WIDTH_REACH = 2.0, 0.32
"""Changes of width are exaggerated: small ones by the factor, none beyond the reach."""
ROUNDED, PURSED_MORE, STRETCHED = 0.12, 0.06, 0.04
"""So much narrower are protruded lips, pursed ones beyond that, and so much wider spread ones, than was measured."""
ROUNDED_UNMEASURED = 0.2
"""``ROUNDED`` for a motion without ``width``."""
TUCKED_GAP = (0.038, 0.05)
"""Range of the gap while the lower lip is on the teeth: enough to show them."""
TONGUE_GAP = (0.068, 0.085)
"""Range of the gap while the tongue is between the teeth."""
TEETH_GAP, ROUND_GAP = 0.05, 0.074
"""Least gap while both rows of teeth are shown, and of protruded lips."""
PURSED_GAP = (0.045, 0.055)
"""Range of the gap of pursed lips: the hole of w is small, but seen."""
TUCKED_CHIN = 0.6
"""Share of its drop by which the chin rises while the lower lip is on the teeth."""
LIP_SPEED = 2.2
"""The gap changes no faster beside f and v, in eye distances a second (20 cm/s on a face)."""
TEETH_FILL, ROUND_FILL = 0.012, 0.005
"""Openings look smaller where teeth fill them, or where they are small holes; they are drawn so much larger."""
FLAT = 0.1
"""Share by which the slot of spread lips is lower than an opening without phones."""
OVAL_NARROWER, OVAL_TALLER = 0.14, 0.15
"""Shares of width and gap by which an oval mouth is narrower and taller than was measured."""
OVAL_GAPS = (0.08, 0.18)
"""Gap at which the opening begins to become an oval, and at which it is one, where the phone asks for it."""
PAUSE_S = 0.15
"""In pauses of at least this duration the mouth closes."""
DRAWN = ("opening", "width", "outer", "y_152", *GESTURES)
"""The channels that are drawn."""


class MouthPose(NamedTuple):
    """The mouth in one frame.

    gap      : distance of the inner lips, in eye distances; 0: they touch
    width    : distance of the lip corners relative to the rest pose
    fullness : thickness of the lips relative to the rest pose
    jaw      : drop of the chin, in eye distances
    tongue, tuck, protrusion, spread, press, teeth : the articulatory channels, 0..1 (docs/articulation.md)
    oval     : how far the opening is an oval: corners halfway down, round above and below, 0..1
    """

    gap: float
    width: float = 1.0
    fullness: float = 1.0
    jaw: float = 0.0
    tongue: float = 0.0
    tuck: float = 0.0
    protrusion: float = 0.0
    spread: float = 0.0
    press: float = 0.0
    teeth: float = 0.5
    oval: float = 0.0


def frame_times(motion: Motion, fps: float) -> Curve:
    """Return the times of the video frames of a motion, to its end [shape=(N,)]."""
    return np.arange(int(np.floor((len(motion.values) - 1) / motion.rate_hz * fps + 1e-9)) + 1) / fps


def mouth_poses(motion: Motion, units: Timeline[Unit], fps: float, intensity: float = 1.0) -> list[MouthPose]:
    """Return the pose of every video frame, frame n at ``n / fps`` seconds, to the end of the motion.

    intensity : 1: as spoken; more: the same movements, larger. Closed lips stay closed at any intensity.
    Articulatory channels are those of the motion, or else follow from the phones.
    Lips that close between two video frames are drawn closed in the nearer one.
    Raises InputError: no channel ``opening``, no frames, a value that is not finite, or fps not positive.
    """
    check_drawn(motion, fps, DRAWN)
    time_s = frame_times(motion, fps)
    rest = rest_frames(motion, units)
    tongue, tuck, protrusion, spread, press, teeth = _gestures(motion, units, time_s, intensity)
    gap = gap_in_pictures(motion, drawn_gap(motion["opening"].astype(float), intensity), time_s, fps)
    free = (1 - press) * np.clip(gap / 0.05, 0, 1)
    pursed = np.minimum(press / (0.8 * PURSED), 1) * protrusion
    gap += min(intensity, 1) * np.maximum(tuck - press, 0) * (np.clip(gap, *TUCKED_GAP) - gap)
    shown = np.maximum(2 * teeth - 1, 0)
    for weight, least in ((shown, TEETH_GAP), (protrusion**2 * (1 - pursed), ROUND_GAP)):
        gap += free * weight * (np.maximum(gap, least) - gap)
    gap += free * (1 - tuck) * (TEETH_FILL * shown + ROUND_FILL * protrusion)
    # lips of th and w are apart, also where they were tracked as closed
    parted = min(intensity, 1) * np.clip((0.75 - press) / 0.15, 0, 1)
    gap *= 1 - FLAT * spread * np.clip((gap - 0.08) / 0.05, 0, 1)
    gap += pursed * parted * (np.clip(gap, *PURSED_GAP) - gap)
    between = parted * np.clip((tongue - TIP_UP) / (TIP_OUT - TIP_UP), 0, 1)
    gap += between * (np.clip(gap, *TONGUE_GAP) - gap)
    oval = _oval(units, time_s) * np.clip((gap - OVAL_GAPS[0]) / (OVAL_GAPS[1] - OVAL_GAPS[0]), 0, 1)
    gap *= 1 + OVAL_TALLER * oval
    gap *= 1 - pause_curve(units, time_s, PAUSE_S, blend_s=0.1, after_s=0.08, before_s=0.2)
    gap = np.minimum(gap, _most_beside_tucks(gap, tuck, time_s, LIP_SPEED * max(intensity, 1)))
    width = _at(motion, _width(motion, rest, intensity), time_s)
    narrower = (ROUNDED if "width" in motion.names else ROUNDED_UNMEASURED) * protrusion + PURSED_MORE * pursed
    width += intensity * (STRETCHED * spread - narrower)
    width -= OVAL_NARROWER * oval
    width = np.clip(width, 0.5, 1.35)
    fullness = _at(motion, _fullness(motion, rest), time_s)
    jaw = _jaw(motion, rest, gap, time_s) * (1 - TUCKED_CHIN * tuck)
    curves = gap, width, fullness, jaw, tongue, tuck, protrusion, spread, press, teeth, oval
    return [MouthPose(*row) for row in np.stack(curves, axis=1).tolist()]


def drawn_gap(opening: Curve, intensity: float = 1.0) -> Curve:
    """Return the gap to draw for a measured opening [shape=(T,)]; exactly 0 where the lips touch.

    It is continuous and never falls where the opening rises. Large gaps approach ``WIDEST``.
    """
    gap = np.interp(opening, *np.transpose(DRAWN_GAPS)) * intensity
    bend = 0.6 * WIDEST
    return np.where(gap < bend, gap, bend + (WIDEST - bend) * np.tanh((gap - bend) / (WIDEST - bend)))


def upper_share(gap: Curve | float) -> Curve:
    """Return how far the upper lip rises for a gap: at most about 5 mm; the rest of the gap is the lower lip's.

    Near 0 the share is 0.3, as tracked on GRID speaker 1.
    """
    return np.asarray(0.06 * (1 - np.exp(-5 * np.asarray(gap))))


def jaw_drop(gap: Curve | float) -> Curve:
    """Return how far the chin drops for a gap: a little less than the lower lip, which also turns outwards."""
    return 0.85 * (np.asarray(gap) - upper_share(gap))


def _gestures(motion: Motion, units: Timeline[Unit], time_s: Curve, intensity: float) -> list[Curve]:
    curves = gesture_curves(units, time_s, [name for name in GESTURES if name not in motion.names])
    for name in {*GESTURES} & {*motion.names}:
        curves[name] = np.clip(_at(motion, motion[name].astype(float), time_s), 0, 1)
    for name in ("protrusion", "spread"):  # grows with the intensity, without a corner at 1
        curves[name] = 1 - (1 - curves[name]) ** np.sqrt(intensity)
    return [curves[name] for name in GESTURES]


def _most_beside_tucks(gap: Curve, tuck: Curve, time_s: Curve, speed: float) -> Curve:
    """Return the largest gap from which the lip can reach every tucked frame at a speed [shape=(T,)]; inf: any."""
    at_tucks = np.where(tuck > 0.5, gap, np.inf)
    after = np.minimum.accumulate(at_tucks - speed * time_s) + speed * time_s
    before = np.minimum.accumulate((at_tucks + speed * time_s)[::-1])[::-1] - speed * time_s
    return np.minimum(after, before)


def _oval(units: Timeline[Unit], time_s: Curve) -> Curve:
    return gesture_curves(units, time_s, [OVAL])[OVAL]


def _at(motion: Motion, curve: Curve, time_s: Curve) -> Curve:
    return np.interp(time_s, motion.time_s, curve)


def _width(motion: Motion, rest: NDArray[np.bool_], intensity: float) -> Curve:
    if "width" not in motion.names:
        return 1 - 0.25 * np.clip(motion["opening"], 0, 0.4)
    change = against_rest("width", motion["width"].astype(float), rest) - 1
    return 1 + WIDTH_REACH * np.tanh(intensity * WIDTH_GAIN * change / WIDTH_REACH)


def _fullness(motion: Motion, rest: NDArray[np.bool_]) -> Curve:
    if "outer" not in motion.names:
        return 1 - 0.4 * np.clip(motion["opening"], 0, 0.4)
    thickness = motion["outer"] - motion["opening"]
    return np.clip(against_rest("thickness of the lips (outer - opening)", thickness, rest), 0.75, 1.25)


def _jaw(motion: Motion, rest: NDArray[np.bool_], gap: Curve, time_s: Curve) -> Curve:
    """Return how far the chin drops: as tracked (point 152, y upwards), within limits that suit the gap."""
    usual = jaw_drop(gap)
    if "y_152" not in motion.names:
        return usual
    chin = motion["y_152"]
    return np.clip(_at(motion, np.median(chin[rest]) - chin, time_s), 0.6 * usual, 1.15 * usual + 0.01)
