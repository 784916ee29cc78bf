"""A character's file as a face: pictures of the lips that the motion has."""

from __future__ import annotations

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.faces.mesh import MeshFace, MeshStage, blink_curve
from lipmotion.rig.driven import DrivenCharacter, driven_character
from lipmotion.rig.gltf_writer import write_glb
from lipmotion.rig.mesh import Material, Mesh, MeshPart
from rig.heads import head
from rig.speech import motion, units


@pytest.fixture(scope="module")
def character(tmp_path_factory) -> DrivenCharacter:
    path = tmp_path_factory.mktemp("character") / "head.glb"
    mesh = head()
    red = Material("lips", (0.8, 0.2, 0.2))
    parts = (MeshPart("face", 0, mesh.parts[0].stop, red), *mesh.parts[1:])
    write_glb(path, Mesh(mesh.vertices, mesh.triangles, parts, mesh.shapes))
    return driven_character(path)


@pytest.fixture(scope="module")
def pictures(character):
    return list(MeshFace(character, 256, 144).render(motion(), units(), fps=10.0))


def test_there_is_a_picture_for_every_time(pictures):
    assert len(pictures) == 21
    assert {picture.shape for picture in pictures} == {(144, 256, 3)}
    assert {picture.dtype for picture in pictures} == {np.dtype(np.uint8)}


def test_the_same_motion_gives_the_same_pixels(character, pictures):
    again = list(MeshFace(character, 256, 144).render(motion(), units(), fps=10.0))
    assert all((one == two).all() for one, two in zip(pictures, again, strict=True))


def test_the_open_mouth_is_seen(pictures):
    """The sheet has a hole where the mouth is open, through which the background is seen."""
    changed = np.abs(pictures[7].astype(int) - pictures[0]).max(axis=2) > 40  # aa
    rows, columns = np.nonzero(changed)
    assert changed.sum() > 50
    assert abs(columns.mean() - 128) < 12
    closed = np.abs(pictures[18].astype(int) - pictures[0]).max(axis=2) > 40
    assert closed.sum() < changed.sum() / 5
    assert rows.max() < 144


def test_only_what_moves_is_drawn_anew(character):
    stage = MeshStage(character, 256, 144)
    at_rest = stage.picture(character.mesh.vertices)
    whole = MeshStage(character, 256, 144).picture(character.mesh.vertices)
    np.testing.assert_array_equal(at_rest, whole)


def test_blinks_come_and_go():
    shut = blink_curve(np.arange(1000) / 50.0, seed=1)
    assert shut.max() == pytest.approx(1)
    assert 0.005 < (shut > 0.5).mean() < 0.1
    assert blink_curve(np.zeros(0)).size == 0


def test_a_rate_of_0_is_refused(character):
    with pytest.raises(InputError, match="frame rate is 0"):
        next(MeshFace(character, 256, 144).render(motion(), units(), fps=0))
