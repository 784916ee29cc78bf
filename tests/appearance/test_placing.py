"""What lies where in a lower face, and patches cut out of frames and placed into them."""

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.motion.eigenlips import EYE_DISTANCE_PX, MOUTH_CORNER, MOUTH_HEIGHT, MOUTH_WIDTH
from lipmotion_faces.appearance.lower_face import (
    CHEEK_PX,
    CORNER,
    HEIGHT,
    LARGEST_SCALE,
    MARGIN_PX,
    MIN_BOTTOM_PX,
    NARROWEST_PX,
    SAME_PERSON_LIKENESS,
    TOP_PX,
    WIDEST_PX,
    WIDTH,
    FaceShape,
    choose_scale,
    compare_faces,
    find_mouth_part,
    find_signature,
    map_region,
    mark_mouth,
    mark_replaced,
    measure_cheek_light,
    measure_shape,
)
from lipmotion_faces.appearance.placing import cut, feather, place
from lipmotion_faces.kernels.affine import resample

TURNED = np.array([[0.7, -0.1, 12.3], [0.12, 0.68, 8.6]])


def noise(shape: tuple[int, ...], seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, shape, np.uint8)


def test_whole_pixels_move_exactly_and_pixels_outside_repeat_the_outermost() -> None:
    pictures = noise((2, 20, 30, 3))
    padded = np.pad(pictures, ((0, 0), (4, 4), (4, 4), (0, 0)), "edge")
    for x, y, size in ((0, 0, (20, 30)), (4, 7, (10, 20)), (-4, -4, (28, 38))):
        made = resample(pictures, np.array([[1.0, 0, x], [0, 1, y]]), size)
        assert made == pytest.approx(padded[:, y + 4 : y + 4 + size[0], x + 4 : x + 4 + size[1]], abs=1e-4)


def test_the_weight_rises_from_the_edge() -> None:
    weight = feather(np.ones((30, 40), bool), 6)
    middle = weight[15, :20]
    assert weight.dtype == np.float32
    assert (np.diff(middle[:6]) > 0).all()
    assert middle[5:] == pytest.approx(1)
    assert 0 < middle[0] < 0.1
    assert not feather(np.zeros((5, 5), bool), 3).any()
    with pytest.raises(InputError, match="at least 1"):
        feather(np.ones((5, 5), bool), 0.5)


def test_a_patch_is_placed_where_the_map_says() -> None:
    frame = noise((60, 80, 3))
    before = frame.copy()
    patch = noise((10, 12, 3), 1)
    weight = np.zeros((10, 12), np.float32)
    weight[1:-1, 1:-1] = 1
    place(frame, patch, weight, np.array([[1.0, 0, 30], [0, 1, 20]]))
    assert (frame[21:29, 31:41] == patch[1:-1, 1:-1]).all()
    frame[21:29, 31:41] = before[21:29, 31:41]
    assert (frame == before).all()


def test_the_part_outside_the_frame_is_left_out() -> None:
    """As in a larger frame, of which the frame is a part."""
    patch, weight = noise((20, 24, 3), 1), feather(np.pad(np.ones((18, 22), bool), 1), 3)
    turn = TURNED[:, :2]
    for corner in ((-5.5, -3.0), (75.2, 50.4), (-200.0, 10.0), (10.0, 300.0)):
        large = noise((160, 180, 3))
        small = large[50:110, 50:130].copy()
        place(small, patch, weight, np.column_stack([turn, corner]))
        place(large, patch, weight, np.column_stack([turn, np.add(corner, 50)]))
        assert (small == large[50:110, 50:130]).all()


def test_what_does_not_fit_is_refused() -> None:
    frame, patch, weight = noise((60, 80, 3)), noise((10, 12, 3)), np.ones((10, 12), np.float32)
    with pytest.raises(InputError, match="weight of shape"):
        place(frame, patch, weight[1:], TURNED)
    for affine in (np.zeros((2, 3)), np.eye(3), np.full((2, 3), np.nan)):
        with pytest.raises(InputError, match="affine map"):
            place(frame, patch, weight, affine)
    frames: list[np.ndarray] = [np.zeros((60, 80)), np.zeros((60, 80, 3)), np.zeros((60, 80, 4), np.uint8)]
    for other in frames:
        with pytest.raises(InputError, match="frame of shape"):
            cut(other, TURNED, (10, 12))
        with pytest.raises(InputError, match="frame of shape"):
            place(other, patch, weight, TURNED)


def test_pixels_of_a_large_frame_are_averaged() -> None:
    """A patch whose pixels are blocks of the frame's holds the means of these blocks."""
    frame = noise((60, 90, 3))
    for samples in (2, 3, 5):
        to_frame = np.array([[samples, 0, (samples - 1) / 2], [0, samples, (samples - 1) / 2]], float)
        patch = cut(frame, to_frame, (60 // samples, 90 // samples))
        blocks = frame.reshape(60 // samples, samples, 90 // samples, samples, 3).mean((1, 3))
        assert patch == pytest.approx(blocks, abs=1e-3)


def test_what_was_cut_is_placed_where_it_was() -> None:
    y, x = np.mgrid[:80, :90]
    frame = np.rint(127 + 90 * np.sin(x / 7)[..., None] * np.cos(y / 9)[..., None] * [1, 0.5, -1]).astype(np.uint8)
    placed = frame.copy()
    weight = feather(np.pad(np.ones((58, 68), bool), 1), 5)
    place(placed, cut(frame, TURNED, (60, 70)), weight, TURNED)
    assert (np.abs(placed.astype(int) - frame) <= 1).all()


SHAPE = FaceShape(44.0, 120.0)
PLACE = np.array([[1.5, -0.2, 210.0], [0.2, 1.5, 140.0]])


@pytest.mark.parametrize("scale", [1, 2, 3])
def test_every_pixel_has_its_place_in_the_frame(scale: int) -> None:
    """The centre of the pixel at (x, y) of the face is where the map of the face puts (x, y), half a pixel back."""
    to_frame = map_region(PLACE, scale)
    for column, row in ((0, 0), (WIDTH * scale - 1, 0), (17, 90)):
        face = np.array([CORNER[0] + (column + 0.5) / scale, CORNER[1] + (row + 0.5) / scale])
        wanted = PLACE[:, :2] @ face + PLACE[:, 2] - 0.5
        assert to_frame[:, :2] @ [column, row] + to_frame[:, 2] == pytest.approx(wanted)


@pytest.mark.parametrize(
    ("pixels", "scale"), [(20, 1), (90, 1), (150, 1), (160, 2), (180, 2), (270, 3), (360, 4), (2000, LARGEST_SCALE)]
)
def test_the_scale_is_that_of_the_footage(pixels: float, scale: int) -> None:
    turn = pixels / EYE_DISTANCE_PX * np.array([[0.8, -0.6], [0.6, 0.8]])
    places = np.tile(np.column_stack([turn, [100.0, 50.0]]), (9, 1, 1))
    places[3] *= 3  # one frame in which the tracker was wrong
    assert choose_scale(places) == scale


def test_the_shape_is_that_of_the_person() -> None:
    chins = np.array([118.0] * 50 + [125.0] * 50)
    shape = measure_shape(0.4, chins)
    assert shape.half_width_px == pytest.approx(1.15 * 0.4 * 90)
    assert shape.bottom_px == pytest.approx(118 - MARGIN_PX)
    narrow, wide = measure_shape(0.01, chins), measure_shape(3.0, chins)
    assert (narrow.half_width_px, wide.half_width_px) == (NARROWEST_PX, WIDEST_PX)
    assert measure_shape(0.4, chins - 60).bottom_px == MIN_BOTTOM_PX
    assert measure_shape(0.4, chins + 500).bottom_px == CORNER[1] + HEIGHT - 4


@pytest.mark.parametrize("scale", [1, 2])
def test_the_mouth_is_where_mouth_pictures_have_it_and_replaced_within_its_region(scale: int) -> None:
    mask, (rows, columns) = mark_mouth(scale), find_mouth_part(scale)
    assert mask[rows, columns].shape == (MOUTH_HEIGHT * scale, MOUTH_WIDTH * scale)
    assert (columns.start / scale + CORNER[0], rows.start / scale + CORNER[1]) == pytest.approx(MOUTH_CORNER)
    assert mask[rows, columns].sum() == mask.sum()
    corners = mask[rows, columns][: CHEEK_PX[1] * scale // 2, : CHEEK_PX[0] * scale // 2]
    assert not corners.any()  # where the light is measured, the footage stays
    assert mask[rows, columns].mean() == pytest.approx(0.927 * 70 * 54 / (72 * 56), rel=0.02)


@pytest.mark.parametrize("scale", [1, 2])
@pytest.mark.parametrize("shape", [SHAPE, FaceShape(NARROWEST_PX, MIN_BOTTOM_PX), FaceShape(WIDEST_PX, 156.0)])
def test_what_is_replaced_lies_inside_and_ends_above_the_chin(shape: FaceShape, scale: int) -> None:
    mask = mark_replaced(shape, scale)
    assert mask.shape == (HEIGHT * scale, WIDTH * scale)
    outermost = np.concatenate([mask[[0, -1]].ravel(), mask[:, [0, -1]].ravel()])
    assert not outermost.any()
    rows, columns = np.nonzero(mask)
    assert (rows.min() / scale + CORNER[1], (rows.max() + 1) / scale + CORNER[1]) == pytest.approx(
        (TOP_PX, shape.bottom_px), abs=1.01 / scale
    )
    assert np.ptp(columns) + 1 == pytest.approx(2 * shape.half_width_px * scale, abs=2.01)
    assert np.array_equal(mask, mask[:, ::-1])
    assert mask.mean() == pytest.approx(mark_replaced(shape, 1).mean(), rel=0.02)


@pytest.mark.parametrize("scale", [1, 3])
def test_light_is_that_of_the_corners(scale: int) -> None:
    mouths = np.random.default_rng(0).integers(0, 256, (2, 56 * scale, 72 * scale, 3), np.uint8)
    width, height = CHEEK_PX[0] * scale, CHEEK_PX[1] * scale
    for rows in (slice(height), slice(-height, None)):
        for columns in (slice(width), slice(-width, None)):
            mouths[:, rows, columns] = [200, 150, 100]
    mouths[1, :height, :width] = [100, 150, 140]
    assert measure_cheek_light(mouths) == pytest.approx(np.array([[200, 150, 100], [175, 150, 110]]))
    for shape in ((2, 56, 72), (2, 50, 72, 3), (2, 56, 144, 3), (2, 57, 72, 3)):
        with pytest.raises(InputError, match=r"required \(T, 56 · n, 72 · n, 3\)"):
            measure_cheek_light(np.zeros(shape, np.uint8))


def face(seed: int) -> np.ndarray:
    coarse = np.random.default_rng(seed).uniform(40, 200, (16, 16, 3))
    return np.kron(coarse, np.ones((8, 8, 1)))


def test_neither_light_nor_noise_nor_background_make_another_person() -> None:
    one = face(1) + np.random.default_rng(9).normal(0, 5, (4, 128, 128, 3))
    assert compare_faces(find_signature(one), find_signature(0.6 * one[:1] + 20)) == pytest.approx(1, abs=0.02)
    around = face(1)
    around[112:] = 0
    around[:, :18] = 255
    assert compare_faces(find_signature(face(1)), find_signature(around)) == pytest.approx(1)
    assert compare_faces(find_signature(face(1)), find_signature(face(2))) < SAME_PERSON_LIKENESS
    assert compare_faces(find_signature(np.full((128, 128, 3), 7)), find_signature(face(1))) == pytest.approx(0)  # flat
