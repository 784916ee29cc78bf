"""Characters from files to vertices."""

from __future__ import annotations

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.meshes.files.binding_files import save_binding, write_weights
from lipmotion.meshes.fitting.driven import driven_character
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
        character = driven_character(files / "head.obj", points=files / "points.csv")
    else:
        character = driven_character(files / "head.glb", by_points=by == "control points")
    assert (character.shapes is None) == (by != "blendshapes")
    gaps = [_gap(character, vertices) for vertices in character.vertices(motion(), units(), TIME_S)]
    opening = motion().at(TIME_S)[:, 0]
    assert np.corrcoef(gaps, opening)[0, 1] > 0.98
    assert max(gaps[14], gaps[24]) < 0.004  # m and p
    assert max(gaps[:10]) < 0.004


def test_only_the_moving_vertices_move(files):
    character = driven_character(files / "head.glb")
    still = np.setdiff1d(np.arange(len(character.mesh.vertices)), character.moving)
    others = {"eyeBlinkLeft": np.linspace(0, 1, len(TIME_S))}
    for vertices in character.vertices(motion(), units(), TIME_S, others):
        np.testing.assert_allclose(vertices[still], character.mesh.vertices[still], atol=1e-12)
    eyes = character.mesh.vertices[:, 1] > 2.1
    assert np.abs(vertices - character.mesh.vertices)[eyes, 1].max() == pytest.approx(0.5, abs=1e-5)


def test_bindings_are_stored_and_painted(files):
    computed = driven_character(files / "head.obj", points=files / "points.csv")
    save_binding(files / "head.binding", computed.binding, computed.mesh)
    write_weights(files / "weights.csv", computed.binding)
    stored = driven_character(files / "head.obj", binding=files / "head.binding")
    painted = driven_character(files / "head.obj", points=files / "points.csv", binding=files / "weights.csv")
    for other in (stored, painted):
        pairs = zip(
            other.vertices(motion(), units(), TIME_S), computed.vertices(motion(), units(), TIME_S), strict=True
        )
        assert max(np.abs(one - two).max() for one, two in pairs) < 1e-4


def test_chosen_blendshapes_alone_are_used(files):
    character = driven_character(files / "head.glb", only=["jawOpen", "mouthPucker"])
    assert character.weights(motion(), units()).names == ("jawOpen", "mouthPucker")
    with pytest.raises(InputError, match="no blendshape 'jaw'"):
        driven_character(files / "head.glb", only=["jaw"])


def test_a_mesh_without_blendshapes_needs_points(files):
    with pytest.raises(InputError, match=r"head\.obj: no blendshape opens the mouth.*name the lip points"):
        driven_character(files / "head.obj")


def test_control_points_have_no_weights(files):
    character = driven_character(files / "head.glb", by_points=True)
    with pytest.raises(InputError, match="moved by control points"):
        character.weights(motion(), units())
