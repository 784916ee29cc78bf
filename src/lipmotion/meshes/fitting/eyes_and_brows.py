"""Blinks, glances, brows, and what moods do to the upper face, as weights of ARKit's blendshapes, and back.

Motion of captures, of other programs and of edited files may have such weights itself, and angles of the head. They
take the place of what a face does by itself; moods are added to them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.liveliness import GAZE_COUNTER_SHARE, Liveliness, compute_liveliness
from lipmotion.meshes.fitting.blendshape_motion import arkit_weights
from lipmotion.meshes.model.mesh import ANGLES
from lipmotion.meshes.model.shape_names import ARKIT_OTHERS, SIDES
from lipmotion.types import Channel, Motion, Prosody, Timeline, Unit
from lipmotion.types.delivery import Staging
from lipmotion.types.motion import RADIAN, WEIGHT

Array = NDArray[np.float64]
FULL_LOOK_RAD = 0.55  # ARKit's blendshapes of looking turn the eyes so far at weight 1, in radians
FULL_BROW_RISE = 0.08  # brows are raised so far at weight 1, in eye distances
CHEEK_SQUINT = 0.6  # raised cheeks narrow the eyes by this part of their weight
OUTER_BROW_SHARE = 0.6  # the outer ends of the brows rise by this part of the weight of the inner ends
LOOKS = tuple(f"{way}{side}" for side in SIDES for way in ("Out", "In", "Up", "Down"))
"""The ways that ARKit's blendshapes turn each eye."""
LARGEST_COUNTER_RAD = 0.4  # the eyes turn at most so far against a head whose angles are given
MOVED_BY = {
    "blinks": ("eyeBlinkLeft", "eyeBlinkRight"),
    "gaze": tuple(f"eyeLook{name}" for name in LOOKS),
    "brows": tuple(name for name in ARKIT_OTHERS if name.startswith("brow")),
    "head": ANGLES,
}
"""What a face moves by itself, and the curves that take its place."""
GROUPS = (
    *MOVED_BY.values(),
    tuple(name for name in ARKIT_OTHERS if not name.startswith(("eyeBlink", "eyeLook", "brow"))),
)
"""Curves that are given together, or not at all; the last ones a face does not move by itself."""
GIVEN_UNITS = {4: "browDown", 5: "eyeWide", 6: "cheekSquint", 7: "eyeSquint", 9: "noseSneer", 15: "mouthFrown"}
"""The action units that blendshapes of both sides stand for."""
SPOKEN_SMILE, FULL_SMILE = 0.3, 0.75
"""Lips spread by speech smile up to the first weight; the corners rise from it to the second."""
CORNERS = tuple(f"{name}{side}" for name in ("mouthSmile", "mouthFrown") for side in SIDES)


def moves_by_itself(part: str, curves: Mapping[str, Array]) -> bool:
    """Return whether a face moves a part of ``MOVED_BY`` by itself, beside given movements."""
    return not {*MOVED_BY[part]} & {*curves}


def with_movements(moved: Liveliness, curves: Mapping[str, Array]) -> Liveliness:
    """Return movements of moods, and of what a face moves by itself, with those that are given."""
    if not curves:
        return moved
    none = np.zeros(len(moved.lids))

    def of_both(name: str) -> Array:
        return (curves.get(f"{name}Left", none) + curves.get(f"{name}Right", none)) / 2

    inner, outer = curves.get("browInnerUp", none), of_both("browOuterUp")
    raised = np.minimum(inner, outer / OUTER_BROW_SHARE)
    units = {1: inner - raised, 2: outer - OUTER_BROW_SHARE * raised}
    units |= {unit: of_both(name) for unit, name in GIVEN_UNITS.items()}
    units[12] = (of_both("mouthSmile") - SPOKEN_SMILE) / (FULL_SMILE - SPOKEN_SMILE)
    turn, gaze = moved.turn, moved.gaze
    if not moves_by_itself("head", curves):
        turn = np.stack([curves.get(name, none) for name in ANGLES], axis=1)
        gaze = gaze - np.clip(GAZE_COUNTER_SHARE * turn[:, :2], -LARGEST_COUNTER_RAD, LARGEST_COUNTER_RAD)
    if not moves_by_itself("gaze", curves):
        gaze = weights_to_gaze(curves)
    of_mood = eye_and_brow_weights(moved)
    added = {unit: np.clip(moved.unit(unit) + units.get(unit, 0), 0, 1) for unit in {*moved.units, *units}}
    return replace(
        moved,
        lids=np.clip(moved.lids + of_both("eyeBlink"), 0, 1),
        brows=moved.brows + FULL_BROW_RISE * raised,
        gaze=gaze,
        turn=turn,
        units={unit: curve for unit, curve in added.items() if unit in moved.units or curve.any()},
        given={
            name: curve if name.startswith("eyeLook") else np.clip(of_mood.get(name, 0) + curve, 0, 1)
            for name, curve in curves.items()
            if name in ARKIT_OTHERS
        },
    )


def weights_to_gaze(weights: Mapping[str, Array]) -> Array:
    """Return both eyes' mean direction, left and up, radians [shape=(F, 2)], by ARKit's weights [each shape=(F,)]."""
    looks = {name: weights[f"eyeLook{name}"] for name in LOOKS}
    across = looks["OutLeft"] - looks["InLeft"] + looks["InRight"] - looks["OutRight"]
    upwards = looks["UpLeft"] - looks["DownLeft"] + looks["UpRight"] - looks["DownRight"]
    return FULL_LOOK_RAD / 2 * np.stack([across, upwards], axis=1)


def gaze_to_weights(gaze: Array) -> dict[str, Array]:
    """Return ARKit's weights that turn the eyes [each shape=(F,)] to a gaze, left and up, in radians [shape=(F, 2)]."""
    across, upwards = gaze.T
    angles = np.stack([across, -across, upwards, -upwards, -across, across, upwards, -upwards])
    return dict(zip((f"eyeLook{name}" for name in LOOKS), np.clip(angles / FULL_LOOK_RAD, 0, 1), strict=True))


def eye_and_brow_weights(moved: Liveliness) -> dict[str, Array]:
    """Return the weights of ARKit's blendshapes of eyes and brows, 0 to 1 [each shape=(F,)]; given ones as they are."""
    gaze, raised = gaze_to_weights(moved.gaze), np.clip(moved.brows / FULL_BROW_RISE, 0, 1)
    moods: dict[str, Array] = {}  # of both sides alike
    if moved.units:
        moods = {name: moved.unit(number) for number, name in GIVEN_UNITS.items() if name != "mouthFrown"}
        moods["eyeSquint"] = np.maximum(moods["eyeSquint"], CHEEK_SQUINT * moved.unit(6))
    weights: dict[str, Array] = {}
    for side in SIDES:
        weights[f"eyeBlink{side}"] = np.clip(moved.lids, 0, 1)
        weights |= {name: curve for name, curve in gaze.items() if name.endswith(side)}
        weights[f"browOuterUp{side}"] = np.clip(OUTER_BROW_SHARE * raised + moved.unit(2), 0, 1)
        weights |= {f"{name}{side}": curve for name, curve in moods.items()}
    weights["browInnerUp"] = np.clip(raised + moved.unit(1), 0, 1)
    return weights | {**moved.given}


def compute_living_curves(
    motion: Motion,
    units: Timeline[Unit],
    staging: Staging | None = None,
    prosody: Prosody | None = None,
    frames: slice = slice(None),
) -> Motion:
    """Return blinks, gaze, brows and the head's angles at the frames of a motion, by ARKit's names.

    motion  : needs ``opening`` where the prosody is not known
    staging : seed, and what moves on its own; None: everything moves
    prosody : of the speech, for accents of brows and head; None: they follow the opening
    They are those of all faces with the same seed. Channels are blendshapes (weights), and ``ANGLES`` in radians.
    """
    liveliness = stage_liveliness(motion.time_s[frames], motion, units, staging, prosody)
    curves = eye_and_brow_weights(liveliness) | dict(zip(ANGLES, liveliness.turn.T, strict=True))
    channels = tuple(Channel(name, RADIAN if name in ANGLES else WEIGHT) for name in curves)
    return Motion(np.stack(list(curves.values()), axis=1), motion.rate_hz, channels)


def stage_liveliness(
    time_s: NDArray[np.float64],
    motion: Motion,
    units: Timeline[Unit],
    staging: Staging | None = None,
    prosody: Prosody | None = None,
) -> Liveliness:
    """Return what moves beside the mouth at some times, as a staging asks for it; None: everything moves.

    motion, units, prosody : as of ``articulation.liveliness``; blinks, gaze, brows and angles of the head that the
                             motion itself has take the place of what would move on its own. Groups of them that
                             never move do not count: exporters write curves that nothing was captured for as 0
    """
    chosen = staging or Staging()
    curves = {name: curve for name, curve in arkit_weights(motion).items() if name in (*ARKIT_OTHERS, *CORNERS)}
    curves |= {name: motion[name].astype(np.float64) for name in ANGLES if name in motion.names}
    for group in GROUPS:
        if any(curves[name].any() for name in group if name in curves):
            curves |= {name: np.zeros(len(motion.values)) for name in group if name not in curves}
        else:
            curves = {name: curve for name, curve in curves.items() if name not in group}
    curves = {name: np.interp(time_s, motion.time_s, curve) for name, curve in curves.items()}
    moving = {part: getattr(chosen, part) and moves_by_itself(part, curves) for part in MOVED_BY}
    return with_movements(compute_liveliness(time_s, motion, units, prosody, seed=chosen.seed, **moving), curves)
