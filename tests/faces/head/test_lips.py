import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion_faces.head.inside import LOWER_EDGE, lower_drop, lower_teeth, upper_teeth
from lipmotion_faces.head.pose import CharacterPose
from lipmotion_faces.head.skin import (
    ARCH,
    COLUMNS,
    TEETH_EDGE,
    TEETH_Z,
    VISIBLE_RINGS,
    lip_surface,
    move_jaw,
    section_points,
)
from lipmotion_faces.head.stage import figure

MEET, FRONT = 4, 15
"""The point of the cross-section where the lips meet, and the rings before the wall of the mouth."""
PAIRS = [(k, COLUMNS - k) for k in range(1, 40)]
"""Columns of the upper lip, and the column of the lower lip at the same place."""
SHARES = st.floats(0, 1)


@st.composite
def poses(draw) -> CharacterPose:
    gap = draw(st.floats(0, 0.3))
    roundness = draw(SHARES)
    return CharacterPose(
        gap=gap, upper_rise=gap * draw(st.floats(0.15, 0.5)), jaw=0.85 * gap, width=draw(st.floats(0.65, 1.25)),
        fullness=draw(st.floats(0.75, 1.25)), roundness=roundness, spread=draw(SHARES) * (1 - roundness),
        protrusion=(0.08 + 0.035 * draw(SHARES)) * roundness, bite=draw(SHARES), oval=draw(SHARES),
    )  # fmt: skip


def contact(pose: CharacterPose) -> np.ndarray:
    """Return where each column of the lips would meet the other lip [shape=(COLUMNS, 3)]."""
    return section_points(pose, figure().skin.base_z)[MEET]


def test_closed_lips_meet_at_every_column():
    rounded = {"roundness": 1, "protrusion": 0.08, "width": 0.7}, {"roundness": 0.6, "press": 0.7, "protrusion": 0.05}
    wide = {"width": 1.2}, {"width": 1.1, "spread": 1}, {"width": 0.9, "oval": 1}
    for gestures in ({}, {"press": 1}, *rounded, *wide):
        places = contact(CharacterPose(**gestures))
        for upper, lower in PAIRS:
            assert places[upper] == pytest.approx(places[lower], abs=1e-12)


@given(poses())
@settings(max_examples=20)
def test_the_gap_is_as_asked_and_lips_never_cross(pose):
    places = contact(pose)
    assert places[20, 1] - places[60, 1] == pytest.approx(pose.gap, abs=1e-9)
    assert min(places[upper, 1] - places[lower, 1] for upper, lower in PAIRS) > -1e-9


@given(poses())
@settings(max_examples=10)
def test_both_halves_of_the_mouth_are_alike(pose):
    surface = lip_surface(section_points(pose, figure().skin.base_z))[:FRONT]
    mirrored = np.concatenate([np.arange(40, -1, -1), np.arange(COLUMNS - 1, 40, -1)])
    assert surface[:, mirrored] * [-1, 1, 1] == pytest.approx(surface, abs=2e-3)


@given(poses(), SHARES, SHARES)
@settings(max_examples=30)
def test_lips_never_reach_into_the_teeth(pose, tuck, press):
    """What is above the edge of the upper teeth is before them; what is below the lower edge is before those."""
    moved = pose._replace(
        tuck=tuck, upper_rise=max(pose.upper_rise, 0.054 * tuck), gap=max(pose.gap, 0.054 * tuck), press=press
    )
    lips = lip_surface(section_points(moved, figure().skin.base_z))[:FRONT].reshape(-1, 3)
    teeth = TEETH_Z - ARCH * lips[:, 0] ** 2
    beside = (lips[:, 1] > TEETH_EDGE) & (np.abs(lips[:, 0]) < 0.24)
    assert (lips[beside, 2] - teeth[beside]).min() > 0.003
    edge = move_jaw(np.array([[0, LOWER_EDGE, TEETH_Z - 0.045]]), lower_drop(moved))[0]
    below = (lips[:, 1] < edge[1]) & (np.abs(lips[:, 0]) < 0.2)
    if below.any():
        assert (lips[below, 2] - (edge[2] - ARCH * lips[below, 0] ** 2)).min() > 0.003


def test_the_model_of_the_teeth_in_these_tests_is_that_of_the_teeth():
    for part, front in ((upper_teeth(), TEETH_Z), (lower_teeth(), TEETH_Z - 0.045)):
        near = np.abs(part.places[:, 0]) < 0.24
        before = part.places[near, 2] - (front - ARCH * part.places[near, 0] ** 2)
        assert before.max() < 0.012


def test_lower_teeth_close_behind_the_upper_ones():
    shut = move_jaw(lower_teeth().places, lower_drop(CharacterPose(bite=1)))
    assert shut[:, 1].max() > TEETH_EDGE
    apart = move_jaw(lower_teeth().places, lower_drop(CharacterPose(gap=0.2, jaw=0.15)))
    assert apart[:, 1].max() < TEETH_EDGE - 0.1


def test_round_lips_have_a_narrower_hole_and_lie_further_forward():
    """The hole is where the lips are at least a hundredth of an eye distance apart."""

    def hole(pose: CharacterPose) -> tuple[float, float]:
        places = contact(pose)
        apart = [places[a, 1] - places[b, 1] > 0.01 for a, b in PAIRS]
        inside = places[[a for (a, _), is_apart in zip(PAIRS, apart, strict=True) if is_apart], 0]
        return float(np.ptp(inside)), float(places[20, 2])

    flat, flat_z = hole(CharacterPose(gap=0.07, upper_rise=0.02))
    round_, round_z = hole(CharacterPose(gap=0.07, upper_rise=0.03, roundness=1, protrusion=0.085, width=0.8))
    assert round_ < 0.5 * flat
    assert round_z > flat_z + 0.06


def test_the_lower_lip_of_f_lies_on_the_upper_teeth():
    pose = CharacterPose(gap=0.05, upper_rise=0.036, tuck=1)
    lower = contact(pose)[60]
    assert 0.015 < lower[1] - TEETH_EDGE < 0.035
    assert 0 < lower[2] - TEETH_Z < 0.035
    assert contact(CharacterPose(gap=0.05, upper_rise=0.036))[60][2] > lower[2] + 0.02


def test_pressed_lips_are_thinner():
    contours = (section_points(CharacterPose(press=press), figure().skin.base_z)[0] for press in (0, 1))
    free, pressed = (contour[20, 1] - contour[60, 1] for contour in contours)
    assert pressed == pytest.approx(0.65 * free, rel=0.05)


def test_the_line_of_closed_lips_rises_to_the_corners_less_when_pressed_and_that_of_round_ones_is_level():
    pressed = (0.011, 0.03)
    for pose, (least, most) in (
        (CharacterPose(), (0.035, 0.055)),
        (CharacterPose(press=1), pressed),
        (CharacterPose(width=1.1, press=1), pressed),
    ):
        height = contact(pose)[20:41, 1]
        assert np.diff(height).min() > 0
        assert least < height[-1] - height[0] < most
    assert np.ptp(contact(CharacterPose(roundness=1, protrusion=0.08, width=0.8))[:, 1]) < 0.005


def test_a_round_hole_is_an_ellipse_that_nothing_behind_it_narrows():
    for gap in (0.028, 0.04, 0.06, 0.1):
        pose = CharacterPose(gap=gap, upper_rise=0.48 * gap, width=0.75, roundness=1, protrusion=0.08)
        surface = lip_surface(section_points(pose, figure().skin.base_z))
        rim = surface[VISIBLE_RINGS - 1]
        line = np.interp(np.abs(rim[:, 0]), rim[20:41, 0], 0.5 * (rim[20:41, 1] + rim[60 - np.arange(21), 1]))
        half_width, half_height = rim[:, 0].max(), 0.5 * (rim[20, 1] - rim[60, 1])
        away = np.hypot(rim[:, 0] / half_width, (rim[:, 1] - line) / half_height)
        assert np.abs(away - 1).max() < 0.06
        behind = surface[VISIBLE_RINGS : VISIBLE_RINGS + 4]
        assert behind[:, :, 0].max(axis=1).min() >= half_width - 1e-9
