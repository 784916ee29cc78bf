"""Round lips: what the phones say of them, beyond the speaker's own range of width.

Speakers whose lips hardly narrow in OO and W are still understood, for their lips come forward, which the generated
motion shows little of. On a character, the shape must be seen from the front.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.lip_points import LEFT_CORNER, RIGHT_CORNER, mouth_template
from lipmotion.meshes.model.face_shapes import FaceShapes

Array = NDArray[np.float64]

PUCKER, FUNNEL = 0.5, 0.3
"""Least weights of ``mouthPucker`` and ``mouthFunnel`` in a phone of roundness 1."""
NARROWING = 0.11
"""Both together make the mouth narrower by this, in eye distances; there is less, or more, of them for it."""
SHARES = (0.6, 1.4)
"""The least and the largest share of them that there is then."""
SPREADING = tuple(
    f"{name}{side}" for name in ("mouthSmile", "mouthStretch", "mouthDimple") for side in ("Left", "Right")
)
"""Shapes that draw the corners apart: they vanish in round phones."""


def rounded_weights(weights: Array, shapes: FaceShapes, protrusion: Array) -> Array:
    """Return weights of blendshapes with lips at least as round as they are protruded [shape=(T, S)].

    weights : as solved from the points [shape=(T, S)];  protrusion : 0 to 1 [shape=(T,)]
    """
    result = weights.copy()
    template = mouth_template()
    right, left = template.row(RIGHT_CORNER), template.row(LEFT_CORNER)
    wanted = [(shapes.row(name), most) for name, most in (("mouthPucker", PUCKER), ("mouthFunnel", FUNNEL))]
    present = [(row, most) for row, most in wanted if row is not None]
    narrower = sum(most * float(shapes.moved[row, right, 0] - shapes.moved[row, left, 0]) for row, most in present)
    share = float(np.clip(NARROWING / narrower, *SHARES)) if narrower > 0 else 1.0
    for row, most in present:
        result[:, row] = np.maximum(result[:, row], share * most * protrusion)
    rows = [row for row in map(shapes.row, SPREADING) if row is not None]
    result[:, rows] *= (1 - protrusion)[:, None]
    return result
