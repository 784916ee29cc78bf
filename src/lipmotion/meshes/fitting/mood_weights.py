"""What moods do to the mouth of a character: weights of ARKit's blendshapes, or of whole expressions."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.mouth import SpokenMouth
from lipmotion.meshes.model.face_shapes import FaceShapes

Array = NDArray[np.float64]

SIDED_SHAPES = {
    "mouthSmile": ("smile", 0.75),
    "mouthFrown": ("frown", 0.9),
    "mouthStretch": ("stretched", 0.7),
    "mouthUpperUp": ("upper_raise", 0.6),
    "mouthPress": ("tight", 0.5),
}
"""By blendshapes of both sides: the curve of the spoken mouth that they show, and their weight where it is 1."""
MIDDLE_SHAPES = {"mouthShrugLower": ("chin_raise", 0.5), "mouthRollUpper": ("tight", 0.15)}
"""The same of blendshapes that have no sides."""
MOOD_SHAPES = {f"{name}{side}": row for name, row in SIDED_SHAPES.items() for side in ("Left", "Right")} | MIDDLE_SHAPES
EXPRESSIONS: Mapping[str, tuple[tuple[str, float], ...]] = {
    "happy": (("happy", 1.0),),
    "sad": (("sad", 1.0),),
    "angry": (("angry", 1.0),),
    "surprised": (("surprised", 1.0),),
    "afraid": (("surprised", 0.5), ("sad", 0.5)),
    "disgusted": (("angry", 0.6), ("sad", 0.3)),
    "tense": (("angry", 0.4),),
    "tired": (("sad", 0.3), ("relaxed", 0.4)),
}
"""The expressions of VRM that stand for a mood, with their weights, on characters without finer shapes."""


def mood_weights(mouth: SpokenMouth, shapes: FaceShapes) -> Array | None:
    """Return the weights of ARKit's blendshapes of the mouth in a mood, 0 to 1 [shape=(T, S)]; None: in none.

    They leave the lips as free as the phones need (``articulation.mouth``); the distance between the lips is set
    afterwards (``shape_weights.with_gap``).
    """
    asked = [(shapes.row(name), most * getattr(mouth, curve)) for name, (curve, most) in MOOD_SHAPES.items()]
    moving = [(row, curve) for row, curve in asked if row is not None and curve.any()]
    if not moving:
        return None
    weights = np.zeros((len(mouth.gap), len(shapes.names)))
    for row, curve in moving:
        weights[:, row] = curve
    return weights


def expression_weights(moods: Mapping[str, Array]) -> dict[str, Array]:
    """Return the weights of VRM's expressions, 0 to 1, by their names [each shape=(T,)].

    moods : how strong each mood is, 0 to 1 [each shape=(T,)]
    """
    found: dict[str, Array] = {}
    for mood, strength in moods.items():
        for name, most in EXPRESSIONS[mood]:
            found[name] = np.clip(found.get(name, 0.0) + most * strength, 0, 1)
    return found
