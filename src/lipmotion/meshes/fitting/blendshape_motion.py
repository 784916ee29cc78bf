"""Motion of blendshapes as motion of a mouth: distances, points and articulatory channels that follow from weights.

Models that were trained on blendshapes, captures and edited curves have channels such as ``jawOpen`` and no
``opening``. The mouth of ``reference_mouth`` has ARKit's blendshapes; moved by the weights, it has the distances and
points that faces draw.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.contact import GAP, LEAST_GAP, opening_of
from lipmotion.articulation.lip_points import LEFT_CORNER, LOWER_EDGE, RIGHT_CORNER, UPPER_EDGE, mouth_template
from lipmotion.meshes.fitting.reference_mouth import arkit_mouth
from lipmotion.meshes.model.face_shapes import FaceShapes
from lipmotion.meshes.model.other_shapes import OPENS, as_arkit
from lipmotion.meshes.model.shape_names import arkit_name
from lipmotion.types import EYE_DISTANCE, WEIGHT, Channel, Motion

Array = NDArray[np.float64]

MIN_OPENING = 0.05
"""A blendshape that parts the lips by more, in eye distances, opens the mouth."""
ARTICULATORY = {
    "tongue": (("tongueOut", 3.0),),
    "lip_tuck": (("mouthRollLower", 1.8),),
    "protrusion": (("mouthPucker", 1.2), ("mouthFunnel", 0.9)),
    "spread": (
        ("mouthSmileLeft", 0.7),
        ("mouthSmileRight", 0.7),
        ("mouthStretchLeft", 0.7),
        ("mouthStretchRight", 0.7),
    ),
    "lip_press": (("mouthPressLeft", 2.0), ("mouthPressRight", 2.0)),
}
"""What blendshapes say of the articulatory channels (docs/articulation.md): their weights, times these, added up."""


def is_of_blendshapes(motion: Motion) -> bool:
    """Return whether motion has blendshapes that open the mouth, and no channel ``opening``."""
    return "opening" not in motion.names and OPENS in arkit_weights(motion)


def with_mouth(motion: Motion) -> Motion:
    """Return motion of blendshapes with the channels that faces draw after its own; other motion as it is.

    Added are ``lip_gap``, the ``opening`` that trackers would measure, ``width``, ``outer``, the lip and jaw points,
    and the articulatory channels that blendshapes show. Weights that are not between 0 and 1 count as 0 or 1.
    """
    if not is_of_blendshapes(motion):
        return motion
    weights, mouth, template = arkit_weights(motion), arkit_mouth(), mouth_template()
    rows = np.stack([weights.get(name, np.zeros(len(motion.values))) for name in mouth.known], axis=1)
    jaw, close = mouth.known.index(OPENS), mouth.known.index("mouthClose")
    rows[:, close] = np.minimum(rows[:, close], rows[:, jaw])
    places = template.places + (rows @ mouth.moved.reshape(len(mouth.known), -1)).reshape(-1, *template.places.shape)
    gap = np.maximum(rows @ mouth.gap, 0.0)
    gap[gap < LEAST_GAP / 2] = 0.0
    distances = {
        "opening": opening_of(gap),
        GAP: gap,
        "width": _apart(places, LEFT_CORNER, RIGHT_CORNER),
        "outer": _apart(places, UPPER_EDGE, LOWER_EDGE),
    }
    points = {
        f"{axis}_{point}": places[:, row, column]
        for row, point in enumerate(template.points)
        for column, axis in enumerate("xyz")
    }
    said = {
        name: np.clip(sum(gain * weights[source] for source, gain in sources if source in weights), 0, 1)
        for name, sources in ARTICULATORY.items()
        if any(source in weights for source, _ in sources)
    }
    added = {name: (curve, EYE_DISTANCE) for name, curve in (distances | points).items()}
    added |= {name: (curve, WEIGHT) for name, curve in said.items()}
    added = {name: each for name, each in added.items() if name not in motion.names}
    values = np.concatenate([motion.values, np.stack([curve for curve, _ in added.values()], axis=1)], axis=1)
    channels = (*motion.channels, *(Channel(name, unit) for name, (_, unit) in added.items()))
    return Motion(values, motion.rate_hz, channels)


def arkit_weights(motion: Motion) -> dict[str, Array]:
    """Return the curves of a motion that are blendshapes, by ARKit's names, 0 to 1 [each shape=(T,)].

    Names are understood as files spell them; of two spellings of one, the first. Blendshapes of other sets are
    converted (``other_shapes``).
    """
    found: dict[str, Array] = {}
    for name in motion.names:
        known = arkit_name(name)
        if known is not None:
            found.setdefault(known, np.clip(motion[name].astype(np.float64), 0, 1))
    if OPENS not in found:
        found |= {name: np.clip(curve, 0, 1) for name, curve in as_arkit(motion).items()}
    return found


def given_weights(motion: Motion, shapes: FaceShapes) -> Motion | None:
    """Return the weights that a motion has for the blendshapes of a mesh, by the mesh's names; None: it has none.

    A blendshape is found by its own name, or else by ARKit's; at least one of those that are found must open the mouth.
    Blendshapes that the motion does not have stay 0.
    """
    by_name = {name: np.clip(motion[name].astype(np.float64), 0, 1) for name in shapes.names if name in motion.names}
    by_known = arkit_weights(motion)
    curves = [by_name.get(name, by_known.get(known)) for name, known in zip(shapes.names, shapes.known, strict=True)]
    if not any(curve is not None and gap > MIN_OPENING for curve, gap in zip(curves, shapes.gap, strict=True)):
        return None
    nothing = np.zeros(len(motion.values))
    values = np.stack([nothing if curve is None else curve for curve in curves], axis=1)
    return Motion(values, motion.rate_hz, tuple(Channel(name, WEIGHT) for name in shapes.names))


def _apart(places: Array, one: int, other: int) -> Array:
    """Return the distance of two points in the picture [shape=(T,)]."""
    template = mouth_template()
    return np.linalg.norm(places[:, template.row(one), :2] - places[:, template.row(other), :2], axis=1)
