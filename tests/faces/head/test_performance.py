from typing import Any, NamedTuple

import numpy as np
import pytest

from faces.head.motions import NOTHING_SAID, opening, parts_seen, said, steady
from lipmotion import Staging, errors, types
from lipmotion.units import LIP_CLOSING
from lipmotion_faces import head, make_face, testing
from lipmotion_faces.head import CharacterPose, list_head_poses
from lipmotion_faces.head.stage import Stage, make_camera
from lipmotion_faces.rendering.drawn_surface import Camera


def middle(phone: str, value: float = 0.08, before: str = "ah", after: str = "ah"):
    """Return the pose in the middle of a phone."""
    phones = (before, phone, after)
    return list_head_poses(steady(phones, value), said(*phones), 25.0)[15]


def test_p_b_and_m_are_closed_exactly_whatever_the_motion_is():
    for value, phone in enumerate(sorted(LIP_CLOSING)):
        poses = list_head_poses(steady(("aa", phone, "aa"), 0.04 * value), said("aa", phone, "aa"), 25.0)
        assert min(pose.gap for pose in poses[10:20]) == 0
        assert poses[15].press > 0.9


def test_each_sound_has_its_own_shape():
    f, th, oo, ee, n, s = (middle(phone) for phone in ("f", "th", "uw", "iy", "n", "s"))
    aa = middle("aa", 0.18)
    assert min(f.tuck, th.tongue_out, aa.oval, s.bite) > 0.9
    assert oo.roundness > 0.75
    assert max(pose.tuck for pose in (th, oo, aa, ee, n, s)) < 0.1
    assert max(pose.tongue_out for pose in (f, oo, aa, ee, n, s)) < 0.1
    assert max(pose.roundness for pose in (f, th, aa, ee, n, s)) < 0.2
    assert max(pose.bite for pose in (f, th, oo, aa)) < 0.1
    assert 0.2 < n.tongue_up < 0.4 < n.bite < 0.75
    assert oo.protrusion > 0.05
    assert oo.width < aa.width < ee.width


def test_articulatory_channels_of_the_motion_come_before_the_phones():
    names = ("opening", "tongue", "lip_tuck", "teeth", "lip_press")
    motion = types.Motion(np.tile([0.08, 1.0, 0.0, 1.0, 0.0], (31, 1)), 25.0, tuple(map(types.Channel, names)))
    pose = list_head_poses(motion, said("f", "aa", "f"), 25.0)[15]
    assert pose.tongue_out > 0.99
    assert pose.bite > 0.99
    assert list_head_poses(motion, said("f", "f", "f"), 25.0)[15].tuck < 0.01
    pressed = types.Motion(np.tile([0.0, 1.0], (41, 1)), 100.0, tuple(map(types.Channel, ("opening", "lip_press"))))
    assert list_head_poses(pressed, said("ah"), 25.0)[5].press == pytest.approx(1.0)
    with pytest.raises(errors.InputError, match="no channel 'opening'"):
        list_head_poses(types.Motion(np.zeros((3, 1)), 25.0, (types.Channel("width"),)), NOTHING_SAID, 25.0)
    with pytest.raises(errors.InputError, match="frame rate"):
        list_head_poses(opening(0.0), NOTHING_SAID, 0.0)


STAGE_SIZE = (360, 300)
REST_WIDTH = 0.57


class Mouth(NamedTuple):
    """What is seen of a mouth: pixels of its parts, and width and height of the hole and of the lips, in pixels."""

    seen: dict[str, int]
    hole: tuple[int, int]
    lips: tuple[int, int]

    @property
    def inside(self) -> int:
        """The pixels of all that is between the lips."""
        return sum(count for name, count in self.seen.items() if name != "lips")


def pose_of(phone: str, opening: float, wider: float = 0.0) -> CharacterPose:
    """Return the pose in the middle of a phone between two vowels, the head straight and the eyes open."""
    row = (opening, REST_WIDTH + wider)
    rest = (0.0, REST_WIDTH)
    values = np.array([rest] * 40 + [row] * 120 + [rest] * 40)
    motion = types.Motion(values, 100.0, (types.Channel("opening"), types.Channel("width")))
    pose = list_head_poses(motion, said("sil", "ah", phone, "ah", "sil"), 25.0)[25]
    return pose._replace(turn=(0.0, 0.0, 0.0), shut=0.0, gaze=(0.0, 0.0))


@pytest.fixture(scope="module")
def mouths() -> dict[str, Mouth]:
    stage = Stage(Camera(*STAGE_SIZE, (0.0, -0.68), 0.8))
    wanted = {"f": (0.04, 0.0), "uw": (0.045, -0.04), "w": (0.035, -0.045), "aa": (0.17, 0.0), "iy": (0.08, 0.03)}
    mouths = {}
    for phone, (gap, wider) in wanted.items():
        masks = parts_seen(stage, pose_of(phone, gap, wider))
        lips = masks.pop("lips")
        inside = np.logical_or.reduce(list(masks.values()))
        seen = {name: int(mask.sum()) for name, mask in masks.items()} | {"lips": int(lips.sum())}
        mouths[phone] = Mouth(seen, size(inside), size(lips | inside))
    return mouths


def size(mask: np.ndarray) -> tuple[int, int]:
    y, x = np.nonzero(mask)
    return int(np.ptp(x)) + 1, int(np.ptp(y)) + 1


def test_oo_is_a_small_round_hole_without_lower_teeth(mouths):
    oo = mouths["uw"]
    width, height = oo.hole
    assert 0.8 < width / height < 3.0
    assert oo.seen["teeth"] == 0
    assert oo.seen["upper teeth"] < 0.2 * oo.inside
    assert oo.lips[0] < 0.92 * mouths["aa"].lips[0]


def test_ee_is_a_wide_flat_slot_of_teeth(mouths):
    ee = mouths["iy"]
    width, height = ee.hole
    assert width > 4 * height
    assert ee.seen["upper teeth"] + ee.seen["teeth"] > 0.55 * ee.inside
    assert ee.lips[0] > 1.08 * mouths["aa"].lips[0]
    assert ee.seen["teeth"] < 0.5 * ee.seen["upper teeth"]


def test_aa_is_taller_and_narrower_than_ee_and_not_filled_with_teeth(mouths):
    aa, ee = mouths["aa"], mouths["iy"]
    assert aa.hole[1] / aa.hole[0] > 2 * ee.hole[1] / ee.hole[0]
    assert aa.seen["wall"] + aa.seen["tongue"] > 0.6 * aa.inside
    assert aa.seen["tongue"] > 0


def test_f_shows_upper_teeth_that_end_in_the_lower_lip(mouths):
    f = mouths["f"]
    assert f.seen["upper teeth"] > 0.9 * f.inside > 0
    assert f.hole[0] < 0.85 * f.lips[0]


def test_the_tongue_of_th_is_seen_and_is_narrower_than_the_mouth():
    masks = parts_seen(Stage(Camera(*STAGE_SIZE, (0.0, -0.68), 0.8)), pose_of("th", 0.05))
    inside = size(np.logical_or.reduce([mask for name, mask in masks.items() if name != "lips"]))
    tongue = masks["tongue"]
    assert 0.25 * inside[0] < size(tongue)[0] < 0.6 * inside[0]
    rows = np.flatnonzero(tongue.any(axis=1))
    top, middle = tongue[rows[1]].sum(), tongue[rows[len(rows) // 2]].sum()
    assert top < 0.85 * middle  # rounded, not a slab
    assert masks["upper teeth"].sum() > 0


@pytest.mark.parametrize("pose", [CharacterPose(), CharacterPose(press=1, bite=1)])
def test_the_seam_of_closed_lips_is_a_smooth_line(pose):
    """The darkest place, three pixels high, changes little from column to column, in a picture of 720 lines."""
    mouth = Stage(make_camera(1280, 720)).draw(pose)[490:540, 600:680].mean(axis=2)
    darkest = ((mouth[:-2] + mouth[1:-1] + mouth[2:]) / 3).min(axis=0)
    assert np.abs(np.diff(darkest)).mean() < 1.3
    assert darkest.mean() < 0.75 * mouth.mean()


def test_the_head_is_a_face_like_all_others_and_an_unusable_size_is_refused_at_once():
    testing.check_face(make_face("head"))
    for size in ((63, 120), (160, 0), (129, 120)):
        with pytest.raises(errors.InputError, match="even number of at least 64"):
            head.Head(size=size).render(opening(0), NOTHING_SAID)


@pytest.fixture(scope="module")
def front() -> Stage:
    return Stage(Camera(240, 200, (0.0, -0.68), 0.8))


def areas(stage: Stage, **pose: Any) -> dict[str, int]:
    return {name: int(mask.sum()) for name, mask in parts_seen(stage, CharacterPose(**pose)).items()}


def test_closed_lips_show_nothing_of_the_mouth(front):
    for pose in ({}, {"press": 1.0}, {"roundness": 1.0, "width": 0.7, "protrusion": 0.085}):
        seen = areas(front, **pose)
        assert seen.pop("lips") > 800
        assert seen == {"wall": 0, "tongue": 0, "teeth": 0, "upper teeth": 0}


def test_a_picture_of_the_moving_part_is_the_whole_picture():
    stage, pose = Stage(make_camera(320, 240)), CharacterPose(gap=0.1, turn=(0.2, 0.05, 0.0))
    drawn = stage.figure.shade(pose, stage.canvas.camera.place)
    whole = stage.canvas.draw(*drawn, stage.figure.triangles)
    assert np.array_equal(stage.draw(pose), whole)


def first(motion=None, **settings: Any) -> np.ndarray:
    face = head.Head(Staging(size=120, **settings))
    return next(iter(face.render(opening(*[0.1] * 5) if motion is None else motion, NOTHING_SAID)))


def test_a_transparent_picture_over_a_colour_is_the_picture_on_that_colour():
    clear, on_grey = first(background="transparent").astype(float), first(background="#808080").astype(float)
    alpha = clear[..., 3:] / 255
    over = alpha * clear[..., :3] + (1 - alpha) * 128
    whole = (alpha[..., 0] == 0) | (alpha[..., 0] == 1)
    assert np.abs(over - on_grey)[whole].max() <= 1
    assert np.abs(over - on_grey).max() < 40  # edges are mixed as light, not as grey levels
    assert 0.2 < (alpha == 0).mean() < 0.9
