import numpy as np
import pytest

from lipmotion_faces.appearance.lower_face import (
    CORNER,
    HEIGHT,
    LARGEST_PX,
    LEAST_PX,
    NECK_PX,
    SIDE_PX,
    STILL_PX,
    WIDTH,
    FaceShape,
    move_chin,
    moved_part,
    replaced_part,
)

CHIN_PX = 118.0


def with_line(chin_px: float = CHIN_PX, scale: int = 1, count: int = 1) -> np.ndarray:
    """Lower faces of one colour, with a soft dark line at the tip of the chin."""
    y = (np.arange(HEIGHT * scale) + 0.5) / scale + CORNER[1]
    levels = np.rint(180 - 120 * np.exp(-(((y - chin_px) / 1.5) ** 2))).astype(np.uint8)
    return np.broadcast_to(levels[:, None, None], (count, HEIGHT * scale, WIDTH * scale, 3)).copy()


def line_px(picture: np.ndarray, x: float = 0.0) -> float:
    """Return how far the line is below the eyes in one column, to a fraction of a pixel."""
    scale = picture.shape[0] // HEIGHT
    column = round((x - CORNER[0]) * scale - 0.5)
    darkness = 180.0 - picture[:, column, 0]
    y = (np.arange(len(picture)) + 0.5) / scale + CORNER[1]
    return float((y * darkness).sum() / darkness.sum())


def test_the_tip_moves_as_far_as_it_should() -> None:
    drops = np.array([-9.0, -0.4, 0.0, 0.3, 6.7, 12.0])
    for scale in (1, 2):
        pictures = with_line(scale=scale, count=len(drops))
        moved = move_chin(pictures, np.full(len(drops), CHIN_PX), drops)
        assert moved.dtype == np.uint8
        assert [line_px(picture) - line_px(pictures[0]) for picture in moved] == pytest.approx(drops, abs=0.15)
    chins = np.array([112.0, 125.0])  # elsewhere in every frame
    moved = move_chin(np.concatenate([with_line(chin) for chin in chins]), chins, np.full(2, 5.0))
    assert [line_px(picture) for picture in moved] == pytest.approx(chins + 5, abs=0.3)
    for wanted, done in ((40.0, LARGEST_PX), (-40.0, -LARGEST_PX)):  # no further than a neck allows
        moved, limit = (move_chin(with_line(), np.array([CHIN_PX]), np.array([drop])) for drop in (wanted, done))
        assert np.array_equal(moved, limit)


def test_what_does_not_move_stays_to_the_bit() -> None:
    noise = np.random.default_rng(0).integers(0, 256, (2, HEIGHT, WIDTH, 3), np.uint8)
    before = noise.copy()
    still = move_chin(noise, np.full(2, CHIN_PX), np.array([0.0, 0.9 * LEAST_PX]))
    assert np.array_equal(still, before)
    moved = move_chin(noise, np.full(2, CHIN_PX), np.array([8.0, -8.0]))
    assert np.array_equal(noise, before)  # the given pictures are not changed
    y = np.arange(HEIGHT) + 0.5 + CORNER[1]
    x = np.abs(np.arange(WIDTH) + 0.5 + CORNER[0])
    untouched = (y[:, None] < STILL_PX) | (y[:, None] > CHIN_PX + 8 + 4 + NECK_PX) | (x[None] >= SIDE_PX[1])
    assert np.array_equal(moved[:, untouched], before[:, untouched])
    assert (moved != before)[:, ~untouched].mean() > 0.5


def test_the_jaw_moves_less_towards_its_joints() -> None:
    picture = with_line()
    moved = move_chin(picture, np.array([CHIN_PX]), np.array([10.0]))
    steps = [line_px(moved[0], x) - line_px(picture[0], x) for x in (0.5, 20.5, 40.5, 50.5)]
    assert steps[0] > steps[1] + 0.3 > steps[2] + 1 > steps[3]
    mirrored = [line_px(moved[0], -x) - line_px(picture[0], -x) for x in (0.5, 20.5, 40.5, 50.5)]
    assert mirrored == pytest.approx(steps, abs=0.05)


def test_the_part_that_may_differ_holds_all_that_does() -> None:
    for scale in (1, 2):
        part = moved_part(scale)
        assert part.shape == (HEIGHT * scale, WIDTH * scale)
        assert not np.concatenate([part[[0, -1]].ravel(), part[:, [0, -1]].ravel()]).any()
        inside = replaced_part(FaceShape(44.0, 120.0), scale)
        assert (part & inside).sum() == inside.sum()


def test_no_chin_folds_or_tears() -> None:
    """A picture that gets lighter downwards still does. Short chins, of children or a tracker's errors, move less."""
    ramp = np.broadcast_to(np.arange(HEIGHT, dtype=np.uint8)[:, None, None], (HEIGHT, WIDTH, 3))
    chins = np.repeat([60.0, 80.0, 86.0, 92.0, 99.0, CHIN_PX], 2)
    drops, above = np.tile([-LARGEST_PX, LARGEST_PX], 6), round(STILL_PX - CORNER[1])
    for moved in move_chin(np.repeat(ramp[None], 12, axis=0), chins, drops).astype(int):
        assert np.array_equal(moved[:above], ramp[:above])
        steps = np.diff(moved[:, WIDTH // 2, 0])
        assert steps.min() >= 0
        assert steps.max() <= 5
