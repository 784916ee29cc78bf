"""Round lips: what the phones say of them, beyond the speaker's own range of width.

Speakers whose lips hardly narrow in OO and W are still understood, for their lips come forward, which the generated
motion shows little of. On a character, the shape must be seen from the front.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from lipmotion.rig.face_shapes import FaceShapes
from lipmotion.rig.gestures import phone_weights
from lipmotion.rig.mouth_template import LEFT_CORNER, RIGHT_CORNER, mouth_template
from lipmotion.types import Timeline, Unit

Array = NDArray[np.float64]

ROUND = {
    **dict.fromkeys(("uw", "w"), 1.0),
    **dict.fromkeys(("ow", "uh"), 0.75),
    **dict.fromkeys(("ao", "oy", "sh", "zh", "ch", "jh"), 0.45),
    **dict.fromkeys(("r", "er", "axr"), 0.35),
}
"""How round the lips are in a phone; 0 in all others. Set by eye, as those of ``motion.gestures``."""
SMOOTH_S = 0.03
"""Lips round before the vowel that needs it, and stay so behind it: standard deviation of the smoothing, in seconds."""
PUCKER, FUNNEL = 0.7, 0.3
"""Least weights of ``mouthPucker`` and ``mouthFunnel`` in a phone of roundness 1."""
ENOUGH = 0.11
"""Less of both, where the mouth becomes narrower than this by them, in eye distances."""
LEAST_SHARE = 0.6
"""But not less than this part."""
SPREADING = tuple(
    f"{name}{side}" for name in ("mouthSmile", "mouthStretch", "mouthDimple") for side in ("Left", "Right")
)
"""Shapes that draw the corners apart: they vanish in round phones."""
NARROWER, FORWARD = 0.14, 0.09
"""Control points of lips come towards the middle by this part of their distance, and forward by this, in eye
distances, in a phone of roundness 1."""


def roundness(units: Timeline[Unit], time_s: Array) -> Array:
    """Return how round the phones want the lips at some times, evenly spaced, 0 to 1 [shape=(T,)]."""
    said = phone_weights(units, time_s, lambda phone: phone)
    total = np.zeros(len(time_s))
    for phone, curve in said.items():
        total += ROUND.get(phone, 0.0) * curve
    step = float(time_s[1] - time_s[0]) if len(time_s) > 1 else 1.0
    return np.clip(gaussian_filter1d(total, SMOOTH_S / step, mode="nearest"), 0.0, 1.0)


def rounded_weights(weights: Array, shapes: FaceShapes, roundness: Array) -> Array:
    """Return weights of blendshapes with the lips at least as round as the phones want them [shape=(T, S)].

    weights : as solved from the points [shape=(T, S)];  roundness : 0 to 1 [shape=(T,)]
    """
    result = weights.copy()
    template = mouth_template()
    right, left = template.row(RIGHT_CORNER), template.row(LEFT_CORNER)
    wanted = [(shapes.row(name), most) for name, most in (("mouthPucker", PUCKER), ("mouthFunnel", FUNNEL))]
    present = [(row, most) for row, most in wanted if row is not None]
    narrower = sum(most * float(shapes.moved[row, right, 0] - shapes.moved[row, left, 0]) for row, most in present)
    share = float(np.clip(ENOUGH / narrower, LEAST_SHARE, 1.0)) if narrower > 0 else 1.0
    for row, most in present:
        result[:, row] = np.maximum(result[:, row], share * most * roundness)
    rows = [row for row in map(shapes.row, SPREADING) if row is not None]
    result[:, rows] *= (1 - roundness)[:, None]
    return result


def rounded_displacements(displacements: Array, roundness: Array) -> Array:
    """Return displacements of the lip points with the lips rounded as the phones want them [shape=(T, 52, 3)].

    displacements : eye distances, head frame [shape=(T, 52, 3)];  roundness : 0 to 1 [shape=(T,)]
    """
    template = mouth_template()
    result = displacements.copy()
    lips = ~template.jaw
    result[:, lips, 0] -= NARROWER * np.outer(roundness, template.places[lips, 0])
    result[:, lips, 2] += FORWARD * roundness[:, None]
    return result
