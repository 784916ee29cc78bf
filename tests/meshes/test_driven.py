from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion import Staging
from lipmotion.articulation.contact import CLOSED_OPENING, opening_to_gap
from lipmotion.articulation.expression import with_moods
from lipmotion.articulation.liveliness import Liveliness
from lipmotion.articulation.mouth import find_mouth
from lipmotion.errors import InputError
from lipmotion.meshes.fitting import blendshape_motion, eyes_and_brows, shape_weights
from lipmotion.meshes.fitting.blendshape_motion import arkit_mouth, with_mouth
from lipmotion.meshes.model import face_shapes, rig_tables, shape_names
from lipmotion.meshes.model.mesh import ANGLES, HEAD, JAW, NECK, Bone
from lipmotion.pipeline.outputs.motion_files import as_generation, fit_to_format
from lipmotion.types import WEIGHT, Channel, Motion, Span, Timeline, Unit, delivery
from lipmotion.types.delivery import parse_moods
from lipmotion.types.motion import RADIAN
from lipmotion.units import PHONES
from lipmotion_faces.base import stage_liveliness
from lipmotion_faces.characters import binding, calibration, character_files, gltf_scene
from lipmotion_faces.characters.character_files import JAW_OPEN, load_character, with_jaw
from lipmotion_faces.characters.gltf_document import find_bone_kind
from lipmotion_faces.characters.gltf_scene import merge_bones
from lipmotion_faces.head import list_head_poses
from meshes.gltf import POSITIONS, document, glb, with_skin
from meshes.heads import REPORTED, SEAM, VISEMES, head, lip_points, renamed, shaped, write_glb, write_obj
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
    assert np.corrcoef(gaps, motion().at(TIME_S)[:, 0])[0, 1] > 0.98
    assert max(gaps[14], gaps[24]) < 0.004  # m and p
    assert max(gaps[:10]) < 0.004


def test_only_the_moving_vertices_move_and_finer_shapes_show_no_whole_expressions(files):
    character = load_character(files / "head.glb")
    still = np.setdiff1d(np.arange(len(character.mesh.vertices)), character.moving)
    for vertices in character.vertices(motion(), units(), TIME_S, {"eyeBlinkLeft": np.linspace(0, 1, len(TIME_S))}):
        np.testing.assert_allclose(vertices[still], character.mesh.vertices[still], atol=1e-12)
    eyes = character.mesh.vertices[:, 1] > 2.1
    assert np.abs(vertices - character.mesh.vertices)[eyes, 1].max() == pytest.approx(0.5, abs=1e-5)
    moved = with_moods(motion(), parse_moods("happy"))
    assert not character.expressions(moved, find_mouth(moved, units()))
    weights, plain = (character.weights(of, units()) for of in (moved, motion()))
    assert weights["mouthSmileLeft"][20] > plain["mouthSmileLeft"][20] + 0.5


def test_bindings_are_stored_and_painted(files):
    computed = load_character(files / "head.obj", points=files / "points.csv")
    binding.save_binding(files / "head.binding", computed.binding, computed.mesh)
    binding.write_weights(files / "weights.csv", computed.binding)
    stored = load_character(files / "head.obj", binding=files / "head.binding")
    painted = load_character(files / "head.obj", points=files / "points.csv", binding=files / "weights.csv")
    expected = np.stack([*computed.vertices(motion(), units(), TIME_S)])
    for other in (stored, painted):
        np.testing.assert_allclose([*other.vertices(motion(), units(), TIME_S)], expected, atol=1e-4, rtol=0)


def test_a_mesh_without_blendshapes_needs_points_and_control_points_have_no_weights(files):
    with pytest.raises(InputError, match=r"head\.obj: no blendshape opens the mouth.*name the lip points"):
        load_character(files / "head.obj")
    with pytest.raises(InputError, match="moved by control points"):
        load_character(files / "head.glb", by_points=True).weights(motion(), units())


def _expressive(*names):
    """A head with visemes, and some whole expressions: those whose name begins with ``s`` part the lips."""
    spoken = {own: name for own, name in VISEMES.items() if own != "mouthUpperUpLeft"}
    like = {name: "mouthUpperUpLeft" if name.lower().startswith("s") else "eyeBlinkLeft" for name in names}
    faces = [replace(shape, name=name) for name, own in like.items() for shape in head().shapes if shape.name == own]
    mesh = renamed(spoken)
    return replace(mesh, shapes=(*mesh.shapes, *faces))


def test_whole_expressions_stand_for_moods_where_there_are_no_finer_shapes(tmp_path):
    write_glb(tmp_path / "head.glb", _expressive("Happy", "surprised"))
    character = load_character(tmp_path / "head.glb")
    moved = with_moods(motion(), parse_moods("happy:0.5, afraid at 1.5"))
    weights = character.expressions(moved, find_mouth(moved, units()))
    assert {*weights} == {"Happy", "surprised"}
    assert weights["Happy"][:100] == pytest.approx(0.5)
    assert weights["surprised"][-1] == pytest.approx(0.5)
    shut = with_moods(motion(), parse_moods("afraid"))
    surprised = character.expressions(shut, find_mouth(shut, units()))["surprised"]
    assert surprised[[20, 75]] == pytest.approx(0.5, abs=0.05)
    assert surprised[[55, 95]] == pytest.approx(0, abs=0.01)  # m, p
    plain, happy = (next(character.vertices(of, units(), TIME_S)) for of in (motion(), moved))
    assert np.abs(happy - plain).max() > 0.01


COLUMNS = "control,source,gain,offset\n"
CLOSED = [20, 55, 95]  # frames of silence, m and p


@pytest.fixture
def file(tmp_path):
    write_glb(tmp_path / "head.glb", head())
    return tmp_path / "head.glb"


def _parted(character, weights):
    """How far the middles of the inner lips are apart, in eye distances."""
    rows = character.placement.vertices[[character.placement.row(point) for point in (13, 14)]]
    moved = np.einsum("ts,snd->tnd", weights.values, character.mesh.displacements(rows, weights.names))
    return (moved[:, 0, 1] - moved[:, 1, 1]) / character.placement.scale


def test_any_names_are_understood_by_their_rows(file):
    plain = load_character(file).weights(motion(), units())
    shapes = {shape.name: f"あ {number}" for number, shape in enumerate(head().shapes)}
    halves = [replace(shape, name=shapes[shape.name]) for shape in head().shapes]
    funnel = [shape.name for shape in head().shapes].index("mouthFunnel")
    halves[funnel] = replace(halves[funnel], displacements=halves[funnel].displacements / 2)
    halves.append(replace(next(each for each in halves if each.name == shapes["mouthFunnel"]), name="other half"))
    write_glb(file, replace(head(), shapes=tuple(halves)))
    rows = "".join(f"{own},{known},,\n" for known, own in shapes.items())
    rig_tables.find_table(file).write_text(f"{COLUMNS}{rows}other half,mouthFunnel,,\n", encoding="utf-8")
    character = load_character(file)
    weights = character.weights(motion(), units())
    for name in plain.names:
        np.testing.assert_allclose(weights[shapes[name]], plain[name], atol=1e-4)
    np.testing.assert_array_equal(weights["other half"], weights[shapes["mouthFunnel"]])
    assert character.has_shape("eyeBlinkLeft")
    assert [*character.weigh_others({"eyeBlinkLeft": np.ones(2)}, 2)] == [shapes["eyeBlinkLeft"]]


def test_the_table_of_what_was_found_changes_nothing_and_weights_that_are_given_back_stay(file):
    before = load_character(file)
    calibration.write_rig_table(before.table_file, before.table_rows())
    after = load_character(file)
    assert after.table_rows() == before.table_rows()
    np.testing.assert_array_equal(after.weights(motion(), units()).values, before.weights(motion(), units()).values)
    rig_tables.find_table(file).write_text(f"{COLUMNS}jawOpen,jawOpen,0.5,0.03\nmouthPucker,mouthPucker,1.2,\n")
    character = load_character(file)
    weights = character.weights(motion(), units())
    np.testing.assert_allclose(character.weights(weights, units()).values, weights.values, atol=0.03)


def test_gains_weaken_the_mouth_and_lips_still_touch(file):
    rig_tables.find_table(file).write_text(f"{COLUMNS}jawOpen,jawOpen,0.5,\nmouthPressLeft,mouthPressLeft,1,0.2\n")
    character = load_character(file)
    weights = character.weights(motion(), units())
    whole = load_character(file.rename(file.with_name("other.glb"))).weights(motion(), units())
    assert weights["jawOpen"][75] == pytest.approx(0.5 * whole["jawOpen"][75], abs=0.02)  # aa
    assert _parted(character, weights)[75] < 0.7 * _parted(character, whole)[75]
    assert _parted(character, weights)[CLOSED].max() < 0.004
    assert weights["mouthPressLeft"].min() == pytest.approx(0.2)
    assert np.abs(np.diff(weights.values, axis=0)).max() < 1.5 * np.abs(np.diff(whole.values, axis=0)).max()


@pytest.mark.parametrize(("rows", "message"), REPORTED["tables"])
def test_damaged_tables_are_refused(file, rows, message):
    rig_tables.find_table(file).write_text(COLUMNS + rows)
    with pytest.raises(InputError, match=message):
        load_character(file)


def test_a_head_in_metres_parts_its_lips_as_far_as_in_centimetres(file):
    mesh, found = head(), []
    for unit in (1.3, 0.013):  # 22 cm
        shapes = tuple(replace(each, displacements=unit * each.displacements) for each in mesh.shapes)
        write_glb(file, replace(mesh, vertices=unit * mesh.vertices, shapes=shapes))
        found.append(load_character(file))
    centimetres, metres = found
    assert face_shapes.find_life_scale(centimetres.mesh, centimetres.placement) == pytest.approx(9.0)
    np.testing.assert_allclose(metres.shapes.gap, centimetres.shapes.gap, rtol=1e-3, atol=1e-6)


def with_bone(mesh):
    """A jaw bone that everything below the mouth follows."""
    jaw = next(shape for shape in head().shapes if shape.name == "jawOpen")
    shares = -jaw.displacements[:, 1] / -jaw.displacements[:, 1].min()
    return replace(mesh, bones=(Bone(JAW, np.array([0.0, 10 * SEAM + 2, -9.0]), jaw.rows, shares),))


def test_bones_are_known_by_their_names():
    kinds = REPORTED["bones"]
    assert {name: find_bone_kind(name) for name in kinds} == kinds


def test_a_jaw_bone_opens_the_mouth():
    mesh = with_jaw(with_bone(head(shapes=False)))
    assert mesh.shape_names == (JAW_OPEN,)
    moved = shaped(mesh, {JAW_OPEN: 1}) - mesh.vertices
    chin = int(np.abs(mesh.vertices - [0, -16, 0]).sum(axis=1).argmin())
    assert moved[chin, 1] < -1
    assert np.abs(moved[mesh.vertices[:, 1] > 10 * SEAM + 1]).max() == pytest.approx(0)
    opens = with_bone(head())  # already
    assert with_jaw(opens).shape_names == opens.shape_names
    weak = [replace(s, displacements=s.displacements / 50) for s in opens.shapes]  # the bone does the rest
    assert with_jaw(replace(opens, shapes=tuple(weak))).shape_names == (*opens.shape_names[1:], "jawOpen.001")
    assert with_jaw(head(shapes=False)).shape_names == ()


def test_a_character_with_a_jaw_bone_alone_follows_the_motion(tmp_path):
    """The square of two triangles is no head; the made head has no skin. So the bone is put on the read mesh."""
    path = tmp_path / "head.glb"
    write_glb(path, head(shapes=False))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(character_files, "read_character", lambda _: with_bone(head(shapes=False)))
        character = load_character(path)
    weights = character.weights(motion(), units())
    assert weights.names == (JAW_OPEN,)
    assert np.corrcoef(weights.values[:, 0], motion()["opening"])[0, 1] > 0.95


def test_bones_of_one_kind_become_one():
    one = Bone(HEAD, np.zeros(3), np.array([1, 2]), np.array([0.5, 1.0]))
    two = Bone(HEAD, np.ones(3), np.array([2, 4]), np.array([0.25, 1.0]))
    (merged,) = merge_bones([one, two, Bone(JAW, np.zeros(3), np.zeros(0, int), np.zeros(0))])
    assert merged.rows.tolist() == [1, 2, 4]
    assert merged.shares.tolist() == [0.5, 1.0, 1.0]
    np.testing.assert_array_equal(merged.place, np.zeros(3))


def test_bones_are_read_from_skins_and_nodes(tmp_path):
    content, binary = document()
    joints, weights = np.zeros((4, 4), np.uint8), np.zeros((4, 4), "<f4")
    joints[:, 1], weights[:] = 1, [[1, 0, 0, 0], [1, 0, 0, 0], [0.25, 0.75, 0, 0], [0, 1, 0, 0]]
    content["nodes"] = [{"mesh": 0, "skin": 0}, {"name": "Neck", "translation": [0, 1, 0], "children": [2]}]
    content["nodes"] += [{"name": "Head", "translation": [0, 2, 0], "children": [3]}, {"mesh": 1, "name": "glasses"}]
    content["scenes"] = [{"nodes": [0, 1]}]
    content["skins"] = [{"joints": [1, 2]}]
    content["meshes"].append({"primitives": [{"attributes": {"POSITION": 0}, "indices": 3}]})
    path = tmp_path / "head.glb"
    path.write_bytes(glb(content, with_skin(content, binary, joints, weights)))
    mesh = gltf_scene.read_gltf(path)
    bones = {bone.kind: bone for bone in mesh.bones}
    assert len(mesh.vertices) == 2 * len(POSITIONS)
    assert bones[NECK].rows.tolist() == [*range(8)]
    assert bones[HEAD].rows.tolist() == [2, 3, 4, 5, 6, 7]
    np.testing.assert_allclose(bones[HEAD].shares, [0.75, 1, 1, 1, 1, 1], atol=1e-6)
    np.testing.assert_allclose(bones[HEAD].place, [0, 3, 0], atol=1e-6)


def weights(**curves: list[float]) -> Motion:
    return Motion(np.array(list(curves.values())).T, 100.0, tuple(Channel(name, WEIGHT) for name in curves))


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
    back = with_mouth(shape_weights.solve_shape_weights(said, units(), arkit_mouth()))
    assert np.corrcoef(back["opening"], said["opening"])[0, 1] > 0.99
    assert np.corrcoef(back["width"], said["width"])[0, 1] > 0.9


def test_weights_that_are_given_are_taken_and_other_motion_stays_as_it_is() -> None:
    given = blendshape_motion.find_own_weights(weights(head_jawOpen=[0.2, 1.4], mouthPucker=[0.1, 0.2]), arkit_mouth())
    assert given.names == arkit_mouth().names
    assert given["jawOpen"].tolist() == [0.2, 1.0]
    assert given["mouthFunnel"].tolist() == [0.0, 0.0]
    for other in (motion(), weights(mouthPucker=[0.1, 0.2])):  # without a jaw
        assert blendshape_motion.find_own_weights(other, arkit_mouth()) is None
        assert with_mouth(other) is other
        assert not blendshape_motion.is_of_blendshapes(other)
    facegood = weights(mouth_stretch_c=[0.0, 0.6], mouth_pucker_l=[0.4, 0.0], mouth_pucker_r=[0.4, 0.0])
    found = blendshape_motion.arkit_weights(facegood)
    assert found["jawOpen"].tolist() == [0.0, 0.6]
    assert found["mouthPucker"].tolist() == pytest.approx([0.4, 0.0])
    assert blendshape_motion.is_of_blendshapes(facegood)
    beside = weights(jawOpen=[0.0] * 9, viseme_aa=[0.8] * 9)  # a curve that never moves is no jaw
    assert blendshape_motion.arkit_weights(beside)["jawOpen"][1] > 0.3
    assert blendshape_motion.find_own_weights(beside, arkit_mouth())["jawOpen"][1] > 0.3
    whole = as_generation(beside, Timeline(()))
    assert fit_to_format(Path("a.livelink.csv"), whole, whole, None).motion["jawOpen"].min() > 0.3


TALK_S = np.arange(60) / 30
TALK = Motion(0.1 * np.sin(9 * TALK_S)[:, None] ** 2, 30.0, (Channel("opening"),))


def staged(motion: Motion, seed: int = 0) -> Liveliness:
    return stage_liveliness(TALK_S, with_mouth(motion), Timeline(()), Staging(seed=seed))


def captured(curves: dict[str, object]) -> Motion:
    """Return motion of blendshapes, with the angles of the head that are given."""
    jaw = {"jawOpen": 0.3 * np.sin(9 * TALK_S) ** 2}
    columns = {name: np.broadcast_to(np.asarray(curve, float), TALK_S.shape) for name, curve in (jaw | curves).items()}
    channels = tuple(Channel(name, RADIAN if name in ANGLES else WEIGHT) for name in columns)
    return Motion(np.stack(list(columns.values()), axis=1), 30.0, channels)


@pytest.mark.parametrize("mood", ["", "afraid", "happy", "disgusted"])
def test_a_face_moves_as_in_the_file_of_its_own_curves(mood: str) -> None:
    played = staged(with_moods(TALK, delivery.parse_moods(mood)), seed=3)
    weights = eyes_and_brows.eye_and_brow_weights(played)
    again = staged(captured(weights | dict(zip(ANGLES, played.turn.T, strict=True))), seed=4)
    for name, curve in eyes_and_brows.eye_and_brow_weights(again).items():
        assert curve == pytest.approx(weights.get(name, 0), abs=1e-12), name
    for name in ("lids", "gaze", "turn"):
        assert getattr(again, name) == pytest.approx(getattr(played, name), abs=1e-12), name
    for unit in (4, 5, 6, 9):
        assert again.unit(unit) == pytest.approx(played.unit(unit), abs=1e-12), unit


def test_curves_that_never_move_leave_the_face_to_itself() -> None:
    nothing = {name: np.zeros(60) for names in eyes_and_brows.MOVED_BY.values() for name in names}
    alone, beside = (staged(captured(curves)) for curves in ({}, nothing))
    for name in ("lids", "brows", "gaze", "turn"):
        assert getattr(alone, name).any(), name
        assert np.array_equal(getattr(alone, name), getattr(beside, name)), name
    blinks = staged(captured({**nothing, "eyeBlinkLeft": 0.4}))
    assert blinks.lids == pytest.approx(0.2)
    assert np.array_equal(blinks.turn, alone.turn)


def test_each_side_is_kept_and_a_mood_is_added() -> None:
    tired = with_moods(captured({"browDownLeft": 0.8, "browInnerUp": 0.3}), delivery.parse_moods("tired"))
    weights = eyes_and_brows.eye_and_brow_weights(staged(tired))
    assert weights["browDownLeft"] == pytest.approx(0.8)
    assert weights["browInnerUp"] == pytest.approx(0.3 + 0.1)
    assert not weights["browDownRight"].any()


def test_eyes_hold_their_target_under_a_head_that_is_given() -> None:
    ahead, aside = (staged(captured({"headYaw": yaw})) for yaw in (1e-9, 0.3))
    assert aside.turn[:, 0] == pytest.approx(0.3)
    assert (aside.gaze - ahead.gaze)[:, 0] == pytest.approx(-0.85 * 0.3, abs=1e-6)


def test_the_3d_head_shows_what_was_captured() -> None:
    curves = {f"{name}{side}": 0.9 for name in ("eyeBlink", "cheekSquint", "mouthSmile") for side in ("Left", "Right")}
    poses = list_head_poses(with_mouth(captured({**curves, "headRoll": 0.2, "noseSneerLeft": 1.0})), Timeline(()), 30.0)
    pose = poses[30]
    assert (pose.shut, pose.mood.cheek, pose.mood.sneer, pose.turn[2]) == pytest.approx((0.9, 0.9, 0.5, 0.2))
    assert pose.smile > 0.04


def test_every_phone_has_a_viseme_and_silence_and_closures_have_theirs():
    assert set(shape_weights.VISEME_OF_PHONE) == set(PHONES)
    assert set(shape_weights.VISEME_OF_PHONE.values()) == set(shape_names.VISEMES_15)
    found = shape_weights.weigh_visemes(units(), find_mouth(motion(), units()))
    assert found["viseme_sil"][[0, 20, 160, 200]] == pytest.approx([1, 1, 1, 1])
    assert found["viseme_PP"][[55, 95]] == pytest.approx([1, 1])
    assert found["viseme_aa"][75] > 0.9
    assert found["viseme_ou"][115] > 0.6
    nothing, closed = Timeline(()), Motion(np.zeros((5, 1)), 25.0, (Channel("opening"),))
    assert shape_weights.weigh_visemes(nothing, find_mouth(closed, nothing))["viseme_sil"] == pytest.approx(np.ones(5))


@settings(max_examples=25)
@given(
    st.lists(st.tuples(st.sampled_from(PHONES), st.floats(0.0, 0.3), st.floats(0.0, 0.1)), max_size=12),
    st.floats(10, 120),
    st.sampled_from([0.0, 0.03, 0.1, 0.2]),
)
def test_visemes_add_up_to_1_or_less_and_held_ones_to_1(phones, rate_hz, opening):
    spans, end = [], 0.0
    for phone, duration, gap in phones:
        spans.append(Span(end + gap, end + gap + duration, Unit(phone)))
        end += gap + duration
    frames = int(rate_hz * (end + 0.5)) + 1
    still = Motion(np.full((frames, 1), opening), rate_hz, (Channel("opening"),))
    said = Timeline(tuple(spans))
    motion = shape_weights.weigh_visemes(said, find_mouth(still, said))
    held = shape_weights.weigh_visemes(said, find_mouth(still, said), held=True)
    np.testing.assert_allclose(held.values.sum(axis=1), 1, atol=1e-9)
    assert motion.values.sum(axis=1).max() <= 1 + 1e-9
    assert motion.values.min() >= 0
    closed = motion["viseme_sil"] + motion["viseme_PP"]
    contact = find_mouth(still, said).contact
    assert closed[contact] == pytest.approx(1)
    assert closed[~contact].max(initial=0) <= shape_weights.MAX_CLOSED_WEIGHT + 1e-9


def test_visemes_follow_how_open_and_how_round_the_mouth_is():
    said = Timeline((Span(0, 0.5, Unit("ae")), Span(0.5, 1, Unit("s")), Span(1, 1.5, Unit("uw"))))
    found = {}
    for opening in (0.03, 0.1, 0.25):
        still = Motion(np.full((150, 1), opening), 100.0, (Channel("opening"),))
        found[opening] = shape_weights.weigh_visemes(said, find_mouth(still, said))
    hissed = [found[opening]["viseme_SS"][75] for opening in (0.03, 0.1)]
    assert 0.2 < hissed[0] < hissed[1] - 0.2
    assert found[0.25]["viseme_aa"][25] > found[0.1]["viseme_aa"][25] + 0.2
    assert found[0.1]["viseme_ou"][95] > 0.1  # the lips round before the vowel
    assert found[0.1]["viseme_ou"][75] < 0.02
