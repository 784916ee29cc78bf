"""What moves in a face beside the mouth: blinks, glances, brows, and the head. All of it follows from a seed.

Blinks last about 0.2 s, close faster than they open, and come every 2 to 5 s, mostly at pauses and large glances. The
eyes jump from place to place (saccades), mostly back to the viewer, and hold their target while the head turns. The
head drifts, and nods a little with the wide syllables.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter1d

from lipmotion.types import Prosody

Curve = NDArray[np.float64]

SEED = 16


class Liveliness(NamedTuple):
    """Curves over frames: lids closed (0 to 1), brows raised (a length), gaze [shape=(T, 2)] and turn of the head
    [shape=(T, 3)] in radians."""

    shut: Curve
    brows: Curve
    gaze: Curve
    turn: Curve


def liveliness(
    opening: Curve, pause: Curve, fps: float, *, seed: int = SEED, accent: Curve | None = None
) -> Liveliness:
    """Return the movements for every frame.

    opening : of the mouth [shape=(T,)];  pause : weight of pauses, 0 to 1 [shape=(T,)]
    accent  : how loud and high the voice is, about -1 to 1 [shape=(T,)]; None: the opening stands for it
    The same input and seed give the same movements.
    """
    draw = np.random.default_rng(seed)
    count = len(opening)
    time_s = np.arange(count) / fps
    beat = _beats(opening, fps) if accent is None else gaussian_filter1d(accent, 0.1 * fps, mode="nearest")
    speaking = gaussian_filter1d(1 - pause, 0.25 * fps, mode="nearest")
    turn = _drift(draw, time_s) * (0.45 + 0.55 * speaking)[:, None]
    turn[:, 1] += -0.045 * beat + 0.012 * (1 - speaking)
    gaze, jumps_s = _glances(draw, time_s, turn)
    shut = _blinks(draw, time_s, pause, jumps_s)
    brows = 0.016 * gaussian_filter1d(np.maximum(beat, 0), 0.08 * fps, mode="nearest") + _brow_drift(draw, time_s)
    return Liveliness(shut, brows, gaze, turn)


def _beats(opening: Curve, fps: float) -> Curve:
    """Return how far the mouth is open against its surroundings, smooth, about -1 to 1 [shape=(T,)]."""
    slow = gaussian_filter1d(opening, 0.8 * fps, mode="nearest")
    fast = gaussian_filter1d(opening, 0.13 * fps, mode="nearest")
    return np.asarray(np.tanh((fast - slow) / 0.07))


def _drift(draw: np.random.Generator, time_s: Curve) -> Curve:
    """Return slow turning of the head between random poses [shape=(T, 3)]."""
    end_s = float(time_s[-1]) + 3 if len(time_s) else 3.0
    at_s = np.cumsum(draw.uniform(0.6, 1.7, int(end_s / 0.6) + 3)) - 1.2
    at_s = np.concatenate([[-2.0], at_s[(at_s > -1.9) & (at_s < end_s + 1)], [end_s + 2]])
    poses = draw.normal(0, 1, (len(at_s), 3)).clip(-1.6, 1.6) * [0.055, 0.026, 0.03]
    poses[:, 2] += -0.35 * poses[:, 0]
    poses[:2] *= 0.3
    return np.asarray(PchipInterpolator(at_s, poses)(time_s))


def _glances(draw: np.random.Generator, time_s: Curve, turn: Curve) -> tuple[Curve, Curve]:
    """Return the gaze [shape=(T, 2)], against the head, and the times of its larger jumps."""
    end_s = float(time_s[-1]) + 1 if len(time_s) else 1.0
    at_s = np.cumsum(draw.uniform(0.35, 1.9, int(end_s / 0.35) + 2))
    at_s = at_s[at_s < end_s]
    away = draw.uniform(0, 1, len(at_s)) < 0.22
    targets = draw.normal(0, 1, (len(at_s), 2)).clip(-1.5, 1.5) * np.where(away[:, None], [0.13, 0.06], [0.022, 0.014])
    targets = np.concatenate([[[0.0, 0.0]], targets])
    since = np.searchsorted(at_s, time_s, side="right")
    start = np.concatenate([[0.0], at_s])[since]
    share = np.clip((time_s - start) / 0.045, 0, 1)[:, None]
    before = targets[np.maximum(since - 1, 0)]
    goal = before + share * (targets[since] - before)
    steps = np.linalg.norm(np.diff(targets, axis=0), axis=1)
    return goal - 0.85 * turn[:, :2], at_s[steps > 0.09]


def _blinks(draw: np.random.Generator, time_s: Curve, pause: Curve, jumps_s: Curve) -> Curve:
    """Return how far the eyes are closed, 0 to 1 [shape=(T,)]."""
    shut = np.zeros(len(time_s))
    onsets_s = time_s[1:][(pause[1:] > 0.5) & (pause[:-1] <= 0.5)]
    likely_s = np.sort(np.concatenate([onsets_s, jumps_s]))
    next_s = float(draw.uniform(0.9, 2.2))
    while len(time_s) and next_s < time_s[-1]:
        near = likely_s[np.abs(likely_s - next_s) < 0.8]
        blink_s = float(near[0]) if len(near) else next_s
        share = (time_s - blink_s) / float(draw.uniform(0.17, 0.22))
        closing = np.where(share < 0.38, share / 0.38, (1 - share) / 0.62)
        shut = np.maximum(shut, np.sin(np.clip(1.25 * closing, 0, 1) * np.pi / 2))
        next_s = max(blink_s, next_s) + float(draw.uniform(2.0, 4.6))
    return shut


def _brow_drift(draw: np.random.Generator, time_s: Curve) -> Curve:
    """Return slow movement of the brows, a length [shape=(T,)]."""
    end_s = float(time_s[-1]) + 4 if len(time_s) else 4.0
    at_s = np.arange(-1.0, end_s, 1.3)
    return np.asarray(PchipInterpolator(at_s, draw.uniform(-0.006, 0.016, len(at_s)))(time_s))


def accent_of(prosody: Prosody | None, time_s: Curve) -> Curve | None:
    """Return how loud and high the voice is against its surroundings, about -1 to 1 [shape=(T,)]; None: not known."""
    if prosody is None or not len(prosody.level_db):
        return None
    at_s = np.arange(len(prosody.level_db)) / 100.0
    voiced = np.isfinite(prosody.log_f0)
    high = np.zeros(len(at_s))
    if voiced.any():
        high = np.interp(at_s, at_s[voiced], prosody.log_f0[voiced])
        high = (high - np.median(high[voiced])) / max(float(np.std(high[voiced])), 0.02)
    loud = np.asarray(prosody.level_db, float)
    loud = (loud - np.median(loud)) / max(float(np.std(loud)), 1.0)
    return np.interp(time_s, at_s, np.tanh(0.6 * high + 0.4 * loud) * np.clip(loud + 1, 0, 1))


def turned(yaw: float, pitch: float, roll: float = 0.0) -> Curve:
    """Return the rotation to the character's left, upwards and to the left shoulder, in radians [shape=(3, 3)]."""
    (cy, sy), (cp, sp), (cr, sr) = ((np.cos(a), np.sin(a)) for a in (yaw, pitch, roll))
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_x = np.array([[1, 0, 0], [0, cp, sp], [0, -sp, cp]])
    about_z = np.array([[cr, sr, 0], [-sr, cr, 0], [0, 0, 1]])
    return np.asarray(about_y @ about_x @ about_z)
