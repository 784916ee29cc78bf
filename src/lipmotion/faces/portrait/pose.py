"""Mouth poses of video frames from motion and phones. Lengths are in eye distances."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.faces.portrait.articulation import CLOSURES, TIP_RAISES, TUCKS, gesture_weight, pause_weight
from lipmotion.types import Motion, Timeline, Unit
from lipmotion.units import is_silent

Curve = NDArray[np.float64]

CLOSED_BELOW = 0.012
"""Tracked lips that touch have openings up to this; smaller openings are drawn closed."""
FAITHFUL_ABOVE = 0.03
"""From here on the drawn gap equals the opening; between the two limits it rises linearly."""
WIDEST = 0.4
"""Largest drawn gap; openings of speech stay below 0.35."""
WIDTH_GAIN, WIDTH_REACH = 1.5, 0.3
"""Changes of width are exaggerated: small ones by the factor, none beyond the reach."""
TUCKED_GAP = (0.03, 0.055)
"""Range of the gap while the lower lip is on the teeth: enough to show them."""
PAUSED_GAP = 0.035
"""Largest gap in pauses, in which people breathe with lips that hardly part."""
DRAWN = ("opening", "width", "outer", "y_152")
"""The channels that are drawn."""


class MouthPose(NamedTuple):
    """The mouth in one frame.

    gap      : distance of the inner lips, in eye distances; 0: they touch
    width    : distance of the lip corners relative to the rest pose
    fullness : thickness of the lips relative to the rest pose
    jaw      : drop of the chin, in eye distances
    tuck     : 0..1, how far the lower lip is against the upper teeth (f v)
    tip      : 0..1, how far the tip of the tongue is raised to the upper teeth (th dh l; less for t d n)
    teeth    : 0..1, how far teeth can be seen: in pauses the lips hide them
    """

    gap: float
    width: float
    fullness: float
    jaw: float
    tuck: float
    tip: float
    teeth: float = 1.0


def mouth_poses(motion: Motion, units: Timeline[Unit], fps: float) -> list[MouthPose]:
    """Return the pose of every video frame, frame n at ``n / fps`` seconds, to the end of the motion.

    Lips that close between two video frames are drawn closed in the nearer one.
    Raises InputError: no channel ``opening``, no frames, a value that is not finite, or fps not positive.
    """
    _check(motion, fps)
    time_s = np.arange(int(np.floor((len(motion.values) - 1) / motion.rate_hz * fps + 1e-9)) + 1) / fps
    rest = _rest_frames(motion, units)
    tuck = np.maximum(gesture_weight(units, TUCKS, time_s) - gesture_weight(units, CLOSURES, time_s), 0)
    gap = _gap(motion, time_s, fps)
    gap += tuck * (np.clip(gap, *TUCKED_GAP) - gap)
    pause = pause_weight(units, time_s)
    gap += pause * (np.minimum(gap, PAUSED_GAP) - gap)
    curves = (
        gap,
        _at(motion, _width(motion, rest), time_s),
        _at(motion, _fullness(motion, rest), time_s),
        _jaw(motion, rest, gap, time_s),
        tuck,
        gesture_weight(units, TIP_RAISES, time_s),
        1 - pause,
    )
    return [MouthPose(*row) for row in np.stack(curves, axis=1).tolist()]


def drawn_gap(opening: Curve) -> Curve:
    """Return the gap to draw for a measured opening [shape=(T,)]; exactly 0 where the lips touch."""
    rising = (opening - CLOSED_BELOW) * (FAITHFUL_ABOVE / (FAITHFUL_ABOVE - CLOSED_BELOW))
    return np.clip(np.minimum(opening, rising), 0, WIDEST)


def upper_share(gap: Curve | float) -> Curve:
    """Return how far the upper lip rises for a gap: at most about 5 mm; the rest of the gap is the lower lip's.

    Near 0 the share is 0.3, as tracked on GRID speaker 1.
    """
    return np.asarray(0.06 * (1 - np.exp(-5 * np.asarray(gap))))


def jaw_drop(gap: Curve | float) -> Curve:
    """Return how far the chin drops for a gap: a little less than the lower lip, which also turns outwards."""
    return 0.85 * (np.asarray(gap) - upper_share(gap))


def _check(motion: Motion, fps: float) -> None:
    if not 0 < fps < np.inf:
        raise InputError(f"the frame rate is {fps}, required more than 0")
    if "opening" not in motion.names:
        names = ", ".join(motion.names[:6]) + (", ..." if len(motion.names) > 6 else "") or "no channels"
        raise InputError(f"no channel 'opening' to draw a face from; the motion has: {names}")
    if not len(motion.values):
        raise InputError("the motion has no frames; there is nothing to draw")
    for name in {*DRAWN} & {*motion.names}:
        if not np.isfinite(motion[name]).all():
            raise InputError(
                f"the channel {name!r} has values that are not finite; interpolate the missing frames first"
            )


def _at(motion: Motion, curve: Curve, time_s: Curve) -> Curve:
    return np.interp(time_s, motion.time_s, curve)


def _gap(motion: Motion, time_s: Curve, fps: float) -> Curve:
    gap = drawn_gap(motion["opening"].astype(float))
    gap_at_frames = _at(motion, gap, time_s)
    nearest = np.rint(motion.time_s[gap == 0] * fps).astype(int)
    gap_at_frames[nearest[nearest < len(gap_at_frames)]] = 0
    return gap_at_frames


def _rest_frames(motion: Motion, units: Timeline[Unit]) -> NDArray[np.bool_]:
    """Return the frames of the rest pose [shape=(T,)]: silence, or else the tenth of the frames that is most closed."""
    time_s = motion.time_s
    rest = np.zeros(len(time_s), dtype=bool)
    for span in units:
        if is_silent(span.label.phone):
            rest |= (span.start_s <= time_s) & (time_s < span.end_s)
    if rest.any():
        return rest
    most_closed = np.argsort(motion["opening"], kind="stable")[: max(1, len(time_s) // 10)]
    rest[most_closed] = True
    return rest


def _against_rest(name: str, curve: Curve, rest: NDArray[np.bool_]) -> Curve:
    """Return the curve relative to its median at rest."""
    value = float(np.median(curve[rest]))
    if not value > 0:
        raise InputError(f"the {name} is {value:g} at rest, required more than 0")
    return curve / value


def _width(motion: Motion, rest: NDArray[np.bool_]) -> Curve:
    if "width" not in motion.names:
        return 1 - 0.25 * np.clip(motion["opening"], 0, WIDEST)
    change = _against_rest("width", motion["width"].astype(float), rest) - 1
    return 1 + WIDTH_REACH * np.tanh(WIDTH_GAIN * change / WIDTH_REACH)


def _fullness(motion: Motion, rest: NDArray[np.bool_]) -> Curve:
    if "outer" not in motion.names:
        return 1 - 0.4 * np.clip(motion["opening"], 0, WIDEST)
    thickness = motion["outer"] - motion["opening"]
    return np.clip(_against_rest("thickness of the lips (outer - opening)", thickness, rest), 0.75, 1.25)


def _jaw(motion: Motion, rest: NDArray[np.bool_], gap: Curve, time_s: Curve) -> Curve:
    """Return how far the chin drops: as tracked (point 152, y upwards), within limits that suit the gap."""
    usual = jaw_drop(gap)
    if "y_152" not in motion.names:
        return usual
    chin = motion["y_152"]
    return np.clip(_at(motion, np.median(chin[rest]) - chin, time_s), 0.6 * usual, 1.15 * usual + 0.01)
