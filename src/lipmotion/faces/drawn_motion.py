"""What drawn faces ask of motion before they draw it."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.types import Motion

Curve = NDArray[np.float64]


def check_drawn(motion: Motion, fps: float, channels: Iterable[str]) -> None:
    """Raise InputError if a face cannot be drawn from motion.

    fps      : frames per second of the pictures, required more than 0
    channels : those that are drawn, where the motion has them; ``opening`` it must have
    """
    if not 0 < fps < np.inf:
        raise InputError(f"the frame rate is {fps}, required more than 0")
    if "opening" not in motion.names:
        names = ", ".join(motion.names[:6]) + (", ..." if len(motion.names) > 6 else "") or "no channels"
        raise InputError(f"no channel 'opening' to draw a face from; the motion has: {names}")
    if not len(motion.values):
        raise InputError("the motion has no frames; there is nothing to draw")
    for name in {*channels} & {*motion.names}:
        if not np.isfinite(motion[name]).all():
            raise InputError(
                f"the channel {name!r} has values that are not finite; interpolate the missing frames first"
            )


def gap_in_pictures(motion: Motion, gap: Curve, time_s: Curve, fps: float) -> Curve:
    """Return the gap between the lips in every picture; of lips that touch between two pictures, the nearer shows it.

    gap    : at the frames of the motion [shape=(T,)]
    time_s : times of the pictures, ``fps`` a second [shape=(F,)]
    """
    shown = np.interp(time_s, motion.time_s, gap)
    nearest = np.rint(motion.time_s[gap == 0] * fps).astype(int)
    shown[nearest[nearest < len(shown)]] = 0
    return shown
