import numpy as np
import pytest
from scipy.optimize import lsq_linear

from lipmotion import errors, types
from lipmotion.articulation.lip_points import LEFT_CORNER, RIGHT_CORNER, mouth_template
from lipmotion.meshes.fitting import blendshape_motion, lip_placement
from lipmotion.meshes.fitting.shape_weights import (
    OPPOSED,
    CurveCosts,
    cancel_opposed,
    fit_bounded_curves,
    round_lips,
    solve_shape_weights,
)
from lipmotion.meshes.model import face_shapes, surface
from meshes.heads import VISEMES, head, renamed
from meshes.speech import PHONES, motion, units


def _shapes_of(mesh):
    return face_shapes.find_face_shapes(mesh, lip_placement.place_lips_by_shape(mesh, surface.build_surface(mesh)))


@pytest.fixture(scope="module", params=["mesh", "reference"])
def shapes(request):
    return _shapes_of(head()) if request.param == "mesh" else blendshape_motion.arkit_mouth()


@pytest.fixture(scope="module")
def weights(shapes):
    """Of motion with points for the mesh, of distances alone for the reference."""
    return solve_shape_weights(motion(points=shapes is not blendshape_motion.arkit_mouth()), units(), shapes)


def test_weights_are_between_0_and_1_and_smooth_and_pucker_in_oo(weights):
    assert weights.values.min() >= 0
    assert weights.values.max() <= 1
    assert np.abs(np.diff(weights.values, axis=0)).max() < 0.25
    assert (weights["mouthClose"] - weights["jawOpen"]).max() < 1e-9
    assert weights["mouthPucker"][115] > weights["mouthPucker"][75] + 0.04  # aa
    of_reference = solve_shape_weights(motion(), units(), blendshape_motion.arkit_mouth())["mouthPucker"]
    assert of_reference[115] > 0.38
    assert of_reference[75] < 0.3


def test_shapes_that_undo_each_other_are_not_there_at_once(weights):
    for one, other in OPPOSED:
        sides = [
            np.max([weights[name] for name in names if name in weights.names], axis=0)
            for names in (one, other)
            if {*names} & {*weights.names}
        ]
        assert len(sides) < 2 or np.minimum(*sides).max() < 0.1
    live = cancel_opposed(weights.values[115] + 0.1, weights.names)
    assert not np.minimum(live[weights.names.index("mouthPucker")], live[weights.names.index("mouthStretchLeft")])


def test_the_gap_is_that_of_the_motion(weights, shapes):
    gap = weights.values @ shapes.gap
    wanted = blendshape_motion.move_points(motion(), units()).mouth.gap
    phone = np.array([name for name, start, end in PHONES for _ in range(round(100 * (end - start)))] + ["sil"])
    free = ~np.isin(phone, ["p", "m"])
    assert np.abs(gap - wanted)[free].max() < 0.012
    assert np.corrcoef(gap, wanted)[0, 1] > 0.995


def test_lips_close_in_p_and_m_and_in_silence(weights, shapes):
    gap = weights.values @ shapes.gap
    assert gap[[55, 95]].max() < 1e-6
    assert gap[:40].max() < 1e-6
    assert weights.values[5:40].max() < 0.03


def test_the_jaw_stays_open_behind_closed_lips(shapes):
    weights = solve_shape_weights(motion(), units(), shapes)
    assert weights["jawOpen"][95] > 0.05
    assert weights["mouthClose"][95] > 0.05


def test_lips_are_pressed_in_p_as_captures_press_them(shapes):
    assert 0.35 < solve_shape_weights(motion(), units(), shapes)["mouthPressLeft"][95] < 0.66


def test_known_weights_come_back():
    shapes = _shapes_of(head())
    known = np.zeros((60, len(shapes.names)))
    wave = np.clip(np.sin(np.arange(60) / 9), 0, 1)
    known[:, shapes.row("jawOpen")] = 0.4 * wave
    known[:, shapes.row("mouthPucker")] = 0.5 * wave[::-1]
    placed = np.einsum("ts,spc->tpc", known, shapes.moved)
    found = solve_shape_weights(_of(placed, known @ shapes.gap), types.Timeline(()), shapes, _EXACT)
    found = types.Motion(found.values[30:], 100.0, found.channels)  # before: the rest pose
    assert np.abs(found["jawOpen"] - known[:, shapes.row("jawOpen")]).max() < 0.08
    assert np.abs(found["mouthPucker"] - known[:, shapes.row("mouthPucker")]).max() < 0.12


def test_visemes_are_used_where_there_is_no_jaw_shape():
    shapes = _shapes_of(renamed(VISEMES))
    assert shapes.style == "visemes"
    found = solve_shape_weights(motion(), units(), shapes)
    assert found["viseme_aa"][75] > 0.2
    assert found["viseme_aa"][:40].max() < 0.02
    assert found["viseme_U"][115] > found["viseme_U"][75]
    gap = found.values @ shapes.gap
    assert gap[[55, 95]].max() < 1e-6


_EXACT = CurveCosts(ridge=1e-7, smooth=0.0)


def _of(displacements, gap):
    """Motion whose points are displaced so."""
    template = mouth_template()
    places = template.places + displacements
    rest = np.tile(template.places, (30, 1, 1))
    places = np.concatenate([rest, places])
    channels = [types.Channel(f"{axis}_{point}") for point in template.points for axis in "xyz"]
    opening = np.concatenate([np.zeros(30), np.maximum(gap, 0)])[:, None]
    values = np.concatenate([opening, opening, places.reshape(len(places), -1)], axis=1)
    return types.Motion(values, 100.0, (types.Channel("opening"), types.Channel("lip_gap"), *channels))


def test_each_frame_is_the_bounded_least_squares_solution():
    rng = np.random.default_rng(0)
    matrix, targets = rng.normal(size=(6, 20)), 2 * rng.normal(size=(5, 20))
    found = fit_bounded_curves(matrix, targets, CurveCosts(ridge=1e-2, smooth=0.0))
    rows = np.concatenate([matrix.T, np.sqrt(1e-2) * np.eye(6)])
    for frame, target in zip(found, targets, strict=True):
        exact = lsq_linear(rows, np.concatenate([target, np.zeros(6)]), (0, 1), tol=1e-12).x
        np.testing.assert_allclose(frame, exact, atol=1e-4)


def test_all_frames_together_are_the_exact_solution():
    rng = np.random.default_rng(9)
    frames, matrix = 7, rng.normal(size=(3, 8))
    targets = rng.normal(size=(frames, 8))
    found = fit_bounded_curves(matrix, targets, CurveCosts(ridge=1e-2, smooth=0.7), np.array([[0.3, -0.3, 0.0]]))
    fit, ridge = np.kron(np.eye(frames), matrix.T), np.sqrt(1e-2) * np.eye(3 * frames)
    near, smooth = np.kron(np.eye(frames), [[0.3, -0.3, 0.0]]), np.kron(np.diff(np.eye(frames), 2, axis=0), np.eye(3))
    rows = np.concatenate([fit, ridge, near, np.sqrt(0.7) * smooth])
    wanted = np.concatenate([targets.reshape(-1), np.zeros(len(rows) - targets.size)])
    exact = lsq_linear(rows, wanted, (0, 1), tol=1e-12).x.reshape(frames, 3)
    np.testing.assert_allclose(found, exact, atol=1e-4)


def test_more_cost_is_smoother():
    targets, costs = np.random.default_rng(2).random((50, 4)), (CurveCosts(smooth=cost) for cost in (0.0, 5.0))
    rough, smooth = (np.abs(np.diff(fit_bounded_curves(np.eye(4), targets, each), axis=0)).sum() for each in costs)
    assert smooth < rough / 2
    with pytest.raises(errors.InputError, match="do not fit"):
        fit_bounded_curves(np.zeros((2, 3)), np.zeros((5, 4)))
    with pytest.raises(errors.InputError, match="not finite"):
        fit_bounded_curves(np.full((2, 3), np.nan), np.zeros((5, 3)))


def test_the_weights_are_never_less_round_than_before():
    shapes = blendshape_motion.arkit_mouth()
    weights = np.full((3, len(shapes.names)), 0.3)
    result = round_lips(weights, shapes, np.array([0.0, 0.5, 1.0]))
    pucker, smile = shapes.row("mouthPucker"), shapes.row("mouthSmileLeft")
    assert result[:2, pucker] == pytest.approx([0.3, 0.3])
    assert 0.3 <= result[2, pucker] <= 0.5
    assert result[:, smile] == pytest.approx([0.3, 0.15, 0.0])


def test_points_of_round_lips_come_together_and_forward():
    template = mouth_template()
    moved = blendshape_motion.move_points(motion(points=False), units()).displacements
    right, left = moved[115, template.row(RIGHT_CORNER)], moved[115, template.row(LEFT_CORNER)]  # uw
    assert right[0] > 0.03
    assert left[0] < -0.03
    assert min(right[2], left[2]) > 0.02
    assert np.abs(moved[20]).max() < 1e-6  # silence
