"""Characters from files to vertices."""

from __future__ import annotations

import numpy as np
import pytest

from lipmotion.articulation.expression import with_moods
from lipmotion.articulation.mouth import spoken_mouth
from lipmotion.errors import InputError
from lipmotion.meshes.files.binding_files import save_binding, write_weights
from lipmotion.meshes.fitting.driven import load_character
from lipmotion.meshes.model.mesh import Blendshape, Mesh
from lipmotion.types.moods import parse_moods
from meshes.heads import head, lip_points, write_glb
from meshes.obj_writing import write_obj
from meshes.speech import motion, units

TIME_S = np.arange(51) / 25.0


@pytest.fixture
def files(tmp_path):
    """A head with blendshapes, one without, and the table of its lip points."""
    write_glb(tmp_path / "head.glb", head())
    plain = head(shapes=False)
    write_obj(tmp_path / "head.obj", plain)
    rows = "".join(f"{point},{vertex}\n" for point, vertex in lip_points(plain).items())
    (tmp_path / "points.csv").write_text("point,vertex\n" + rows)
    return tmp_path


def _gap(character, vertices):
    placement = character.placement
    upper, lower = (vertices[placement.vertices[placement.row(point)], 1] for point in (13, 14))
    rest = character.mesh.vertices[placement.vertices[[placement.row(13), placement.row(14)]], 1]
    return ((upper - lower) - (rest[0] - rest[1])) / placement.scale


@pytest.mark.parametrize("by", ["blendshapes", "control points", "named points"])
def test_the_lips_follow_the_motion(files, by):
    if by == "named points":
        character = load_character(files / "head.obj", points=files / "points.csv")
    else:
        character = load_character(files / "head.glb", by_points=by == "control points")
    assert (character.shapes is None) == (by != "blendshapes")
    gaps = [_gap(character, vertices) for vertices in character.vertices(motion(), units(), TIME_S)]
    opening = motion().at(TIME_S)[:, 0]
    assert np.corrcoef(gaps, opening)[0, 1] > 0.98
    assert max(gaps[14], gaps[24]) < 0.004  # m and p
    assert max(gaps[:10]) < 0.004


def test_only_the_moving_vertices_move(files):
    character = load_character(files / "head.glb")
    still = np.setdiff1d(np.arange(len(character.mesh.vertices)), character.moving)
    others = {"eyeBlinkLeft": np.linspace(0, 1, len(TIME_S))}
    for vertices in character.vertices(motion(), units(), TIME_S, others):
        np.testing.assert_allclose(vertices[still], character.mesh.vertices[still], atol=1e-12)
    eyes = character.mesh.vertices[:, 1] > 2.1
    assert np.abs(vertices - character.mesh.vertices)[eyes, 1].max() == pytest.approx(0.5, abs=1e-5)


def test_bindings_are_stored_and_painted(files):
    computed = load_character(files / "head.obj", points=files / "points.csv")
    save_binding(files / "head.binding", computed.binding, computed.mesh)
    write_weights(files / "weights.csv", computed.binding)
    stored = load_character(files / "head.obj", binding=files / "head.binding")
    painted = load_character(files / "head.obj", points=files / "points.csv", binding=files / "weights.csv")
    for other in (stored, painted):
        pairs = zip(
            other.vertices(motion(), units(), TIME_S), computed.vertices(motion(), units(), TIME_S), strict=True
        )
        assert max(np.abs(one - two).max() for one, two in pairs) < 1e-4


def test_a_mesh_without_blendshapes_needs_points(files):
    with pytest.raises(InputError, match=r"head\.obj: no blendshape opens the mouth.*name the lip points"):
        load_character(files / "head.obj")


def test_control_points_have_no_weights(files):
    character = load_character(files / "head.glb", by_points=True)
    with pytest.raises(InputError, match="moved by control points"):
        character.weights(motion(), units())


def _expressive(*names):
    """A head with five visemes, and some whole expressions: those whose name begins with ``s`` part the lips."""
    mesh = head()
    spoken = {
        "jawOpen": "viseme_aa",
        "mouthPucker": "viseme_U",
        "mouthFunnel": "viseme_O",
        "mouthSmileLeft": "viseme_E",
    }
    spoken |= {"mouthStretchLeft": "viseme_I", "mouthRollLower": "viseme_FF", "mouthPressLeft": "viseme_PP"}
    spoken |= {"mouthLowerDownLeft": "viseme_DD"}
    shapes = {shape.name: shape for shape in mesh.shapes}
    kept = [Blendshape(name, shapes[own].rows, shapes[own].displacements) for own, name in spoken.items()]
    for name in names:
        like = shapes["mouthUpperUpLeft" if name.lower().startswith("s") else "eyeBlinkLeft"]
        kept.append(Blendshape(name, like.rows, like.displacements))
    return Mesh(mesh.vertices, mesh.triangles, mesh.parts, tuple(kept))


def test_whole_expressions_stand_for_moods_where_there_are_no_finer_shapes(tmp_path):
    write_glb(tmp_path / "head.glb", _expressive("Happy", "surprised"))
    character = load_character(tmp_path / "head.glb")
    moved = with_moods(motion(), parse_moods("happy:0.5, afraid at 1.5"))
    mouth = spoken_mouth(moved, units())
    weights = character.expressions(moved, mouth)
    assert {*weights} == {"Happy", "surprised"}
    assert weights["Happy"][:100] == pytest.approx(0.5)
    assert weights["surprised"][-1] == pytest.approx(0.5)
    shut = with_moods(motion(), parse_moods("afraid"))
    surprised = character.expressions(shut, spoken_mouth(shut, units()))["surprised"]
    assert surprised[[20, 75]] == pytest.approx(0.5, abs=0.05)
    assert surprised[[55, 95]] == pytest.approx(0, abs=0.01)  # m, p
    plain, happy = (next(character.vertices(of, units(), TIME_S)) for of in (motion(), moved))
    assert np.abs(happy - plain).max() > 0.01


def test_characters_with_finer_shapes_do_not_show_whole_expressions(files):
    character = load_character(files / "head.glb")
    moved = with_moods(motion(), parse_moods("happy"))
    assert not character.expressions(moved, spoken_mouth(moved, units()))
    weights, plain = (character.weights(of, units()) for of in (moved, motion()))
    assert weights["mouthSmileLeft"][20] > plain["mouthSmileLeft"][20] + 0.5


def test_control_points_raise_the_corners_in_a_smile(files):
    character = load_character(files / "head.obj", points=files / "points.csv")
    placement = character.placement
    corner = placement.vertices[placement.row(61)]
    plain, happy = (
        next(character.vertices(of, units(), TIME_S)) for of in (motion(), with_moods(motion(), parse_moods("happy")))
    )
    assert happy[corner, 1] > plain[corner, 1] + 0.05 * placement.scale
