"""MPEG-4 facial animation parameters of lips and jaw, from lip and jaw points.

Source: ISO/IEC 14496-2:2004, Annex C (facial animation parameters and their units).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.lip_points import mouth_template
from lipmotion.articulation.mouth import SpokenMouth
from lipmotion.meshes.fitting.point_motion import move_points
from lipmotion.meshes.model.face_shapes import FaceShapes
from lipmotion.types import Channel, Motion, Timeline, Unit

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


FAP = "fap"
"""The unit of these channels: whole steps of a 1024th of a distance in the face, of either sign."""
STEPS = 1024.0
MOUTH_TO_NOSE = 0.30
"""The distance from the nose to where the lips meet (MNS0) in a mean face, in eye distances; the width of the mouth
(MW0) is the template's."""
PARAMETERS = (
    # number, name, point, axis (x left, y up, z out), sign, unit (N: mouth to nose, W: width of the mouth)
    (3, "open_jaw", 152, 1, -1, "N"),
    (4, "lower_t_midlip", 13, 1, -1, "N"),
    (5, "raise_b_midlip", 14, 1, 1, "N"),
    (6, "stretch_l_cornerlip", 308, 0, 1, "W"),
    (7, "stretch_r_cornerlip", 78, 0, -1, "W"),
    (8, "lower_t_lip_lm", 311, 1, -1, "N"),
    (9, "lower_t_lip_rm", 81, 1, -1, "N"),
    (10, "raise_b_lip_lm", 402, 1, 1, "N"),
    (11, "raise_b_lip_rm", 178, 1, 1, "N"),
    (12, "raise_l_cornerlip", 308, 1, 1, "N"),
    (13, "raise_r_cornerlip", 78, 1, 1, "N"),
    (14, "thrust_jaw", 152, 2, 1, "N"),
    (15, "shift_jaw", 152, 0, -1, "W"),
    (16, "push_b_lip", 17, 2, 1, "N"),
    (17, "push_t_lip", 0, 2, 1, "N"),
    (51, "lower_t_midlip_o", 0, 1, -1, "N"),
    (52, "raise_b_midlip_o", 17, 1, 1, "N"),
    (53, "stretch_l_cornerlip_o", 291, 0, 1, "W"),
    (54, "stretch_r_cornerlip_o", 61, 0, -1, "W"),
    (55, "lower_t_lip_lm_o", 269, 1, -1, "N"),
    (56, "lower_t_lip_rm_o", 39, 1, -1, "N"),
    (57, "raise_b_lip_lm_o", 405, 1, 1, "N"),
    (58, "raise_b_lip_rm_o", 181, 1, 1, "N"),
    (59, "raise_l_cornerlip_o", 291, 1, 1, "N"),
    (60, "raise_r_cornerlip_o", 61, 1, 1, "N"),
)
"""The parameters of lips and jaw that points show; left and right are the speaker's own."""


def move_faps(motion: Motion, units: Timeline[Unit]) -> Motion:
    """Return the parameters over time: channels ``fap3_open_jaw``, ..., whole numbers; the rest pose is 0.

    Where the lips touch, ``lower_t_midlip`` and ``raise_b_midlip`` add up to 0.
    Raises InputError: as ``move_points``.
    """
    moved = move_points(motion, units).expressed
    template = mouth_template()
    lengths = {"N": MOUTH_TO_NOSE, "W": template.width}
    columns = [
        np.rint(sign * moved[:, template.row(point), axis] / lengths[unit] * STEPS)
        for _, _, point, axis, sign, unit in PARAMETERS
    ]
    channels = tuple(Channel(f"fap{number}_{name}", FAP) for number, name, *_ in PARAMETERS)
    return Motion(np.stack(columns, axis=1), motion.rate_hz, channels)
