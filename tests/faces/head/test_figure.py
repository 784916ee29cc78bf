import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from faces.head.motions import mouth_rows
from lipmotion.meshes.model.mesh import Mesh
from lipmotion_faces.base import rotate_head
from lipmotion_faces.head import CharacterPose
from lipmotion_faces.head.inside import LOWER_EDGE, measure_drop
from lipmotion_faces.head.skin import (
    ARCH,
    COLUMNS,
    REST,
    TEETH_EDGE,
    TEETH_Z,
    VISIBLE_RINGS,
    move_jaw,
    place_lips,
    place_sections,
)
from lipmotion_faces.head.stage import POSES, SIDED_POSES, build_head_mesh, fit_mouth_weights, make_camera, make_figure
from meshes.heads import shaped

VIEWER = make_camera(640, 360).place
OPEN = CharacterPose(gap=0.25, upper_rise=0.04, jaw=0.18)


def rows(name: str) -> np.ndarray:
    return make_figure().place(REST)[0][make_figure().rows[name]]


def test_eyes_are_one_eye_distance_apart_at_their_outer_corners_and_normals_of_length_one():
    corners = [make_figure().place(REST)[0][make_figure().skin.list_lid_rows(eye)[1]] for eye in (0, 1)]
    assert corners[0][:, 0].max() - corners[1][:, 0].min() == pytest.approx(1.0, abs=0.02)
    places, normals = make_figure().place(OPEN)
    assert np.isfinite(places).all()
    used = np.unique(make_figure().triangles)
    np.testing.assert_allclose(
        np.linalg.norm(normals[used], axis=1), np.ones(len(used)), rtol=0, atol=0.01, equal_nan=False
    )


def test_the_head_is_the_same_on_both_sides():
    for name in ("eye", "brow", "ear", "earring", "lashes"):
        other = "right " + name
        assert np.ptp(rows(name), axis=0) == pytest.approx(np.ptp(rows(other), axis=0), abs=1e-9)
        assert rows(name).mean(axis=0) * [-1, 1, 1] == pytest.approx(rows(other).mean(axis=0), abs=1e-9)


def test_opening_moves_chin_and_lips_but_neither_forehead_nor_eyes():
    rest, wide = make_figure().skin.pose(REST)[0], make_figure().skin.pose(OPEN)[0]
    moved = np.linalg.norm(wide - rest, axis=1)
    assert moved[rest[:, 1] > -0.4].max() < 0.01
    chin = np.argmin(np.linalg.norm(rest - [0, -1.05, -0.02], axis=1))
    assert (rest - wide)[chin, 1] == pytest.approx(OPEN.jaw, abs=0.03)


def test_shut_eyes_cover_the_eyeballs():
    def apart(**pose) -> np.ndarray:
        height = make_figure().skin.lids_of_eye.place_opening(CharacterPose(**pose))[1]
        return height[1:32] - height[:32:-1]

    assert apart(shut=0.0).max() > 0.15
    assert 0.03 < apart(shut=0.5).max() < apart(shut=0.25).max()
    for gaze in ((0.0, 0.0), (0.1, 0.1), (0.0, -0.15)):
        assert apart(shut=1.0, gaze=gaze) == pytest.approx(0, abs=1e-9)


def test_turning_moves_the_head_and_not_the_body_and_keeps_lengths():
    turns = (0, 0, 0), (0.3, 0.1, 0.05)
    straight, aside = (make_figure().shade(CharacterPose(turn=turn), VIEWER)[0] for turn in turns)
    body = make_figure().rows["clothing"]
    assert np.array_equal(straight[body], aside[body])
    nose = int(np.argmax(straight[make_figure().rows["skin"], 2]))
    assert aside[nose, 0] > straight[nose, 0] + 0.2  # to the character's left
    assert aside[nose, 1] > straight[nose, 1]  # and upwards
    for angles in ((0.3, 0, 0), (0, 0.2, 0), (0, 0, 0.1), (0.2, -0.1, 0.3)):
        matrix = rotate_head(*angles)
        assert matrix @ matrix.T == pytest.approx(np.eye(3), abs=1e-12)
        assert np.linalg.det(matrix) == pytest.approx(1)


def test_the_mouth_is_darker_in_its_depth_and_when_it_closes_and_light_is_at_most_white():
    def brightness(pose: CharacterPose, name: str) -> float:
        return float(make_figure().shade(pose, VIEWER)[1][mouth_rows(make_figure())[name]].mean())

    assert brightness(OPEN, "wall") < 0.3 * brightness(OPEN, "lips")
    assert brightness(OPEN._replace(roundness=1), "upper teeth") < brightness(OPEN, "upper teeth")
    light = make_figure().shade(OPEN, VIEWER)[1]
    seen = np.delete(light, np.r_[make_figure().rows["catchlights"], make_figure().rows["right catchlights"]], axis=0)
    assert light.min() >= 0
    assert np.quantile(seen, 0.999) < 1.0


def test_the_mesh_has_the_shapes_that_are_promised(mesh):
    sided = (*SIDED_POSES, "eyeLookIn", "eyeLookOut", "eyeLookUp", "eyeLookDown")
    wanted = {*POSES, *(name + side for name in sided for side in ("Left", "Right"))}
    assert set(mesh.shape_names) == wanted
    assert all(len(shape.rows) for shape in mesh.shapes)
    assert {"skin", "lips", "lids", "teeth", "tongue"} <= {part.name for part in mesh.parts}


def test_mouth_close_brings_the_lips_of_an_open_jaw_together_and_sided_shapes_leave_the_other_side_alone(mesh):
    lips = make_figure().skin.list_lip_rows()[9]
    apart, together = (shaped(mesh, {"jawOpen": 1.0, "mouthClose": closed})[lips] for closed in (0.0, 1.0))
    assert apart[20, 1] - apart[60, 1] > 0.25
    assert together[20, 1] - together[60, 1] < 0.03
    moved = shaped(mesh, {"mouthSmileLeft": 1.0}) - mesh.vertices
    assert np.abs(moved[mesh.vertices[:, 0] < -0.15]).max() < 1e-9
    assert np.abs(moved[mesh.vertices[:, 0] > 0.15]).max() > 0.03


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
    return build_head_mesh(make_figure())


@pytest.fixture(scope="module")
def places(mesh: Mesh) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """The skin of each pose as sums of blendshapes, and as it is drawn; each is held for ten frames."""
    held = [pose for pose in SAID.values() for _ in range(10)]
    curves = fit_mouth_weights(make_figure(), mesh, held)
    rows = np.arange(len(make_figure().skin.rest))
    moved = mesh.displacements(rows)
    found = {}
    for number, (name, pose) in enumerate(SAID.items()):
        weights = {each: float(curve[10 * number + 5]) for each, curve in curves.items()}
        added = sum(weight * moved[mesh.shape_names.index(each)] for each, weight in weights.items())
        found[name] = (mesh.vertices[rows] + added, make_figure().skin.place(pose))
    return found


def test_the_lips_are_where_they_are_drawn(places: dict[str, tuple[np.ndarray, np.ndarray]]) -> None:
    rings = make_figure().skin.list_lip_rows()
    lips, ring = rings[:10].ravel(), rings[VISIBLE_RINGS - 1]
    for name, (summed, drawn) in places.items():
        assert np.abs(summed - drawn)[lips].max() < 0.07, name
        assert np.abs(summed - drawn)[lips].mean() < 0.018, name
        gaps = [float(each[ring[20], 1] - each[ring[60], 1]) for each in (summed, drawn)]
        assert gaps[0] == pytest.approx(gaps[1], abs=0.012), name


def test_closed_lips_are_those_of_the_rest_pose(mesh: Mesh) -> None:
    closed = [CharacterPose(gap=0.0, jaw=jaw, width=width) for jaw in (0.0, 0.06, 0.1) for width in (0.9, 1.0, 1.05)]
    curves = fit_mouth_weights(make_figure(), mesh, closed)
    ring = make_figure().skin.list_lip_rows()[VISIBLE_RINGS - 1]
    moved = mesh.displacements(ring[[20, 60]])[:, :, 1]
    table = np.stack(list(curves.values()), axis=1)
    change = table @ np.stack([moved[mesh.shape_names.index(name)] for name in curves])
    assert np.abs(change[:, 0] - change[:, 1]).max() < 1e-6


MEET, FRONT = 4, 15  # the point of the cross-section where the lips meet, and the rings before the wall of the mouth
PAIRS = [(k, COLUMNS - k) for k in range(1, 40)]
"""Columns of the upper lip, and the column of the lower lip at the same place."""
SHARES = st.floats(0, 1)


@st.composite
def poses(draw) -> CharacterPose:
    gap = draw(st.floats(0, 0.3))
    roundness = draw(SHARES)
    return CharacterPose(
        gap=gap, upper_rise=gap * draw(st.floats(0.15, 0.5)), jaw=0.85 * gap, width=draw(st.floats(0.65, 1.25)),
        fullness=draw(st.floats(0.75, 1.25)), roundness=roundness, spread=draw(SHARES) * (1 - roundness),
        protrusion=(0.08 + 0.035 * draw(SHARES)) * roundness, bite=draw(SHARES), oval=draw(SHARES),
    )  # fmt: skip


def contact(pose: CharacterPose) -> np.ndarray:
    """Return where each column of the lips would meet the other lip [shape=(COLUMNS, 3)]."""
    return place_sections(pose, make_figure().skin.base_z)[MEET]


def test_closed_lips_meet_at_every_column():
    rounded = {"roundness": 1, "protrusion": 0.08, "width": 0.7}, {"roundness": 0.6, "press": 0.7, "protrusion": 0.05}
    wide = {"width": 1.2}, {"width": 1.1, "spread": 1}, {"width": 0.9, "oval": 1}
    for gestures in ({}, {"press": 1}, *rounded, *wide):
        places = contact(CharacterPose(**gestures))
        for upper, lower in PAIRS:
            assert places[upper] == pytest.approx(places[lower], abs=1e-12)


@given(poses())
@settings(max_examples=20)
def test_the_gap_is_as_asked_and_lips_never_cross(pose):
    places = contact(pose)
    assert places[20, 1] - places[60, 1] == pytest.approx(pose.gap, abs=1e-9)
    assert min(places[upper, 1] - places[lower, 1] for upper, lower in PAIRS) > -1e-9


@given(poses(), SHARES, SHARES)
@settings(max_examples=30)
def test_lips_never_reach_into_the_teeth(pose, tuck, press):
    """What is above the edge of the upper teeth is before them; what is below the lower edge is before those."""
    moved = pose._replace(
        tuck=tuck, upper_rise=max(pose.upper_rise, 0.054 * tuck), gap=max(pose.gap, 0.054 * tuck), press=press
    )
    lips = place_lips(place_sections(moved, make_figure().skin.base_z))[:FRONT].reshape(-1, 3)
    teeth = TEETH_Z - ARCH * lips[:, 0] ** 2
    beside = (lips[:, 1] > TEETH_EDGE) & (np.abs(lips[:, 0]) < 0.24)
    assert (lips[beside, 2] - teeth[beside]).min() > 0.003
    edge = move_jaw(np.array([[0, LOWER_EDGE, TEETH_Z - 0.045]]), measure_drop(moved))[0]
    below = (lips[:, 1] < edge[1]) & (np.abs(lips[:, 0]) < 0.2)
    if below.any():
        assert (lips[below, 2] - (edge[2] - ARCH * lips[below, 0] ** 2)).min() > 0.003


def test_round_lips_have_a_narrower_hole_and_lie_further_forward():
    """The hole is where the lips are at least a hundredth of an eye distance apart."""

    def hole(pose: CharacterPose) -> tuple[float, float]:
        places = contact(pose)
        apart = [places[a, 1] - places[b, 1] > 0.01 for a, b in PAIRS]
        inside = places[[a for (a, _), is_apart in zip(PAIRS, apart, strict=True) if is_apart], 0]
        return float(np.ptp(inside)), float(places[20, 2])

    flat, flat_z = hole(CharacterPose(gap=0.07, upper_rise=0.02))
    round_, round_z = hole(CharacterPose(gap=0.07, upper_rise=0.03, roundness=1, protrusion=0.085, width=0.8))
    assert round_ < 0.5 * flat
    assert round_z > flat_z + 0.06


def test_pressed_lips_are_thinner():
    contours = (place_sections(CharacterPose(press=press), make_figure().skin.base_z)[0] for press in (0, 1))
    free, pressed = (contour[20, 1] - contour[60, 1] for contour in contours)
    assert pressed == pytest.approx(0.65 * free, rel=0.05)


def test_a_round_hole_is_an_ellipse_that_nothing_behind_it_narrows():
    for gap in (0.028, 0.04, 0.06, 0.1):
        pose = CharacterPose(gap=gap, upper_rise=0.48 * gap, width=0.75, roundness=1, protrusion=0.08)
        surface = place_lips(place_sections(pose, make_figure().skin.base_z))
        rim = surface[VISIBLE_RINGS - 1]
        line = np.interp(np.abs(rim[:, 0]), rim[20:41, 0], 0.5 * (rim[20:41, 1] + rim[60 - np.arange(21), 1]))
        half_width, half_height = rim[:, 0].max(), 0.5 * (rim[20, 1] - rim[60, 1])
        away = np.hypot(rim[:, 0] / half_width, (rim[:, 1] - line) / half_height)
        assert np.abs(away - 1).max() < 0.06
        behind = surface[VISIBLE_RINGS : VISIBLE_RINGS + 4]
        assert behind[:, :, 0].max(axis=1).min() >= half_width - 1e-9
