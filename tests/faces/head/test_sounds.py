"""Each sound has a mouth that can be named from the picture alone."""

from typing import NamedTuple

import numpy as np
import pytest

from faces.head.motions import parts_seen, said
from lipmotion.articulation.mouth import ROUND_GAP
from lipmotion.types import Channel, Motion
from lipmotion_faces.head.pose import CharacterPose, head_poses
from lipmotion_faces.head.stage import Stage, camera_for
from lipmotion_faces.rendering.rasteriser import Camera

STAGE_SIZE = (360, 300)
UNIT = STAGE_SIZE[1] / 0.8
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
    motion = Motion(values, 100.0, (Channel("opening"), Channel("width")))
    pose = head_poses(motion, said("sil", "ah", phone, "ah", "sil"), 25.0)[25]
    return pose._replace(turn=(0.0, 0.0, 0.0), shut=0.0, gaze=(0.0, 0.0))


@pytest.fixture(scope="module")
def mouths() -> dict[str, Mouth]:
    stage = Stage(Camera(*STAGE_SIZE, (0.0, -0.68), 0.8))
    wanted = {"f": (0.04, 0.0), "uw": (0.045, -0.04), "w": (0.035, -0.045), "aa": (0.17, 0.0), "iy": (0.08, 0.03)}
    mouths = {}
    for phone, (opening, wider) in wanted.items():
        masks = parts_seen(stage, pose_of(phone, opening, wider))
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


def test_w_is_tighter_smaller_and_further_forward_than_oo(mouths):
    assert mouths["w"].inside < 0.78 * mouths["uw"].inside
    oo, w = pose_of("uw", 0.04, -0.04), pose_of("w", 0.04, -0.04)
    assert w.gap < oo.gap - 0.005
    assert w.protrusion > oo.protrusion + 0.01


def test_oo_stays_open_where_the_motion_is_nearly_closed():
    assert pose_of("uw", 0.03, -0.04).gap == pytest.approx(ROUND_GAP, abs=0.005)
    assert pose_of("w", 0.03, -0.04).gap < ROUND_GAP - 0.005


def test_ee_is_a_wide_flat_slot_of_teeth(mouths):
    ee = mouths["iy"]
    width, height = ee.hole
    assert width > 4 * height
    assert ee.seen["upper teeth"] + ee.seen["teeth"] > 0.55 * ee.inside
    assert ee.lips[0] > 1.08 * mouths["aa"].lips[0]


def test_aa_is_taller_and_narrower_than_ee_and_not_filled_with_teeth(mouths):
    aa, ee = mouths["aa"], mouths["iy"]
    assert aa.hole[1] / aa.hole[0] > 2 * ee.hole[1] / ee.hole[0]
    assert aa.seen["wall"] + aa.seen["tongue"] > 0.6 * aa.inside
    assert aa.seen["tongue"] > 0


def test_f_shows_upper_teeth_that_end_in_the_lower_lip(mouths):
    f = mouths["f"]
    assert f.seen["upper teeth"] > 0.9 * f.inside > 0
    assert f.hole[0] < 0.85 * f.lips[0]


def test_teeth_part_when_a_spread_mouth_is_wide_open():
    flat, wide = pose_of("iy", 0.08, 0.03), pose_of("iy", 0.25, 0.03)
    assert flat.bite > 0.4
    assert wide.bite < 0.1


def test_pressed_lips_of_the_motion_come_before_the_phones():
    names = ("opening", "lip_press")
    motion = Motion(np.tile([0.0, 1.0], (41, 1)), 100.0, tuple(map(Channel, names)))
    assert head_poses(motion, said("ah"), 25.0)[5].press == pytest.approx(1.0)


def test_upper_teeth_dominate_in_ee(mouths):
    ee = mouths["iy"]
    assert ee.seen["teeth"] < 0.5 * ee.seen["upper teeth"]


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
    mouth = Stage(camera_for(1280, 720)).picture(pose)[490:540, 600:680].mean(axis=2)
    darkest = ((mouth[:-2] + mouth[1:-1] + mouth[2:]) / 3).min(axis=0)
    assert np.abs(np.diff(darkest)).mean() < 1.3
    assert darkest.mean() < 0.75 * mouth.mean()
