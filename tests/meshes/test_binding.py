import zipfile
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from lipmotion import errors
from lipmotion.articulation.lip_points import LEFT_CORNER, RIGHT_CORNER, build_mouth
from lipmotion.errors import InputError, ModelFormatError
from lipmotion.meshes.fitting import blendshape_motion, shape_weights
from lipmotion.meshes.fitting.shape_weights import OPPOSED, CurveCosts, cancel_opposed, fit_bounded_curves, round_lips
from lipmotion.meshes.model.mesh import Blendshape, Mesh
from lipmotion_faces.characters import binding as binding_files
from lipmotion_faces.characters import character_files, lip_placement
from lipmotion_faces.characters.binding import MAX_WEIGHTS, bind, paint_weights
from lipmotion_faces.characters.surface import build_surface
from meshes.heads import COLUMNS, HALF, REPORTED, SEAM, SIZE, VISEMES, head, lip_points, renamed, shaped
from meshes.speech import PHONES, motion, units
from oracles.skinning import skinned_vertex_by_vertex


@pytest.fixture(scope="module")
def mesh():
    return head(shapes=False)


@pytest.fixture(scope="module")
def binding(mesh):
    named = lip_points(mesh)
    surface = lip_placement.separate_named_lips(mesh, named)
    return bind(mesh, surface, lip_placement.place_lips_by_points(mesh, surface, named))


def _moved(binding, mesh, chosen, way):
    displacements = np.zeros((len(binding.placement.points), 3))
    displacements[chosen] = way
    return (binding.move_vertices(mesh, displacements) - mesh.vertices) / binding.placement.scale


def test_the_lower_lip_does_not_drag_the_upper_and_teeth_follow_the_jaw(binding, mesh):
    template = build_mouth()
    moved = _moved(binding, mesh, template.lower | template.jaw, [0, -1, 0])
    middle = np.abs(template.places[:, 0]) < 0.2
    upper = binding.placement.vertices[template.upper & middle]
    lower = binding.placement.vertices[template.lower & middle]
    assert np.abs(moved[upper]).max() < 0.02
    assert moved[lower, 1].max() < -0.9
    assert moved[binding.placement.vertices[template.row(152)], 1] < -0.9
    teeth = next(part for part in mesh.parts if part.name == "teeth")
    rows = np.unique(mesh.triangles[teeth.first : teeth.stop])
    moved = _moved(binding, mesh, template.jaw, [0, -0.5, 0])
    np.testing.assert_allclose(moved[rows], np.tile([0, -0.5, 0], (3, 1)), atol=1e-9)


def test_the_face_beyond_the_mouth_stands_still(binding, mesh):
    assert binding.weights.min() >= 0
    assert binding.weights.sum(axis=1).max() <= 1 + 1e-9
    assert binding.controls.shape[1] <= MAX_WEIGHTS
    template = build_mouth()
    moved = _moved(binding, mesh, np.ones(len(template.points), bool), [0.3, 0.2, 0.1])
    far = mesh.vertices[:, 1] / SIZE > SEAM + 0.55
    assert np.abs(moved[far]).max() < 1e-9
    held = binding.placement.vertices[~template.jaw]
    np.testing.assert_allclose(moved[held], np.tile([0.3, 0.2, 0.1], (len(held), 1)), atol=1e-6)


def test_skinning_is_the_weighted_sum_of_the_transformed_vertices(binding, mesh):
    rng = np.random.default_rng(3)
    matrices = np.tile(np.eye(3, 4), (len(binding.placement.points), 1, 1)) + 0.1 * rng.normal(size=(52, 3, 4))
    rows = binding.rows[:40]
    slow = skinned_vertex_by_vertex(binding.matrix[:40].toarray(), matrices, mesh.vertices[rows])
    np.testing.assert_allclose(binding.transform_vertices(mesh, matrices)[rows], slow, atol=1e-9)


def test_a_stored_binding_is_the_same_and_of_its_mesh_and_a_damaged_one_is_refused(binding, mesh, tmp_path):
    path = tmp_path / "head.binding"
    binding_files.save_binding(path, binding, mesh)
    again = binding_files.load_binding(path, mesh)
    for name in ("rows", "controls", "weights"):
        np.testing.assert_array_equal(getattr(again, name), getattr(binding, name))
    assert again.placement.vertices.tolist() == binding.placement.vertices.tolist()
    with pytest.raises(InputError, match="made for"):
        binding_files.load_binding(path, head(shapes=False, slit=False))

    def refused():
        with pytest.raises(ModelFormatError, match="bind the character again"):
            binding_files.load_binding(path, mesh)

    binding_files.save_binding(path, replace(binding, weights=np.minimum(3 * binding.weights, 1)), mesh)
    refused()
    path.write_bytes(b"binding")
    refused()
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("header.json", "{}")
    refused()


def test_painted_weights_replace_those_of_a_vertex(binding, mesh, tmp_path):
    vertex = int(binding.rows[0])
    paint = tmp_path / "paint.csv"
    paint.write_text(f"vertex,point,weight\n{vertex},152,0.25\n{vertex},17,0.5\n\n# more\n0,17,2e-1\n")
    after = paint_weights(binding, mesh, binding_files.read_weights(paint))
    template = build_mouth()
    moved = _moved(after, mesh, [template.row(17)], [0, 1, 0])
    assert moved[vertex, 1] == pytest.approx(0.5)
    assert moved[0, 1] == pytest.approx(0.2)
    untouched = binding.rows[1:]
    before = _moved(binding, mesh, [template.row(17)], [0, 1, 0])
    np.testing.assert_allclose(moved[untouched], before[untouched], atol=1e-9)


def test_written_weights_paint_the_same_binding_and_points_are_read(binding, mesh, tmp_path):
    binding_files.write_weights(tmp_path / "weights.csv", binding)
    again = paint_weights(binding, mesh, binding_files.read_weights(tmp_path / "weights.csv"))
    np.testing.assert_allclose(again.matrix.toarray(), binding.matrix.toarray(), atol=1e-5)
    binding_files.write_points(tmp_path / "points.csv", binding.placement)
    named = binding_files.read_lip_points(tmp_path / "points.csv")
    assert [named[point] for point in binding.placement.points] == binding.placement.vertices.tolist()


def test_paint_is_checked(binding, mesh, tmp_path):
    for text, message in REPORTED["paint"]:
        (tmp_path / "paint.csv").write_text(text)
        with pytest.raises(InputError, match=message):
            paint_weights(binding, mesh, binding_files.read_weights(tmp_path / "paint.csv"))


GRID = 0.05 * SIZE  # the distance between vertices


def _named(mesh):
    named = lip_points(mesh)
    return lip_placement.place_lips_by_points(mesh, lip_placement.separate_named_lips(mesh, named), named)


def _offsets(mesh, placement):
    """How far each lip point is from where the template would have it."""
    template = build_mouth()
    centre = np.array([0, SEAM, 0]) * SIZE
    lips = ~template.jaw & ~template.corner
    wanted = centre[:2] + SIZE * HALF * 2 / template.width * (template.places - template.centre)[lips, :2]
    return np.abs(mesh.vertices[placement.vertices[lips], :2] - wanted).max()


@pytest.mark.parametrize("named", [False, True])
def test_points_are_where_the_mouth_is_the_upper_ones_on_the_upper_lip(named):
    mesh, template = head(), build_mouth()
    placement = _named(mesh) if named else lip_placement.place_lips_by_shape(mesh, build_surface(mesh))
    assert _offsets(mesh, placement) < 1.5 * GRID
    assert placement.scale == pytest.approx(SIZE * 2 * HALF / template.width, rel=0.25)
    drop = (shaped(mesh, {"jawOpen": 1.0}) - mesh.vertices)[placement.vertices, 1]
    middle = np.abs(template.places[:, 0]) < 0.2
    assert np.abs(drop[template.upper]).max() < 1e-9
    assert drop[template.lower & middle].max() < -0.1 * SIZE


def test_a_turned_head_is_found_by_its_eye_corners():
    mesh = head()
    turn = np.array([[0.0, 0, -1], [1, 0, 0], [0, -1, 0]]).T
    named = lip_points(mesh)
    for point, x in ((33, -0.5), (263, 0.5)):
        named[point] = int(np.abs(mesh.vertices[:, :2] / SIZE - [x, 0.0]).sum(axis=1).argmin())
    turned = Mesh(mesh.vertices @ turn.T, mesh.triangles)
    placement = lip_placement.place_lips_by_points(turned, lip_placement.separate_named_lips(turned, named), named)
    upright = lip_placement.place_lips_by_points(mesh, lip_placement.separate_named_lips(mesh, named), named)
    assert placement.vertices.tolist() == upright.vertices.tolist()
    np.testing.assert_allclose(placement.axes, turn @ upright.axes, atol=1e-9)
    moved = placement.to_mesh(np.array([[0.0, -1, 0]]))
    np.testing.assert_allclose(placement.to_motion(moved), [[0.0, -1, 0]], atol=1e-12)


def test_mouths_that_do_not_open_are_refused():
    mesh = head(shapes=False, slit=False)
    named = lip_points(head(shapes=False))
    named[14] = named[13] + len(COLUMNS)
    with pytest.raises(InputError, match="hang together"):
        lip_placement.place_lips_by_points(mesh, build_surface(mesh), named)
    whole = Blendshape.between("jawOpen", mesh.vertices, mesh.vertices - [0, SIZE, 0])
    with pytest.raises(InputError, match="parts no lips"):
        lip_placement.place_lips_by_shape(Mesh(mesh.vertices, mesh.triangles, shapes=(whole,)), build_surface(mesh))
    mesh = head()
    for turn, message in (("xzy", "of 'jawOpen' is 90° off down"), ("zyx", "is 82° off the axis x")):
        order = ["xyz".index(axis) for axis in turn]
        turned = [replace(s, displacements=s.displacements[:, order]) for s in mesh.shapes]
        lying = Mesh(mesh.vertices[:, order], mesh.triangles, shapes=tuple(turned))
        with pytest.raises(InputError, match=message):
            lip_placement.place_lips_by_shape(lying, build_surface(lying))
    closed = Mesh(mesh.vertices, mesh.triangles, shapes=tuple(s for s in mesh.shapes if s.name == "mouthPucker"))
    with pytest.raises(InputError, match="the mesh has: mouthPucker"):
        lip_placement.place_lips_by_shape(closed, build_surface(closed))


def test_named_points_are_checked():
    mesh = head(shapes=False)
    for named, message in REPORTED["points"]:
        with pytest.raises(InputError, match=message):
            lip_placement.place_lips_by_points(mesh, build_surface(mesh), dict(named))


def _shapes_of(mesh):
    return character_files.find_face_shapes(mesh, lip_placement.place_lips_by_shape(mesh, build_surface(mesh)))


@pytest.fixture(scope="module", params=["mesh", "reference"])
def shapes(request):
    return _shapes_of(head()) if request.param == "mesh" else blendshape_motion.arkit_mouth()


@pytest.fixture(scope="module")
def weights(shapes):
    """Of motion with points for the mesh, of distances alone for the reference."""
    of_mesh = shapes is not blendshape_motion.arkit_mouth()
    return shape_weights.solve_shape_weights(motion(points=of_mesh), units(), shapes)


def test_weights_are_between_0_and_1_and_smooth_and_pucker_in_oo(weights):
    assert weights.values.min() >= 0
    assert weights.values.max() <= 1
    assert np.abs(np.diff(weights.values, axis=0)).max() < 0.25
    assert (weights["mouthClose"] - weights["jawOpen"]).max() < 1e-9
    assert weights["mouthPucker"][115] > weights["mouthPucker"][75] + 0.04  # aa
    of_reference = shape_weights.solve_shape_weights(motion(), units(), blendshape_motion.arkit_mouth())["mouthPucker"]
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


def test_the_gap_is_that_of_the_motion_and_lips_close_in_p_and_m_and_in_silence(weights, shapes):
    gap = weights.values @ shapes.gap
    wanted = blendshape_motion.move_points(motion(), units()).mouth.gap
    phone = np.array([name for name, start, end in PHONES for _ in range(round(100 * (end - start)))] + ["sil"])
    free = ~np.isin(phone, ["p", "m"])
    assert np.abs(gap - wanted)[free].max() < 0.012
    assert np.corrcoef(gap, wanted)[0, 1] > 0.995
    assert gap[[55, 95]].max() < 1e-6
    assert gap[:40].max() < 1e-6
    assert weights.values[5:40].max() < 0.03


def test_the_jaw_stays_open_behind_lips_that_are_pressed_in_p_as_captures_press_them(shapes):
    weights = shape_weights.solve_shape_weights(motion(), units(), shapes)
    assert weights["jawOpen"][95] > 0.05
    assert weights["mouthClose"][95] > 0.05
    assert 0.35 < weights["mouthPressLeft"][95] < 0.66


def test_visemes_are_used_where_there_is_no_jaw_shape():
    shapes = _shapes_of(renamed(VISEMES))
    assert shapes.style == "visemes"
    found = shape_weights.solve_shape_weights(motion(), units(), shapes)
    assert found["viseme_aa"][75] > 0.2
    assert found["viseme_aa"][:40].max() < 0.02
    assert found["viseme_U"][115] > found["viseme_U"][75]
    assert (found.values @ shapes.gap)[[55, 95]].max() < 1e-6


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
    np.testing.assert_allclose(found, lsq_linear(rows, wanted, (0, 1), tol=1e-12).x.reshape(frames, 3), atol=1e-4)


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
    result = round_lips(np.full((3, len(shapes.names)), 0.3), shapes, np.array([0.0, 0.5, 1.0]))
    pucker, smile = shapes.row("mouthPucker"), shapes.row("mouthSmileLeft")
    assert result[:2, pucker] == pytest.approx([0.3, 0.3])
    assert 0.3 <= result[2, pucker] <= 0.5
    assert result[:, smile] == pytest.approx([0.3, 0.15, 0.0])


def test_points_of_round_lips_come_together_and_forward():
    template = build_mouth()
    moved = blendshape_motion.move_points(motion(points=False), units()).displacements
    right, left = moved[115, template.row(RIGHT_CORNER)], moved[115, template.row(LEFT_CORNER)]  # uw
    assert right[0] > 0.03
    assert left[0] < -0.03
    assert min(right[2], left[2]) > 0.02
    assert np.abs(moved[20]).max() < 1e-6  # silence
