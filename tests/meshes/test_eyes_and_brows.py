"""Eyes, brows, cheeks, nose and head that a motion has itself take the place of what a face does by itself."""

from __future__ import annotations

import numpy as np
import pytest

from lipmotion import Staging
from lipmotion.articulation.expression import with_moods
from lipmotion.articulation.liveliness import Liveliness
from lipmotion.meshes.fitting.blendshape_motion import with_mouth
from lipmotion.meshes.fitting.eyes_and_brows import MOVED_BY, eye_and_brow_weights
from lipmotion.meshes.model.mesh import ANGLES
from lipmotion.types import WEIGHT, Channel, Motion, Timeline
from lipmotion.types.moods import parse_moods
from lipmotion.types.motion import RADIAN
from lipmotion_faces.base import stage_liveliness
from lipmotion_faces.head.pose import head_poses

TIME_S = np.arange(60) / 30
TALK = Motion(0.1 * np.sin(9 * TIME_S)[:, None] ** 2, 30.0, (Channel("opening"),))


def moved(motion: Motion, seed: int = 0) -> Liveliness:
    return stage_liveliness(TIME_S, with_mouth(motion), Timeline(()), Staging(seed=seed))


def captured(curves: dict[str, object]) -> Motion:
    """Return motion of blendshapes, with the angles of the head that are given."""
    jaw = {"jawOpen": 0.3 * np.sin(9 * TIME_S) ** 2}
    columns = {name: np.broadcast_to(np.asarray(curve, float), TIME_S.shape) for name, curve in (jaw | curves).items()}
    channels = tuple(Channel(name, RADIAN if name in ANGLES else WEIGHT) for name in columns)
    return Motion(np.stack(list(columns.values()), axis=1), 30.0, channels)


@pytest.mark.parametrize("mood", ["", "afraid", "happy", "disgusted"])
def test_a_face_moves_as_in_the_file_of_its_own_curves(mood: str) -> None:
    played = moved(with_moods(TALK, parse_moods(mood)), seed=3)
    weights = eye_and_brow_weights(played)
    again = moved(captured(weights | dict(zip(ANGLES, played.turn.T, strict=True))), seed=4)
    for name, curve in eye_and_brow_weights(again).items():
        assert curve == pytest.approx(weights.get(name, 0), abs=1e-12), name
    for name in ("lids", "gaze", "turn"):
        assert getattr(again, name) == pytest.approx(getattr(played, name), abs=1e-12), name
    for unit in (4, 5, 6, 9):
        assert again.unit(unit) == pytest.approx(played.unit(unit), abs=1e-12), unit


def test_curves_that_never_move_leave_the_face_to_itself() -> None:
    nothing = {name: np.zeros(60) for names in MOVED_BY.values() for name in names}
    alone, beside = (moved(captured(curves)) for curves in ({}, nothing))
    for name in ("lids", "brows", "gaze", "turn"):
        assert getattr(alone, name).any(), name
        assert np.array_equal(getattr(alone, name), getattr(beside, name)), name
    blinks = moved(captured({**nothing, "eyeBlinkLeft": 0.4}))
    assert blinks.lids == pytest.approx(0.2)
    assert np.array_equal(blinks.turn, alone.turn)


def test_each_side_is_kept_and_a_mood_is_added() -> None:
    tired = with_moods(captured({"browDownLeft": 0.8, "browInnerUp": 0.3}), parse_moods("tired"))
    weights = eye_and_brow_weights(moved(tired))
    assert weights["browDownLeft"] == pytest.approx(0.8)
    assert weights["browInnerUp"] == pytest.approx(0.3 + 0.1)
    assert not weights["browDownRight"].any()


def test_eyes_hold_their_target_under_a_head_that_is_given() -> None:
    ahead, aside = (moved(captured({"headYaw": yaw})) for yaw in (1e-9, 0.3))
    assert aside.turn[:, 0] == pytest.approx(0.3)
    assert (aside.gaze - ahead.gaze)[:, 0] == pytest.approx(-0.85 * 0.3, abs=1e-6)


def test_the_3d_head_shows_what_was_captured() -> None:
    curves = {f"{name}{side}": 0.9 for name in ("eyeBlink", "cheekSquint", "mouthSmile") for side in ("Left", "Right")}
    pose = head_poses(with_mouth(captured({**curves, "headRoll": 0.2, "noseSneerLeft": 1.0})), Timeline(()), 30.0)[30]
    assert (pose.shut, pose.mood.cheek, pose.mood.sneer, pose.turn[2]) == pytest.approx((0.9, 0.9, 0.5, 0.2))
    assert pose.smile > 0.04
