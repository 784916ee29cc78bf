import numpy as np
import pytest

from lipmotion_faces.base import rotate_head
from lipmotion_faces.head.part import MOUTH_Y, head
from lipmotion_faces.head.pose import CharacterPose
from lipmotion_faces.head.skin import REST
from lipmotion_faces.head.stage import POSES, SIDED_POSES, camera_for, figure, head_mesh
from meshes.heads import shaped

VIEWER = camera_for(640, 360).place
OPEN = CharacterPose(gap=0.25, upper_rise=0.04, jaw=0.18)


def rows(name: str) -> np.ndarray:
    return figure().place(REST)[0][figure().rows[name]]


def test_all_parts_are_of_finite_places_and_unit_normals():
    places, normals = figure().place(OPEN)
    assert np.isfinite(places).all()
    used = np.unique(figure().triangles)
    assert np.linalg.norm(normals[used], axis=1) == pytest.approx(np.ones(len(used)), abs=0.01)


def test_eyes_are_one_eye_distance_apart_at_their_outer_corners():
    corners = [figure().place(REST)[0][figure().skin.lid_rows(eye)[1]] for eye in (0, 1)]
    assert corners[0][:, 0].max() - corners[1][:, 0].min() == pytest.approx(1.0, abs=0.02)


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


def test_turning_moves_the_head_and_not_the_body():
    straight, aside = (
        figure().frame(CharacterPose(turn=turn), VIEWER).places for turn in ((0, 0, 0), (0.3, 0.1, 0.05))
    )
    body = figure().rows["clothing"]
    assert np.array_equal(straight[body], aside[body])
    nose = int(np.argmax(straight[figure().rows["skin"], 2]))
    assert aside[nose, 0] > straight[nose, 0] + 0.2  # to the character's left
    assert aside[nose, 1] > straight[nose, 1]  # and upwards


@pytest.mark.parametrize("angles", [(0.3, 0, 0), (0, 0.2, 0), (0, 0, 0.1), (0.2, -0.1, 0.3)])
def test_turns_keep_lengths(angles):
    matrix = rotate_head(*angles)
    assert matrix @ matrix.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(matrix) == pytest.approx(1)


def test_the_mouth_is_darker_in_its_depth_and_when_it_closes():
    def brightness(pose: CharacterPose, name: str) -> float:
        return float(figure().frame(pose, VIEWER).light[figure().mouth_rows()[name]].mean())

    assert brightness(OPEN, "wall") < 0.3 * brightness(OPEN, "lips")
    assert brightness(OPEN._replace(roundness=1), "upper teeth") < brightness(OPEN, "upper teeth")


def test_light_is_between_nothing_and_white():
    light = figure().frame(OPEN, VIEWER).light
    seen = np.delete(light, np.r_[figure().rows["catchlights"], figure().rows["right catchlights"]], axis=0)
    assert light.min() >= 0
    assert np.quantile(seen, 0.999) < 1.0


@pytest.fixture(scope="module")
def mesh():
    return head_mesh(figure())


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


def test_mouth_close_brings_the_lips_of_an_open_jaw_together(mesh):
    lips = figure().skin.lip_rows()[9]
    apart, together = (
        shaped(mesh, weights)[lips] for weights in ({"jawOpen": 1.0}, {"jawOpen": 1.0, "mouthClose": 1.0})
    )
    assert apart[20, 1] - apart[60, 1] > 0.25
    assert together[20, 1] - together[60, 1] < 0.03


def test_sided_shapes_leave_the_other_side_alone(mesh):
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
