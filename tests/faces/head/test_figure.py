import numpy as np
import pytest

from faces.head.motions import mouth_rows
from lipmotion.meshes.model.mesh import Mesh
from lipmotion_faces.base import rotate_head
from lipmotion_faces.head.part import MOUTH_Y, head
from lipmotion_faces.head.pose import CharacterPose
from lipmotion_faces.head.skin import REST, VISIBLE_RINGS
from lipmotion_faces.head.stage import POSES, SIDED_POSES, camera_for, figure, head_mesh, mouth_weights
from meshes.heads import shaped

VIEWER = camera_for(640, 360).place
OPEN = CharacterPose(gap=0.25, upper_rise=0.04, jaw=0.18)


def rows(name: str) -> np.ndarray:
    return figure().place(REST)[0][figure().rows[name]]


def test_eyes_are_one_eye_distance_apart_at_their_outer_corners_and_normals_of_length_one():
    corners = [figure().place(REST)[0][figure().skin.lid_rows(eye)[1]] for eye in (0, 1)]
    assert corners[0][:, 0].max() - corners[1][:, 0].min() == pytest.approx(1.0, abs=0.02)
    places, normals = figure().place(OPEN)
    assert np.isfinite(places).all()
    used = np.unique(figure().triangles)
    assert np.linalg.norm(normals[used], axis=1) == pytest.approx(np.ones(len(used)), abs=0.01)


def test_the_head_is_the_same_on_both_sides():
    for name in ("eye", "brow", "ear", "earring", "lashes"):
        other = "right " + name
        assert np.ptp(rows(name), axis=0) == pytest.approx(np.ptp(rows(other), axis=0), abs=1e-9)
        assert rows(name).mean(axis=0) * [-1, 1, 1] == pytest.approx(rows(other).mean(axis=0), abs=1e-9)


def test_the_skin_at_rest_lies_on_its_form():
    skin = figure().skin
    fill = skin.face[(skin.face[:, 1] > MOUTH_Y + 0.4) & (np.abs(skin.face[:, 0]) > 0.02)]
    assert np.abs(head(fill)).max() < 2e-3


def test_opening_moves_chin_and_lips_but_neither_forehead_nor_eyes():
    rest, wide = figure().skin.pose(REST)[0], figure().skin.pose(OPEN)[0]
    moved = np.linalg.norm(wide - rest, axis=1)
    assert moved[rest[:, 1] > -0.4].max() < 0.01
    chin = np.argmin(np.linalg.norm(rest - [0, -1.05, -0.02], axis=1))
    assert (rest - wide)[chin, 1] == pytest.approx(OPEN.jaw, abs=0.03)


def test_shut_eyes_cover_the_eyeballs():
    def apart(**pose) -> np.ndarray:
        height = figure().skin.lids_of_eye.opening(CharacterPose(**pose))[1]
        return height[1:32] - height[:32:-1]

    assert apart(shut=0.0).max() > 0.15
    assert 0.03 < apart(shut=0.5).max() < apart(shut=0.25).max()
    for gaze in ((0.0, 0.0), (0.1, 0.1), (0.0, -0.15)):
        assert apart(shut=1.0, gaze=gaze) == pytest.approx(0, abs=1e-9)


def test_turning_moves_the_head_and_not_the_body_and_keeps_lengths():
    turns = (0, 0, 0), (0.3, 0.1, 0.05)
    straight, aside = (figure().frame(CharacterPose(turn=turn), VIEWER).places for turn in turns)
    body = figure().rows["clothing"]
    assert np.array_equal(straight[body], aside[body])
    nose = int(np.argmax(straight[figure().rows["skin"], 2]))
    assert aside[nose, 0] > straight[nose, 0] + 0.2  # to the character's left
    assert aside[nose, 1] > straight[nose, 1]  # and upwards
    for angles in ((0.3, 0, 0), (0, 0.2, 0), (0, 0, 0.1), (0.2, -0.1, 0.3)):
        matrix = rotate_head(*angles)
        assert matrix @ matrix.T == pytest.approx(np.eye(3), abs=1e-12)
        assert np.linalg.det(matrix) == pytest.approx(1)


def test_the_mouth_is_darker_in_its_depth_and_when_it_closes_and_light_is_at_most_white():
    def brightness(pose: CharacterPose, name: str) -> float:
        return float(figure().frame(pose, VIEWER).light[mouth_rows(figure())[name]].mean())

    assert brightness(OPEN, "wall") < 0.3 * brightness(OPEN, "lips")
    assert brightness(OPEN._replace(roundness=1), "upper teeth") < brightness(OPEN, "upper teeth")
    light = figure().frame(OPEN, VIEWER).light
    seen = np.delete(light, np.r_[figure().rows["catchlights"], figure().rows["right catchlights"]], axis=0)
    assert light.min() >= 0
    assert np.quantile(seen, 0.999) < 1.0


def test_the_mesh_has_the_shapes_that_are_promised(mesh):
    sided = (*SIDED_POSES, "eyeLookIn", "eyeLookOut", "eyeLookUp", "eyeLookDown")
    wanted = {*POSES, *(name + side for name in sided for side in ("Left", "Right"))}
    assert set(mesh.shape_names) == wanted
    assert all(len(shape.rows) for shape in mesh.shapes)
    assert {"skin", "lips", "lids", "teeth", "tongue"} <= {part.name for part in mesh.parts}


def test_a_shape_at_full_weight_is_its_pose(mesh):
    assert shaped(mesh, {"jawOpen": 1.0}) == pytest.approx(figure().place(POSES["jawOpen"])[0], abs=1e-4)
    both = shaped(mesh, {"eyeBlinkLeft": 1.0, "eyeBlinkRight": 1.0})
    assert both == pytest.approx(figure().place(CharacterPose(shut=1))[0], abs=1e-4)


def test_mouth_close_brings_the_lips_of_an_open_jaw_together_and_sided_shapes_leave_the_other_side_alone(mesh):
    lips = figure().skin.lip_rows()[9]
    apart, together = (shaped(mesh, {"jawOpen": 1.0, "mouthClose": closed})[lips] for closed in (0.0, 1.0))
    assert apart[20, 1] - apart[60, 1] > 0.25
    assert together[20, 1] - together[60, 1] < 0.03
    moved = shaped(mesh, {"mouthSmileLeft": 1.0}) - mesh.vertices
    assert np.abs(moved[mesh.vertices[:, 0] < -0.15]).max() < 1e-9
    assert np.abs(moved[mesh.vertices[:, 0] > 0.15]).max() > 0.03


def test_cheeks_come_forward_beside_spread_lips_and_sink_beside_round_ones():
    skin = figure().skin
    cheek = np.argmin(np.linalg.norm(skin.rest[: len(skin.face)] - [0.42, -0.46, -0.1], axis=1))

    def forward(pose: CharacterPose) -> float:
        return float(skin.pose(pose)[0][cheek, 2] - skin.rest[cheek, 2])

    assert forward(CharacterPose(spread=1.0)) > 0.01
    assert forward(CharacterPose(roundness=1.0)) < -0.005


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
        added = sum(weight * moved[mesh.shape_names.index(each)] for each, weight in weights.items())
        found[name] = (mesh.vertices[rows] + added, figure().skin.places(pose))
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
