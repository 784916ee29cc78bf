import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.articulation import contact, mouth
from lipmotion_faces.portrait.characters import CARTOON, MAN, WOMAN
from lipmotion_faces.portrait.design import STEPS, closed_curve, mirror_curve, open_curve, path_points, stroke
from lipmotion_faces.portrait.geometry import TEETH_EDGE, MouthPose, lip_outlines, mouth_interior

X = np.linspace(-0.5, 0.5, 1001)
MIDDLE = 500
LIPS = WOMAN.lips


def pose(gap: float, width: float = 1.0, fullness: float = 1.0, **gestures: float) -> MouthPose:
    return MouthPose(gap, width, fullness, float(mouth.jaw_drop(gap)), **gestures)


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
    shape = lip_outlines(design.lips, drawn, X)
    within = mouth_interior(design.lips, drawn, X, shape)
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
    assert shape.lower_outer == pytest.approx(shape.lower_outer[::-1])
    assert 0.55 < shape.upper_outer.min() < shape.lower_outer.max() < 1.7
    closed = lip_outlines(design.lips, drawn._replace(gap=0.0), X)
    assert np.abs(closed.upper_inner - closed.lower_inner).max() < 1e-9
    assert closed.seam[MIDDLE] > 0


def test_upper_teeth_stay_with_the_skull_and_lower_teeth_go_with_the_jaw():
    for gap in (0.1, 0.15, 0.3):
        drawn = pose(gap, teeth=1.0)
        within = mouth_interior(LIPS, drawn, X, lip_outlines(LIPS, drawn, X))
        assert within.teeth_upper[MIDDLE] == pytest.approx(LIPS.line_y + TEETH_EDGE)
        assert within.teeth_lower[MIDDLE] >= within.teeth_upper[MIDDLE]
    low, high = (mouth_interior(LIPS, p, X, lip_outlines(LIPS, p, X)) for p in (pose(0.1, teeth=1), pose(0.3, teeth=1)))
    assert high.teeth_lower[MIDDLE] > low.teeth_lower[MIDDLE]


def test_lower_teeth_are_hidden_but_where_both_rows_are_shown():
    def shown(**gestures: float) -> float:
        drawn = pose(0.08, **gestures)
        shape = lip_outlines(LIPS, drawn, X)
        return float(shape.lower_inner[MIDDLE] - mouth_interior(LIPS, drawn, X, shape).teeth_lower[MIDDLE])

    assert shown(teeth=0.0, protrusion=1.0, width=0.7) < 0.004
    assert shown(teeth=0.5) < 0.004
    assert shown(teeth=1.0) > 0.015


def test_tucked_the_lower_lip_is_behind_the_upper_teeth():
    for gap in mouth.TUCKED_GAP:
        drawn = pose(gap, tuck=1.0)
        shape = lip_outlines(LIPS, drawn, X)
        near = np.abs(X) < 0.05
        teeth = mouth_interior(LIPS, drawn, X, shape).teeth_upper
        assert np.abs(teeth - shape.lower_inner)[near].max() < 1e-9  # their edge is hidden by the lip
        thickness = shape.lower_outer[MIDDLE] - shape.lower_inner[MIDDLE]
        free = lip_outlines(LIPS, pose(gap), X)
        assert thickness < 0.65 * (free.lower_outer[MIDDLE] - free.lower_inner[MIDDLE])


def test_the_raised_tongue_reaches_the_upper_teeth_and_beyond_the_lip_when_out():
    for gap in (0.08, 0.1, 0.2):
        low, up, out = (pose(gap, tongue=value) for value in (0.0, 0.6, 1.0))
        rest, raised, between = (mouth_interior(LIPS, p, X, lip_outlines(LIPS, p, X)) for p in (low, up, out))
        assert raised.tongue_top[MIDDLE] < rest.tongue_top[MIDDLE]
        assert abs(raised.teeth_upper[MIDDLE] - raised.tongue_top[MIDDLE]) < 0.02
        assert between.tongue_bottom[MIDDLE] > lip_outlines(LIPS, out, X).lower_inner[MIDDLE] + 0.004


def test_sounds_have_shapes_of_their_own():
    """Wide and low for ee, narrow and round for oo, smaller for w, high for aa: by width and height of the opening."""

    def hole(drawn: MouthPose) -> tuple[float, float]:
        shape = lip_outlines(LIPS, drawn, X)
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
    rest = lip_outlines(lips, pose(0.0), X).half_width
    narrower = []
    for gap, width in ((0.045, 0.87), (0.06, 0.89), (0.08, 0.89)):
        shape = lip_outlines(lips, pose(gap, width, protrusion=1.0), X)
        assert 1.8 < 2 * shape.inner_half_width / gap < 2.6
        assert np.abs(X)[shape.seam > 0.3 * lips.seam].max() < 1.1 * shape.inner_half_width
        narrower.append(shape.half_width / rest)
    assert sorted(narrower) == narrower
    assert narrower[0] < 0.72
    assert narrower[-1] < 0.82


def test_the_corners_of_an_oval_are_halfway_down() -> None:
    shape = lip_outlines(LIPS, pose(0.2, 0.85, oval=1.0), X)
    assert abs(shape.corner_y - (shape.upper_inner[MIDDLE] + shape.lower_inner[MIDDLE]) / 2) < 0.02


def test_above_a_tucked_lip_the_opening_is_full_of_upper_teeth_and_arched_upwards() -> None:
    drawn = pose(mouth.TUCKED_GAP[0], tuck=1.0)
    shape = lip_outlines(LIPS, drawn, X)
    within = mouth_interior(LIPS, drawn, X, shape)
    near = np.abs(X) < 0.6 * shape.inner_half_width
    assert (within.teeth_upper >= shape.lower_inner - 1e-9)[near].all()
    assert (within.teeth_lower >= shape.lower_inner - 1e-9)[near].all()
    assert shape.corner_y - shape.upper_inner[MIDDLE] > 1.5 * (shape.lower_inner[MIDDLE] - shape.corner_y)


PATH = "0 0, 1 0.5, 2 -0.5, 3 0"


def test_curves_go_through_their_points_smoothly():
    assert open_curve(PATH)[::STEPS] == pytest.approx(path_points(PATH))
    assert closed_curve(PATH)[::STEPS] == pytest.approx(path_points(PATH))
    steps = np.diff(closed_curve("0 0, 1 0, 1 1, 0 1"), axis=0)
    turns = np.abs(np.diff(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))))
    assert turns.max() < 0.3
    line = open_curve([(0.0, 0.0), (1.0, 1.0), (2.0, 2.0)])
    assert line[:, 0] == pytest.approx(line[:, 1])


def test_symmetric_outlines_mirror_themselves_and_a_stroke_is_as_wide_as_asked():
    outline = mirror_curve("0 -1, 1 0, 0.5 0.5, 0 1")
    mirrored = outline * (-1, 1)
    assert np.abs(outline[:, None] - mirrored[None]).sum(axis=2).min(axis=1).max() < 1e-9
    outline = stroke(open_curve("0 0, 1 0, 2 0"), [0.2, 0.4])
    assert outline[0, 1] - outline[-1, 1] == pytest.approx(0.2)
    assert np.ptp(outline[:, 1]) == pytest.approx(0.4)
