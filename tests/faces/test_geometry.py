import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.faces.portrait.geometry import HALF_WIDTH, LINE_Y, TEETH_EDGE, lip_outlines, mouth_interior, roundness
from lipmotion.faces.portrait.pose import TUCKED_GAP, WIDEST, MouthPose, jaw_drop

X = np.linspace(-0.5, 0.5, 1001)
MIDDLE = 500


def pose(gap: float, width: float = 1.0, fullness: float = 1.0, tuck: float = 0.0, tip: float = 0.0) -> MouthPose:
    return MouthPose(gap, width, fullness, float(jaw_drop(gap)), tuck, tip)


poses = st.builds(
    pose,
    gap=st.floats(0, WIDEST),
    width=st.floats(0.7, 1.3),
    fullness=st.floats(0.75, 1.25),
    tuck=st.floats(0, 1),
    tip=st.floats(0, 1),
)


@settings(max_examples=200, deadline=None)
@given(poses)
def test_outlines_never_cross(drawn):
    shape = lip_outlines(drawn, X)
    within = mouth_interior(drawn, X, shape)
    for upper, lower in [
        (shape.upper_outer, shape.upper_inner),
        (shape.upper_inner, shape.lower_inner),
        (shape.lower_inner, shape.lower_outer),
        (shape.upper_inner, within.teeth_upper),
        (within.teeth_upper, shape.lower_inner),
        (shape.upper_inner, within.teeth_lower),
        (within.teeth_lower, shape.lower_inner),
        (shape.upper_inner, within.tongue_top),
        (within.tongue_top, within.tongue_bottom),
        (within.tongue_bottom, shape.lower_inner),
    ]:
        assert (upper <= lower + 1e-9).all()


@settings(max_examples=200, deadline=None)
@given(poses)
def test_the_gap_is_exact_and_lips_have_body_all_around_it(drawn):
    shape = lip_outlines(drawn, X)
    gap = shape.lower_inner - shape.upper_inner
    assert gap[MIDDLE] == pytest.approx(drawn.gap, abs=1e-6)
    assert gap.max() <= drawn.gap + 1e-6
    parted = gap > 1e-6
    assert (shape.upper_inner - shape.upper_outer)[parted].min(initial=1) > 0.004
    assert (shape.lower_outer - shape.lower_inner)[parted].min(initial=1) > 0.004


@settings(max_examples=100, deadline=None)
@given(poses)
def test_the_mouth_ends_at_its_corners_and_is_symmetric(drawn):
    shape = lip_outlines(drawn, X)
    outside = np.abs(X) >= HALF_WIDTH * drawn.width
    assert np.ptp(shape.upper_outer[outside]) < 1e-6
    assert (shape.lower_outer - shape.upper_outer)[outside].max() < 1e-6
    assert shape.upper_outer[outside][0] == pytest.approx(shape.corner_y, abs=1e-6)
    assert not shape.seam[outside].any()
    assert shape.lower_outer == pytest.approx(shape.lower_outer[::-1])
    assert 0.6 < shape.upper_outer.min() < shape.lower_outer.max() < 1.5


def test_closed_lips_touch_along_the_whole_mouth():
    shape = lip_outlines(pose(0), X)
    assert (shape.upper_inner == shape.lower_inner).all()
    assert shape.seam[MIDDLE] > 0


def test_upper_teeth_stay_with_the_skull_and_lower_teeth_go_with_the_jaw():
    for gap in (0.08, 0.15, 0.3):
        drawn = pose(gap)
        within = mouth_interior(drawn, X, lip_outlines(drawn, X))
        assert within.teeth_upper[MIDDLE] == pytest.approx(LINE_Y + TEETH_EDGE)
        assert within.teeth_lower[MIDDLE] == pytest.approx(LINE_Y + 0.01 + drawn.jaw)


@pytest.mark.parametrize("gap", TUCKED_GAP)
def test_tucked_the_lower_lip_touches_the_upper_teeth(gap):
    drawn = pose(gap, tuck=1)
    shape = lip_outlines(drawn, X)
    near = np.abs(X) < 0.05
    assert (mouth_interior(drawn, X, shape).teeth_upper[near] == shape.lower_inner[near]).all()
    assert shape.lower_inner[MIDDLE] > lip_outlines(pose(0), X).lower_inner[MIDDLE]


def test_the_raised_tongue_reaches_the_upper_teeth():
    for gap in (0.07, 0.1, 0.2):
        low, high = pose(gap), pose(gap, tip=1)
        below = mouth_interior(low, X, lip_outlines(low, X)).tongue_top[MIDDLE]
        raised = mouth_interior(high, X, lip_outlines(high, X))
        assert raised.tongue_top[MIDDLE] < below
        assert 0 < raised.teeth_upper[MIDDLE] - raised.tongue_top[MIDDLE] < 0.02


def test_rounded_lips_part_over_a_smaller_share_of_the_mouth():
    def share(width: float) -> float:
        shape = lip_outlines(pose(0.06, width=width), X)
        return float(np.mean(shape.lower_inner - shape.upper_inner > 1e-6)) / width

    assert roundness(pose(0, width=1)) == 0
    assert roundness(pose(0, width=0.7)) == pytest.approx(1)
    assert share(0.7) < 0.8 * share(1.0)
