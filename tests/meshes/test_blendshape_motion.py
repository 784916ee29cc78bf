"""Weights of blendshapes as motion of a mouth."""

from __future__ import annotations

import numpy as np
import pytest

from lipmotion.articulation.contact import CLOSED_OPENING, opening_to_gap
from lipmotion.meshes.fitting.blendshape_motion import (
    arkit_mouth,
    arkit_weights,
    find_own_weights,
    is_of_blendshapes,
    with_mouth,
)
from lipmotion.meshes.fitting.driven import DrivenCharacter
from lipmotion.meshes.fitting.lip_placement import place_lips_by_shape
from lipmotion.meshes.fitting.shape_weights import solve_shape_weights
from lipmotion.meshes.model.face_shapes import find_face_shapes
from lipmotion.meshes.model.surface import build_surface
from lipmotion.types import WEIGHT, Channel, Motion, Timeline
from meshes.heads import head
from meshes.speech import motion, units


def weights(**curves: list[float]) -> Motion:
    return Motion(np.array(list(curves.values())).T, 100.0, tuple(Channel(name, WEIGHT) for name in curves))


def test_other_motion_stays_as_it_is() -> None:
    said = motion()
    assert with_mouth(said) is said
    no_jaw = weights(mouthPucker=[0.0, 1.0])
    assert with_mouth(no_jaw) is no_jaw
    assert not is_of_blendshapes(no_jaw)


def test_the_jaw_opens_and_mouth_close_closes() -> None:
    moved = with_mouth(weights(jawOpen=[0.0, 0.5, 1.0, 0.5], mouthClose=[0.0, 0.0, 0.0, 0.5]))
    opening = moved["opening"]
    assert opening[[0, 3]].max() < CLOSED_OPENING
    assert moved["lip_gap"] == pytest.approx(opening_to_gap(opening), abs=1e-3)
    assert np.diff(opening[:3]).min() > 0.1
    assert moved["y_152"][1] < moved["y_152"][0]
    beyond = with_mouth(weights(jawOpen=[0.0, 0.0, 0.3], mouthClose=[0.0, 1.0, 0.9]))  # no further than the jaw is open
    for name in ("outer", "y_14", "y_13"):
        assert beyond[name][1] == pytest.approx(beyond[name][0])
    assert moved.names[:2] == ("jawOpen", "mouthClose")


def test_lips_narrow_and_spread() -> None:
    moved = with_mouth(weights(jawOpen=[0.0] * 3, mouthPucker=[0.0, 1.0, 0.0], mouth_smile_L=[0.0, 0.0, 1.0]))
    assert moved["width"][1] < moved["width"][0] < moved["width"][2]
    assert moved["protrusion"].tolist() == [0.0, 1.0, 0.0]
    assert moved["spread"][2] > 0.5


def test_motion_that_became_weights_comes_back() -> None:
    said = motion()
    back = with_mouth(solve_shape_weights(said, units(), arkit_mouth()))
    assert np.corrcoef(back["opening"], said["opening"])[0, 1] > 0.99
    assert np.corrcoef(back["width"], said["width"])[0, 1] > 0.9


def test_the_blendshapes_of_facegood_are_converted() -> None:
    found = arkit_weights(weights(mouth_stretch_c=[0.0, 0.6], mouth_pucker_l=[0.4, 0.0], mouth_pucker_r=[0.4, 0.0]))
    assert found["jawOpen"].tolist() == [0.0, 0.6]
    assert found["mouthPucker"].tolist() == pytest.approx([0.4, 0.0])
    assert is_of_blendshapes(weights(mouth_stretch_c=[0.0, 0.6]))


def test_weights_that_are_given_are_taken() -> None:
    given = find_own_weights(weights(head_jawOpen=[0.2, 1.4], mouthPucker=[0.1, 0.2]), arkit_mouth())
    assert given is not None
    assert given.names == arkit_mouth().names
    assert given["jawOpen"].tolist() == [0.2, 1.0]
    assert given["mouthFunnel"].tolist() == [0.0, 0.0]
    assert find_own_weights(motion(), arkit_mouth()) is None
    assert find_own_weights(weights(mouthPucker=[0.1, 0.2]), arkit_mouth()) is None


def test_a_mesh_shows_the_weights_that_are_given() -> None:
    mesh = head()
    placement = place_lips_by_shape(mesh, build_surface(mesh))
    character = DrivenCharacter(mesh, placement, find_face_shapes(mesh, placement), None)
    assert character.shapes is not None
    moved = with_mouth(weights(jawOpen=[0.0, 0.25, 0.5], mouthClose=[0.0] * 3))
    rest, half, whole = character.vertices(moved, Timeline(()), np.arange(3) / 100)
    jaw = next(
        shape for shape in mesh.shapes if shape.name == character.shapes.names[character.shapes.row("jawOpen") or 0]
    )
    assert (whole - rest)[jaw.rows] == pytest.approx(0.5 * jaw.displacements, abs=1e-9)
    assert (half - rest)[jaw.rows] == pytest.approx(0.25 * jaw.displacements, abs=1e-9)
