"""Poses as weights of blendshapes: lips meet where they meet in the pose, and the mouth is where it is drawn."""

from __future__ import annotations

import numpy as np
import pytest

from lipmotion.meshes.model.mesh import Mesh
from lipmotion_faces.head.lips import VISIBLE_RINGS
from lipmotion_faces.head.pose import CharacterPose
from lipmotion_faces.head.skin import REST
from lipmotion_faces.head.stage import POSES, figure, head_mesh, mouth_weights

SAID = {
    "rest": REST,
    "p": CharacterPose(press=1, jaw=0.02),
    "aa": CharacterPose(gap=0.22, upper_rise=0.035, jaw=0.16, oval=1, width=0.97),
    "ee": CharacterPose(gap=0.09, upper_rise=0.03, jaw=0.05, width=1.15, spread=1, smile=0.012),
    "oo": CharacterPose(gap=0.06, upper_rise=0.025, jaw=0.04, width=0.78, roundness=1, protrusion=0.085),
    "f": CharacterPose(gap=0.05, upper_rise=0.036, jaw=0.02, tuck=1),
    "th": CharacterPose(gap=0.06, upper_rise=0.02, jaw=0.04, tongue_out=1),
}


@pytest.fixture(scope="module")
def mesh() -> Mesh:
    return head_mesh(figure())


@pytest.fixture(scope="module")
def places(mesh: Mesh) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """The skin of each pose as sums of blendshapes, and as it is drawn; each is held for ten frames."""
    held = [pose for pose in SAID.values() for _ in range(10)]
    curves = mouth_weights(figure(), mesh, held)
    rows = np.arange(len(figure().skin.rest))
    moved = mesh.displacements(rows)
    found = {}
    for number, (name, pose) in enumerate(SAID.items()):
        weights = {each: float(curve[10 * number + 5]) for each, curve in curves.items()}
        summed = mesh.vertices[rows] + sum(
            weight * moved[mesh.shape_names.index(each)] for each, weight in weights.items()
        )
        found[name] = (summed, figure().skin.places(pose))
    return found


def test_the_lips_are_where_they_are_drawn(places: dict[str, tuple[np.ndarray, np.ndarray]]) -> None:
    rings = figure().skin.lip_rows()
    lips, ring = rings[:10].ravel(), rings[VISIBLE_RINGS - 1]
    for name, (summed, drawn) in places.items():
        assert np.abs(summed - drawn)[lips].max() < 0.07, name
        assert np.abs(summed - drawn)[lips].mean() < 0.018, name
        gaps = [float(each[ring[20], 1] - each[ring[60], 1]) for each in (summed, drawn)]
        assert gaps[0] == pytest.approx(gaps[1], abs=0.012), name


def test_closed_lips_are_those_of_the_rest_pose(mesh: Mesh) -> None:
    closed = [CharacterPose(gap=0.0, jaw=jaw, width=width) for jaw in (0.0, 0.06, 0.1) for width in (0.9, 1.0, 1.05)]
    curves = mouth_weights(figure(), mesh, closed)
    ring = figure().skin.lip_rows()[VISIBLE_RINGS - 1]
    moved = mesh.displacements(ring[[20, 60]])[:, :, 1]
    table = np.stack(list(curves.values()), axis=1)
    change = table @ np.stack([moved[mesh.shape_names.index(name)] for name in curves])
    assert np.abs(change[:, 0] - change[:, 1]).max() < 1e-6


def test_weights_are_between_0_and_1(mesh: Mesh) -> None:
    curves = mouth_weights(figure(), mesh, [*POSES.values(), *SAID.values()])
    assert min(curve.min() for curve in curves.values()) >= 0
    assert max(curve.max() for curve in curves.values()) <= 1
