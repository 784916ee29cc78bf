from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.articulation import contact, mouth
from lipmotion.articulation.liveliness import UpperFace
from lipmotion.errors import InputError
from lipmotion.types import Channel, Motion, Timeline, Unit
from lipmotion_faces import FACES, Staging, stage_face, testing
from lipmotion_faces.portrait import characters, layer
from lipmotion_faces.portrait.characters import CARTOON, MAN, WOMAN
from lipmotion_faces.portrait.geometry import (
    NECK_END,
    NECK_TOP,
    PIVOT_Y,
    HeadField,
    HeadPlacement,
    MouthPose,
    list_grid,
    outline_interior,
    outline_lips,
)
from lipmotion_faces.portrait.portrait_rasteriser import FacePose, Rasteriser

NOTHING_SAID: Timeline[Unit] = Timeline(())
DRAWN = ("woman", "man", "cartoon")
STILL = {"blinks": False, "gaze": False, "brows": False, "head": False}


def opening(*values: float, rate_hz: float = 25.0) -> Motion:
    return Motion(np.array(values)[:, None], rate_hz, (Channel("opening"),))


def frames(motion, units=NOTHING_SAID, face="woman", fps=25.0, **staging):
    return list(stage_face(face, Staging(**staging)).render(motion, units, fps=fps))


def hole(frame: np.ndarray) -> int:
    """Return the number of pixels between the lips that are as dark as the inside of a mouth."""
    area = layer.View(len(frame)).cut_window(-0.25, 0.75, 0.25, 1.3).area
    return int((frame[area].sum(axis=2) < 200).sum())


@pytest.mark.parametrize("name", [name for name in FACES.names if name in (*DRAWN, "portrait")])
def test_characters_keep_the_contract(name):
    testing.check_face(stage_face(name, Staging(size=96)))


@pytest.mark.parametrize("face", DRAWN)
def test_the_mouth_is_dark_inside_only_when_open_and_only_mouth_and_jaw_move_with_it(face):
    closed, small, wide = frames(opening(0, 0.08, 0.3), face=face, size=360, **STILL)
    assert 1.5 * hole(closed) < hole(small) < hole(wide)
    assert face == "cartoon" or hole(closed) < 10  # the cartoon's lips meet in a dark line
    rows = np.flatnonzero((np.abs(closed.astype(int) - wide) > 2).any(axis=(1, 2)))
    view = layer.View(360)
    y = (rows - view.origin[1]) / view.scale
    assert 0.35 < y.min() < 0.8
    assert 1.4 < y.max() < 2.0


def test_eyes_blink_and_nothing_else_moves():
    drawn = np.array(frames(opening(*np.zeros(250)), size=96, **{**STILL, "blinks": True}))
    changing = (drawn != drawn[0]).any(axis=(1, 2, 3))
    assert 4 <= changing.sum() <= 60
    rows = np.flatnonzero((drawn != drawn[0]).any(axis=(0, 2, 3)))
    view = layer.View(96)
    assert view.origin[1] - 0.25 * view.scale < rows.min() < rows.max() < view.origin[1] + 0.25 * view.scale


def test_each_part_moves_where_it_is_on_and_nothing_where_all_is_still():
    drawn = frames(opening(*np.zeros(50)), size=96, **STILL)
    assert all(np.array_equal(frame, drawn[0]) for frame in drawn)
    for part in ("gaze", "brows", "head"):
        drawn = frames(opening(*np.tile([0.0, 0.2], 40)), size=64, **{**STILL, part: True})
        assert any(np.any(frame != drawn[0]) for frame in drawn[2::2])


@pytest.mark.parametrize("face", DRAWN)
def test_a_transparent_background_shows_through_around_the_figure_only(face):
    (frame,) = frames(opening(0), face=face, size=128, background="transparent")
    assert frame.shape == (128, 128, 4)
    assert frame[0, 0, 3] == frame[0, -1, 3] == 0
    assert frame[64, 64, 3] == 255
    assert 0.2 < (frame[..., 3] == 0).mean() < 0.7
    (red,) = frames(opening(0), face=face, size=128, background="#ff0000")
    cover = frame[..., 3:] / 255
    over = frame[..., :3] * cover + np.array([255, 0, 0]) * (1 - cover)
    assert np.abs(over - red).max() < 4
    assert red[0, 0].tolist() == [255, 0, 0]


def test_unusable_settings_and_motions_are_refused():
    unusable: dict[str, tuple[Any, ...]] = {"size": (62, 129, 5000), "background": ("blue", "#12345")}
    for name, values in unusable.items():
        for value in values:
            with pytest.raises(InputError, match="required"):
                Staging(**{name: value})
    with pytest.raises(InputError, match="no channel 'opening'"):
        stage_face("woman", Staging()).render(Motion(np.zeros((3, 1)), 25.0, (Channel("width"),)), NOTHING_SAID)


def test_columns_and_rows_are_those_of_the_pixel_centres():
    view = layer.View(80)
    whole = view.cut_window(-9, -9, 9, 9)
    for columns in (whole.list_columns(), whole.list_columns(4)):
        assert columns == pytest.approx(-columns[::-1], abs=1e-6)  # the point between the eyes is in the middle
    assert np.diff(whole.list_columns()) == pytest.approx(1 / view.scale, rel=1e-4)
    assert whole.list_rows()[32] == pytest.approx(0.5 / view.scale)
    part = view.cut_window(-0.5, 0.2, 0.5, 0.6)
    assert part.list_columns() == pytest.approx(whole.list_columns()[part.x0 : part.x1])


def test_a_head_that_rolls_is_turned_about_its_neck():
    """Each place moves at right angles to its distance from the pivot, and clockwise; below the neck nothing moves."""
    window = layer.View(160).cut_window(-9, -9, 9, 9)
    x, y = list_grid(window)
    right, down = HeadField(window).shift(HeadPlacement(roll=0.1))
    head = y < NECK_TOP
    assert (right * x + down * (y - PIVOT_Y))[head] == pytest.approx(0, abs=1e-9)
    assert right[head].max() < 0  # what is shown at the top comes from the left
    assert not right[y > NECK_END].any()


POSES = (
    FacePose(MouthPose(gap=0.0)),
    FacePose(MouthPose(gap=0.15, jaw=0.12, tongue=0.5), gaze_x=0.03, brows=0.02, head=HeadPlacement(0.02, 0.01, 0.03)),
    FacePose(MouthPose(gap=0.08, width=0.75, protrusion=1.0), lids=0.6, head=HeadPlacement(yaw=0.03, pitch=-0.02)),
    FacePose(MouthPose(gap=0.044, tuck=1.0)),
    FacePose(MouthPose(gap=0.08, tongue=1.0, jaw=0.03)),
    FacePose(MouthPose(gap=0.04, frown=1.0, upper_raise=1.0), mood=UpperFace(lowered=1.0, squint=0.6, sneer=1.0)),
    FacePose(MouthPose(gap=0.0, smile=1.0), mood=UpperFace(inner=0.8, outer=0.5, wide=1.0, cheek=0.7)),
)


def test_a_frame_does_not_depend_on_the_ones_before():
    drawing = Rasteriser(characters.WOMAN, 96)
    used = drawing.make_canvas()
    for pose in (*POSES, *POSES[::-1]):
        assert np.array_equal(drawing.draw(pose, used), drawing.draw(pose, drawing.make_canvas()))


X = np.linspace(-0.5, 0.5, 1001)
MIDDLE = 500
LIPS = WOMAN.lips


def pose(gap: float, width: float = 1.0, fullness: float = 1.0, **gestures: float) -> MouthPose:
    return MouthPose(gap, width, fullness, float(mouth.measure_jaw_drop(gap)), **gestures)


shares = {name: st.floats(0, 1) for name in ("tuck", "tongue", "protrusion", "spread", "press", "teeth", "oval")}
poses = st.builds(
    pose, gap=st.floats(0, contact.LARGEST_GAP), width=st.floats(0.5, 1.35), fullness=st.floats(0.75, 1.25), **shares
)
DESIGNS = {"woman": WOMAN, "man": MAN, "cartoon": CARTOON}
designs = st.sampled_from(sorted(DESIGNS))


@settings(max_examples=60)
@given(designs, poses)
def test_outlines_never_cross_and_the_gap_is_exact(name, drawn):
    """The mouth ends at its corners and is symmetric; closed lips touch along all of it."""
    design = DESIGNS[name]
    shape = outline_lips(design.lips, drawn, X)
    within = outline_interior(design.lips, drawn, X, shape)
    for upper, lower in [
        (shape.upper_outer, shape.upper_inner), (shape.upper_inner, shape.lower_inner),
        (shape.lower_inner, shape.lower_outer), (shape.upper_inner, within.teeth_upper),
        (within.teeth_upper, shape.lower_inner), (shape.upper_inner, within.teeth_lower),
        (within.teeth_lower, shape.lower_inner), (shape.upper_inner, within.tongue_top),
        (within.tongue_top, within.tongue_bottom), (within.tongue_bottom, shape.lower_inner + 0.03),
    ]:  # fmt: skip
        assert (upper <= lower + 1e-9).all()
    gap = shape.lower_inner - shape.upper_inner
    assert gap[MIDDLE] == pytest.approx(drawn.gap, abs=1e-6)
    assert gap.max() <= drawn.gap + 1e-6
    outside = np.abs(X) >= shape.half_width
    assert np.ptp(shape.upper_outer[outside]) < 1e-6
    assert (shape.lower_outer - shape.upper_outer)[outside].max() < 1e-6
    assert shape.upper_outer[outside][0] == pytest.approx(shape.corner_y, abs=1e-6)
    np.testing.assert_allclose(shape.lower_outer, shape.lower_outer[::-1], rtol=1e-6, equal_nan=False)
    assert 0.55 < shape.upper_outer.min() < shape.lower_outer.max() < 1.7
    closed = outline_lips(design.lips, drawn._replace(gap=0.0), X)
    assert np.abs(closed.upper_inner - closed.lower_inner).max() < 1e-9
    assert closed.seam[MIDDLE] > 0


def test_tucked_the_lower_lip_is_behind_the_upper_teeth():
    for gap in mouth.TUCKED_GAP:
        drawn = pose(gap, tuck=1.0)
        shape = outline_lips(LIPS, drawn, X)
        near = np.abs(X) < 0.05
        teeth = outline_interior(LIPS, drawn, X, shape).teeth_upper
        assert np.abs(teeth - shape.lower_inner)[near].max() < 1e-9  # their edge is hidden by the lip
        thickness = shape.lower_outer[MIDDLE] - shape.lower_inner[MIDDLE]
        free = outline_lips(LIPS, pose(gap), X)
        assert thickness < 0.65 * (free.lower_outer[MIDDLE] - free.lower_inner[MIDDLE])


def test_sounds_have_shapes_of_their_own():
    """Wide and low for ee, narrow and round for oo, smaller for w, high for aa: by width and height of the opening."""

    def hole(drawn: MouthPose) -> tuple[float, float]:
        shape = outline_lips(LIPS, drawn, X)
        return 2 * shape.inner_half_width, float((shape.lower_inner - shape.upper_inner).max())

    ee = hole(pose(0.07, 1.07, spread=1.0, teeth=0.9))
    oo = hole(pose(0.06, 0.72, protrusion=1.0))
    aa = hole(pose(0.2, 0.92))
    assert ee[0] > 3 * oo[0]
    assert oo[0] < 3.2 * oo[1]
    assert ee[0] > 7 * ee[1]
    assert aa[1] > 2.5 * ee[1]
    w, oo = hole(pose(0.045, 0.75, protrusion=1, press=0.5)), hole(pose(0.085, 0.8, protrusion=1))
    assert w[0] < 0.7 * oo[0]
    assert w[1] < 0.6 * oo[1]
    assert 1 < oo[0] / oo[1] < 3.1


@pytest.mark.parametrize("name", sorted(DESIGNS))
def test_protruded_lips_are_a_narrow_ring_round_a_round_hole_and_the_seam_beside_it_ends(name) -> None:
    lips = DESIGNS[name].lips
    rest = outline_lips(lips, pose(0.0), X).half_width
    narrower = []
    for gap, width in ((0.045, 0.87), (0.06, 0.89), (0.08, 0.89)):
        shape = outline_lips(lips, pose(gap, width, protrusion=1.0), X)
        assert 1.8 < 2 * shape.inner_half_width / gap < 2.6
        assert np.abs(X)[shape.seam > 0.3 * lips.seam].max() < 1.1 * shape.inner_half_width
        narrower.append(shape.half_width / rest)
    assert sorted(narrower) == narrower
    assert narrower[0] < 0.72
    assert narrower[-1] < 0.82
