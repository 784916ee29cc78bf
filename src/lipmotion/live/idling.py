"""What a live face does beside speaking: blinks, glances, brows and nods with accents, and the sway of the head.

The same movements, sizes and intervals as of whole recordings (``articulation.liveliness``, with their sources), but
decided as time goes on: a pause is known only once it is there.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.contact import smooth_step
from lipmotion.articulation.liveliness import (
    BLINK_S,
    BROW_RAISE,
    FIRST_BLINK_S,
    GAZE_COUNTER_SHARE,
    MEAN_BLINK_S,
    MIN_BLINK_S,
    NOD_RAD,
    SACCADE_S,
    STILL_SHARE,
    SWAY,
    SWAY_HZ,
    Liveliness,
    draw_fixation,
    lid_closure,
    sway,
)
from lipmotion.live.network import STEP_S
from lipmotion.meshes.fitting.eyes_and_brows import eye_and_brow_weights
from lipmotion.meshes.model.mesh import ANGLES

Array = NDArray[np.float64]
ACCENT_OPENING = 0.9
"""An accent is where the mouth opens further than this, in standard deviations; at twice as far, it is a strong one."""
ACCENT_S, TALKING_S, TURNING_S = 0.1, 0.5, 0.35
"""Time constants of brows and nods, of the liveliness of the head, and of its turning to somebody."""
LARGEST_TURN_RAD, HEAD_SHARE = 1.0, 0.7
"""The furthest that somebody may be to the side; and how much of the way the head turns, the eyes the rest."""
SWAY_STEPS = 250  # the sway of so many steps is computed at once
PHRASE_END_SHARE = 0.5  # share of the ends of phrases at which a blink comes
LONGEST_WAIT_S = 0.5  # a blink waits so long for a pause: where words end is not known
BORDER_S = 0.8  # for so long after a phrase begins the eyes rather leave the listener


class Idling:
    """Blinks, gaze, brows and head, from step to step; the same seed gives the same ones."""

    def __init__(self, seed: int = 0) -> None:
        self._seed, self._rng = seed, np.random.default_rng([seed, 2])
        self._blinks, self._waited_s = deque([float(self._rng.uniform(*FIRST_BLINK_S))], 3), 0.0
        self._fixations = deque([(-1.0, (0.0, 0.0)), (0.0, (0.0, 0.0))], 2)
        self._until_s = float(self._rng.uniform(0.4, 1.2))
        self._accent, self._talking, self._spoke, self._began_s = 0.0, 0.0, False, -BORDER_S
        self._turn = np.zeros(2)
        self._swayed = -1, np.zeros((0, 3))
        self.target, self.ahead_s = np.zeros(2), 0.0
        """Where somebody is to whom the face turns, to its left and upwards, radians; and how far time was put back."""

    def step(self, time_s: float, opening: float, speaks: bool) -> dict[str, float]:
        """Return ARKit's weights of eyes and brows, and the angles of the head, radians, one step later.

        opening : of the mouth, in standard deviations of the speaker
        speaks  : whether it speaks now
        """
        ended, time_s = self._spoke and not speaks, time_s + self.ahead_s
        self._began_s = time_s if speaks and not self._spoke else self._began_s
        self._spoke = speaks
        accent = min(max(opening / ACCENT_OPENING - 1, 0.0), 1.0) if speaks else 0.0
        self._accent += STEP_S / ACCENT_S * (accent - self._accent)
        self._talking += STEP_S / TALKING_S * (speaks - self._talking)
        self._turn += STEP_S / TURNING_S * (HEAD_SHARE * self.target - self._turn)
        self._draw_blink(time_s, ended)
        if time_s >= self._until_s:
            target, stay_s = draw_fixation(self._rng, self._fixations[-1][1], time_s - self._began_s < BORDER_S)
            self._fixations.append((time_s, target))
            self._until_s = time_s + stay_s
        number, place = divmod(round(time_s / STEP_S), SWAY_STEPS)
        if number != self._swayed[0]:
            rng = np.random.default_rng([self._seed, 1])
            ahead_s = (number * SWAY_STEPS + np.arange(SWAY_STEPS, dtype=float)) * STEP_S
            self._swayed = number, np.stack([size * sway(ahead_s, rng, *SWAY_HZ) for size in SWAY], axis=1)
        turn = (STILL_SHARE + (1 - STILL_SHARE) * self._talking) * self._swayed[1][place]
        turn[1] -= NOD_RAD * self._accent
        (_, before), (began_s, aimed) = self._fixations
        aim = np.array(before) + smooth_step(np.array([time_s - began_s]) / SACCADE_S) * np.subtract(aimed, before)
        gaze = aim - GAZE_COUNTER_SHARE * turn[:2] + self.target - self._turn
        turn[:2] += self._turn
        lids = lid_closure(np.array([time_s]), [begin for begin in self._blinks if begin <= time_s < begin + BLINK_S])
        brows = np.array([BROW_RAISE * self._accent])
        weights = eye_and_brow_weights(Liveliness(lids, brows, gaze[None], turn[None]))
        angles = dict(zip(ANGLES, turn.tolist(), strict=True))
        return {name: float(curve[0]) for name, curve in weights.items()} | angles

    def _draw_blink(self, time_s: float, ended: bool) -> None:
        """Decide when the lids fall next: at random, and rather where a phrase ends."""
        last = self._blinks[-1]
        if ended and time_s < last and self._rng.random() < PHRASE_END_SHARE:
            before = self._blinks[-2] + MIN_BLINK_S if len(self._blinks) > 1 else FIRST_BLINK_S[0]
            self._blinks[-1] = max(time_s, before)
        elif time_s >= last and self._spoke and self._waited_s < LONGEST_WAIT_S:
            self._blinks[-1], self._waited_s = time_s + STEP_S, self._waited_s + STEP_S
        elif time_s >= last:
            self._waited_s = 0.0
            self._blinks.append(last + MIN_BLINK_S + float(self._rng.gamma(2.0, (MEAN_BLINK_S - MIN_BLINK_S) / 2)))
