from __future__ import annotations

import numpy as np
import pytest

from lipmotion.errors import ModelFormatError
from lipmotion.motion.closure import Closure
from lipmotion.motion.limits import MotionLimits, check_poses, check_rest, check_spread, measure_limits
from lipmotion.motion.space import MotionSpace
from lipmotion.stats.pca import Pca
from lipmotion.types import GREY, WEIGHT, Channel

POSES = np.array([[0.0, 0.5], [0.3, 0.6], [0.1, 0.55]])
REACH = measure_limits(POSES)
CLOSURE = Closure(0, 0.02, np.array([1.0, 0.2]))


def space(*units: str) -> MotionSpace:
    channels = tuple(Channel(name, unit) for name, unit in zip(("opening", "width"), units, strict=True))
    return MotionSpace(channels, np.arange(2), None)


FACE = space("eye_distance", "eye_distance")


def test_reach_is_what_poses_span() -> None:
    assert (REACH.low.tolist(), REACH.high.tolist()) == ([0.0, 0.5], [0.3, 0.6])
    wide = REACH.extend(np.array([0.1, 0.01]))
    assert wide.low == pytest.approx([-0.3, 0.47])
    assert wide.high == pytest.approx([0.6, 0.63])


def test_motion_near_the_poses_is_let_be() -> None:
    REACH.check(np.array([[-0.5, 0.2], [2.0, 1.5]]), CLOSURE, {})


@pytest.mark.parametrize("value", [7.0, -7.0, 1e38, np.nan, np.inf])
@pytest.mark.parametrize("column", [0, 1])
def test_motion_far_from_all_poses(value: float, column: int) -> None:
    values = np.tile(REACH.low, (3, 1))
    values[1, column] = value
    with pytest.raises(ModelFormatError, match=r"the motion would go from .* the model is damaged; train or download"):
        REACH.check(values, CLOSURE, {})


def test_pins_lead_farther_and_what_follows_the_opening_with_them() -> None:
    values = np.array([[0.0, 0.5], [200.0, 40.0]])
    REACH.check(values, CLOSURE, {(1, 0): 200.0})
    with pytest.raises(ModelFormatError):
        REACH.check(values, None, {(1, 0): 200.0})


def test_dimensions_that_do_not_move() -> None:
    still = measure_limits(np.full((3, 2), 0.5))
    still.check(np.full((4, 2), 0.501), None, {})
    check_rest(np.full(2, 0.5), still)


def test_poses_of_no_face() -> None:
    for low, high, closed in (
        ([-40.0, 0.5], [60.0, 0.6], 0.0),
        ([90.0, 0.5], [91.0, 0.6], 0.0),
        ([-60.0, 0.5], [0.0, 0.6], 0.0),
        ([0.0, 0.5], [0.3, 0.6], 20.0),
        ([0.0, 0.5], [0.3, 1e5], 0.0),
    ):
        with pytest.raises(ValueError, match=r"opening|width"):
            check_poses(MotionLimits(np.array(low), np.array(high)), FACE, Closure(0, closed, np.zeros(2)))


def test_each_unit_has_its_largest_value() -> None:
    for unit, largest in ((WEIGHT, 255), (GREY, 1e5), ("mm", 1e6)):
        high = np.array([largest, 0.6])
        check_poses(MotionLimits(REACH.low, high), space(unit, unit), None)
        with pytest.raises(ValueError, match="'opening' goes from 0 to"):
            check_poses(MotionLimits(REACH.low, high * 1.01), space(unit, unit), None)


def test_points_far_from_the_face() -> None:
    channels = (Channel("x_1"), Channel("y_1"))
    points = MotionSpace(channels, np.array([], int), Pca(np.array([0.3, -1.2]), np.eye(2)))
    check_poses(REACH, points, None)
    far = MotionSpace(channels, np.array([], int), Pca(np.array([300.0, -1200.0]), np.eye(2)))
    with pytest.raises(ValueError, match=r"points_mean as large as 1200 of points that move by 0.3"):
        check_poses(REACH, far, None)


def test_rest_is_near_the_poses() -> None:
    check_rest(np.array([0.0, 0.45]), REACH)
    with pytest.raises(ValueError, match=r"rest pose of 550 in dimension 1, whose poses are 0.5 to 0.6"):
        check_rest(np.array([0.0, 550.0]), REACH)


def test_poses_lie_as_far_apart_as_their_deviations_let_them() -> None:
    variances = np.full(POSES.shape, 0.01**2)
    check_spread(POSES, variances)
    with pytest.raises(ValueError, match=r"means that span \d+ of their deviations, required at most 1000"):
        check_spread(POSES * 1000, variances)
