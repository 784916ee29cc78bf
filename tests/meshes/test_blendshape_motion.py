import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from formats.examples import of_motion
from lipmotion import Staging
from lipmotion.articulation.contact import CLOSED_OPENING, opening_to_gap
from lipmotion.articulation.expression import with_moods
from lipmotion.articulation.liveliness import Liveliness
from lipmotion.articulation.mouth import spoken_mouth
from lipmotion.articulation.phone_targets import FADE_S, crossfade_phones
from lipmotion.articulation.rest import rest_in_pauses
from lipmotion.meshes.fitting import driven, eyes_and_brows, lip_placement, shape_weights
from lipmotion.meshes.fitting.blendshape_motion import (
    arkit_mouth,
    arkit_weights,
    find_own_weights,
    is_of_blendshapes,
    with_mouth,
)
from lipmotion.meshes.model import face_shapes, shape_names, surface
from lipmotion.meshes.model.mesh import ANGLES
from lipmotion.types import WEIGHT, Channel, Motion, Span, Timeline, Unit, delivery
from lipmotion.types.motion import RADIAN
from lipmotion.units import PHONES
from lipmotion_faces.base import stage_liveliness
from lipmotion_faces.head.pose import head_poses
from meshes.heads import head
from meshes.speech import motion, said, units


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
    given = find_own_weights(weights(head_jawOpen=[0.2, 1.4], mouthPucker=[0.1, 0.2]), arkit_mouth())
    assert given.names == arkit_mouth().names
    assert given["jawOpen"].tolist() == [0.2, 1.0]
    assert given["mouthFunnel"].tolist() == [0.0, 0.0]
    for other in (motion(), weights(mouthPucker=[0.1, 0.2])):  # without a jaw
        assert find_own_weights(other, arkit_mouth()) is None
        assert with_mouth(other) is other
        assert not is_of_blendshapes(other)
    facegood = weights(mouth_stretch_c=[0.0, 0.6], mouth_pucker_l=[0.4, 0.0], mouth_pucker_r=[0.4, 0.0])
    found = arkit_weights(facegood)
    assert found["jawOpen"].tolist() == [0.0, 0.6]
    assert found["mouthPucker"].tolist() == pytest.approx([0.4, 0.0])
    assert is_of_blendshapes(facegood)


def test_a_mesh_shows_the_weights_that_are_given() -> None:
    mesh = head()
    placement = lip_placement.place_lips_by_shape(mesh, surface.build_surface(mesh))
    character = driven.DrivenCharacter(mesh, placement, face_shapes.find_face_shapes(mesh, placement), None)
    assert character.shapes is not None
    moved = with_mouth(weights(jawOpen=[0.0, 0.25, 0.5], mouthClose=[0.0] * 3))
    rest, half, whole = character.vertices(moved, Timeline(()), np.arange(3) / 100)
    (jaw,) = (shape for shape in mesh.shapes if shape.name == "jawOpen")
    assert (whole - rest)[jaw.rows] == pytest.approx(0.5 * jaw.displacements, abs=1e-9)
    assert (half - rest)[jaw.rows] == pytest.approx(0.25 * jaw.displacements, abs=1e-9)


TIME_S = np.arange(60) / 30
TALK = Motion(0.1 * np.sin(9 * TIME_S)[:, None] ** 2, 30.0, (Channel("opening"),))


def staged(motion: Motion, seed: int = 0) -> Liveliness:
    return stage_liveliness(TIME_S, with_mouth(motion), Timeline(()), Staging(seed=seed))


def captured(curves: dict[str, object]) -> Motion:
    """Return motion of blendshapes, with the angles of the head that are given."""
    jaw = {"jawOpen": 0.3 * np.sin(9 * TIME_S) ** 2}
    columns = {name: np.broadcast_to(np.asarray(curve, float), TIME_S.shape) for name, curve in (jaw | curves).items()}
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
    pose = head_poses(with_mouth(captured({**curves, "headRoll": 0.2, "noseSneerLeft": 1.0})), Timeline(()), 30.0)[30]
    assert (pose.shut, pose.mood.cheek, pose.mood.sneer, pose.turn[2]) == pytest.approx((0.9, 0.9, 0.5, 0.2))
    assert pose.smile > 0.04


def test_every_phone_has_a_viseme_and_silence_and_closures_have_theirs():
    assert set(shape_weights.VISEME_OF_PHONE) == set(PHONES)
    assert set(shape_weights.VISEME_OF_PHONE.values()) == set(shape_names.VISEMES_15)
    found = shape_weights.weigh_visemes(units(), spoken_mouth(motion(), units()))
    assert found["viseme_sil"][[0, 20, 160, 200]] == pytest.approx([1, 1, 1, 1])
    assert found["viseme_PP"][[55, 95]] == pytest.approx([1, 1])
    assert found["viseme_aa"][75] > 0.9
    assert found["viseme_ou"][115] > 0.6
    nothing, closed = Timeline(()), Motion(np.zeros((5, 1)), 25.0, (Channel("opening"),))
    assert shape_weights.weigh_visemes(nothing, spoken_mouth(closed, nothing))["viseme_sil"] == pytest.approx(
        np.ones(5)
    )


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
    motion = shape_weights.weigh_visemes(said, spoken_mouth(still, said))
    held = shape_weights.weigh_visemes(said, spoken_mouth(still, said), held=True)
    np.testing.assert_allclose(held.values.sum(axis=1), 1, atol=1e-9)
    assert motion.values.sum(axis=1).max() <= 1 + 1e-9
    assert motion.values.min() >= 0
    closed = motion["viseme_sil"] + motion["viseme_PP"]
    contact = spoken_mouth(still, said).contact
    assert closed[contact] == pytest.approx(1)
    assert closed[~contact].max(initial=0) <= shape_weights.MAX_CLOSED_WEIGHT + 1e-9


def test_visemes_follow_how_open_and_how_round_the_mouth_is():
    said = Timeline((Span(0, 1, Unit("s")), Span(1, 1.5, Unit("uw"))))
    found = {}
    for opening in (0.03, 0.1, 0.25):
        still = Motion(np.full((150, 1), opening), 100.0, (Channel("opening"),))
        found[opening] = shape_weights.weigh_visemes(said, spoken_mouth(still, said))
    hissed = [found[opening]["viseme_SS"][50] for opening in (0.03, 0.1)]
    assert 0.2 < hissed[0] < hissed[1] - 0.2
    assert found[0.25]["viseme_aa"][50] > found[0.1]["viseme_aa"][50] + 0.2
    assert found[0.1]["viseme_ou"][95] > 0.1  # the lips round before the vowel
    assert found[0.1]["viseme_ou"][50] < 0.02


def test_phones_fade_around_their_border():
    time_s = np.array([0.9 - FADE_S, 0.9 - 0.02, 0.9, 0.9 + 0.02, 0.9 + FADE_S])
    weights = crossfade_phones(units(), time_s, lambda phone: phone)
    assert weights["p"][2] == pytest.approx(0.5)
    assert weights["aa"][2] == pytest.approx(0.5)
    assert weights["aa"][0] == pytest.approx(1)
    assert 0.5 < weights["aa"][1] < 1


def test_visemes_rest_where_the_curves_do():
    spoken = said((0, 0.5, "aa"), (0.5, 1.1, "sp"), (1.1, 1.6, "aa"))
    held = Motion(np.full((161, 1), 0.1), 100.0, (Channel("opening"),))
    generation = of_motion(held, spoken)
    for style, rests in (("rest", True), ("natural", False)):
        moved = rest_in_pauses(generation, style).motion
        found, arkit = (
            shape_weights.weigh_visemes(spoken, spoken_mouth(moved, spoken)),
            shape_weights.solve_shape_weights(moved, spoken, arkit_mouth()),
        )
        assert (found["viseme_sil"][80] > 0.99) == rests
        assert (arkit["jawOpen"][80] < 0.01) == rests
