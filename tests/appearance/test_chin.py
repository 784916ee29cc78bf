"""The chin of a drawn face, moved by a known distance."""

from __future__ import annotations

import numpy as np
import pytest

from lipmotion.appearance.chin import LARGEST_PX, LEAST_PX, NECK_PX, SIDE_PX, STILL_PX, moved_part, with_chin_moved
from lipmotion.appearance.lower_face import CORNER, HEIGHT, WIDTH, FaceShape, replaced_part

CHIN_PX = 118.0


def with_line(chin_px: float = CHIN_PX, scale: int = 1, count: int = 1) -> np.ndarray:
    """Lower faces of one colour, with a soft dark line at the tip of the chin."""
    y = (np.arange(HEIGHT * scale) + 0.5) / scale + CORNER[1]
    levels = 180 - 120 * np.exp(-(((y - chin_px) / 1.5) ** 2))
    picture = np.repeat(np.repeat(levels[:, None], WIDTH * scale, axis=1)[..., None], 3, axis=2)
    return np.repeat(np.rint(picture).astype(np.uint8)[None], count, axis=0)


def line_px(picture: np.ndarray, x: float = 0.0) -> float:
    """Return how far the line is below the eyes in one column, to a fraction of a pixel."""
    scale = picture.shape[0] // HEIGHT
    column = round((x - CORNER[0]) * scale - 0.5)
    darkness = 180.0 - picture[:, column, 0]
    y = (np.arange(len(picture)) + 0.5) / scale + CORNER[1]
    return float((y * darkness).sum() / darkness.sum())


@pytest.mark.parametrize("scale", [1, 2])
@pytest.mark.parametrize("drop_px", [-9.0, -3.5, -0.4, 0.3, 2.0, 6.7, 12.0])
def test_the_tip_moves_as_far_as_it_should(drop_px: float, scale: int) -> None:
    picture = with_line(scale=scale)
    moved = with_chin_moved(picture, np.array([CHIN_PX]), np.array([drop_px]))
    assert moved.dtype == np.uint8
    assert line_px(moved[0]) - line_px(picture[0]) == pytest.approx(drop_px, abs=0.15)


def test_every_frame_moves_by_its_own_distance() -> None:
    drops = np.array([0.0, 4.0, -6.0, 1.0])
    moved = with_chin_moved(with_line(count=4), np.full(4, CHIN_PX), drops)
    assert [line_px(picture) - line_px(with_line()[0]) for picture in moved] == pytest.approx(drops, abs=0.15)


def test_the_chin_may_be_elsewhere_in_every_frame() -> None:
    chins = np.array([112.0, 125.0])
    pictures = np.concatenate([with_line(chin) for chin in chins])
    moved = with_chin_moved(pictures, chins, np.full(2, 5.0))
    assert [line_px(picture) for picture in moved] == pytest.approx(chins + 5, abs=0.3)


@pytest.mark.parametrize(("wanted", "done"), [(40.0, LARGEST_PX), (-40.0, -LARGEST_PX)])
def test_it_does_not_move_further_than_a_neck_allows(wanted: float, done: float) -> None:
    moved, limit = (with_chin_moved(with_line(), np.array([CHIN_PX]), np.array([drop])) for drop in (wanted, done))
    assert np.array_equal(moved, limit)


def test_what_does_not_move_stays_to_the_bit() -> None:
    noise = np.random.default_rng(0).integers(0, 256, (2, HEIGHT, WIDTH, 3), np.uint8)
    before = noise.copy()
    still = with_chin_moved(noise, np.full(2, CHIN_PX), np.array([0.0, 0.9 * LEAST_PX]))
    assert np.array_equal(still, before)
    moved = with_chin_moved(noise, np.full(2, CHIN_PX), np.array([8.0, -8.0]))
    assert np.array_equal(noise, before)  # the given pictures are not changed
    y = np.arange(HEIGHT) + 0.5 + CORNER[1]
    x = np.abs(np.arange(WIDTH) + 0.5 + CORNER[0])
    untouched = (y[:, None] < STILL_PX) | (y[:, None] > CHIN_PX + 8 + 4 + NECK_PX) | (x[None] >= SIDE_PX[1])
    assert np.array_equal(moved[:, untouched], before[:, untouched])
    assert (moved != before)[:, ~untouched].mean() > 0.5


def test_the_jaw_moves_less_towards_its_joints() -> None:
    picture = with_line()
    moved = with_chin_moved(picture, np.array([CHIN_PX]), np.array([10.0]))
    steps = [line_px(moved[0], x) - line_px(picture[0], x) for x in (0.5, 20.5, 40.5, 50.5)]
    assert steps[0] > steps[1] + 0.3 > steps[2] + 1 > steps[3]
    mirrored = [line_px(moved[0], -x) - line_px(picture[0], -x) for x in (0.5, 20.5, 40.5, 50.5)]
    assert mirrored == pytest.approx(steps, abs=0.05)


def test_nothing_folds_and_nothing_is_torn() -> None:
    """Rows keep their order: a picture that gets lighter downwards still does."""
    ramp = np.repeat(np.repeat(np.arange(HEIGHT, dtype=np.uint8)[:, None], WIDTH, axis=1)[..., None], 3, axis=2)
    for drop in (-LARGEST_PX, LARGEST_PX):
        moved = with_chin_moved(ramp[None], np.array([CHIN_PX]), np.array([drop]))[0].astype(int)
        steps = np.diff(moved[:, WIDTH // 2, 0])
        assert steps.min() >= 0
        assert steps.max() <= 4


@pytest.mark.parametrize("scale", [1, 2])
def test_the_part_that_may_differ_holds_all_that_does(scale: int) -> None:
    part = moved_part(scale)
    assert part.shape == (HEIGHT * scale, WIDTH * scale)
    assert not np.concatenate([part[[0, -1]].ravel(), part[:, [0, -1]].ravel()]).any()
    inside = replaced_part(FaceShape(44.0, 120.0), scale)
    assert (part & inside).sum() == inside.sum()


@pytest.mark.parametrize("chin_px", [60.0, 80.0, 86.0, 92.0, 99.0])
@pytest.mark.parametrize("drop_px", [-LARGEST_PX, LARGEST_PX])
def test_short_chins_do_not_fold_or_tear(chin_px: float, drop_px: float) -> None:
    """Those of children, or of what a tracker takes for a chin: they move less."""
    ramp = np.repeat(np.repeat(np.arange(HEIGHT, dtype=np.uint8)[:, None], WIDTH, axis=1)[..., None], 3, axis=2)
    moved = with_chin_moved(ramp[None], np.array([chin_px]), np.array([drop_px]))[0].astype(int)
    above = round(STILL_PX - CORNER[1])
    assert np.array_equal(moved[:above], ramp[:above])
    steps = np.diff(moved[:, WIDTH // 2, 0])
    assert steps.min() >= 0
    assert steps.max() <= 5
