import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.motion import mouth_region
from lipmotion_faces.appearance.lower_face import (
    CHEEK_PX,
    CORNER,
    HEIGHT,
    LARGEST_SCALE,
    LEAST_BOTTOM_PX,
    MARGIN_PX,
    NARROWEST_PX,
    SAME_PERSON_LIKENESS,
    TOP_PX,
    WIDEST_PX,
    WIDTH,
    FaceShape,
    best_scale,
    cheek_light,
    face_shape,
    face_signature,
    likeness,
    mouth_ellipse,
    mouth_part,
    region_map,
    relight,
    replaced_part,
)
from lipmotion_faces.appearance.placing import cut

SHAPE = FaceShape(44.0, 120.0)
PLACE = np.array([[1.5, -0.2, 210.0], [0.2, 1.5, 140.0]])


@pytest.mark.parametrize("scale", [1, 2, 3])
def test_every_pixel_has_its_place_in_the_frame(scale: int) -> None:
    """The centre of the pixel at (x, y) of the face is where the map of the face puts (x, y), half a pixel back."""
    to_frame = region_map(PLACE, scale)
    for column, row in ((0, 0), (WIDTH * scale - 1, 0), (17, 90)):
        face = np.array([CORNER[0] + (column + 0.5) / scale, CORNER[1] + (row + 0.5) / scale])
        wanted = PLACE[:, :2] @ face + PLACE[:, 2] - 0.5
        assert to_frame[:, :2] @ [column, row] + to_frame[:, 2] == pytest.approx(wanted)


@pytest.mark.parametrize("scale", [1, 2])
def test_a_frame_of_the_face_alone_is_cut_out_to_the_bit(scale: int) -> None:
    """Where a frame has ``scale`` pixels for each of the face, nothing is resampled."""
    picture = np.random.default_rng(0).integers(0, 256, (40 * scale + HEIGHT * scale, 200 * scale, 3), np.uint8)
    place = np.array([[scale, 0, 100.0 * scale], [0, scale, 8.0 * scale]])
    left, top = round((100 + CORNER[0]) * scale), round((8 + CORNER[1]) * scale)
    found = cut(picture, region_map(place, scale), (HEIGHT * scale, WIDTH * scale))
    assert np.array_equal(np.rint(found), picture[top : top + HEIGHT * scale, left : left + WIDTH * scale])


@pytest.mark.parametrize(
    ("pixels", "scale"), [(20, 1), (90, 1), (150, 1), (160, 2), (180, 2), (270, 3), (360, 4), (2000, LARGEST_SCALE)]
)
def test_the_scale_is_that_of_the_footage(pixels: float, scale: int) -> None:
    turn = pixels / mouth_region.EYE_DISTANCE_PX * np.array([[0.8, -0.6], [0.6, 0.8]])
    places = np.tile(np.column_stack([turn, [100.0, 50.0]]), (9, 1, 1))
    places[3] *= 3  # one frame in which the tracker was wrong
    assert best_scale(places) == scale


def test_the_shape_is_that_of_the_person() -> None:
    chins = np.array([118.0] * 50 + [125.0] * 50)
    shape = face_shape(0.4, chins)
    assert shape.half_width_px == pytest.approx(1.15 * 0.4 * 90)
    assert shape.bottom_px == pytest.approx(118 - MARGIN_PX)
    narrow, wide = face_shape(0.01, chins), face_shape(3.0, chins)
    assert (narrow.half_width_px, wide.half_width_px) == (NARROWEST_PX, WIDEST_PX)
    assert face_shape(0.4, chins - 60).bottom_px == LEAST_BOTTOM_PX
    assert face_shape(0.4, chins + 500).bottom_px == CORNER[1] + HEIGHT - 4


@pytest.mark.parametrize("scale", [1, 2])
def test_the_mouth_is_where_mouth_pictures_have_it_and_replaced_within_its_region(scale: int) -> None:
    mask, (rows, columns) = mouth_ellipse(scale), mouth_part(scale)
    assert mask[rows, columns].shape == (mouth_region.HEIGHT * scale, mouth_region.WIDTH * scale)
    corner = (columns.start / scale + CORNER[0], rows.start / scale + CORNER[1])
    assert corner == pytest.approx(mouth_region.CORNER)
    assert mask[rows, columns].sum() == mask.sum()
    corners = mask[rows, columns][: CHEEK_PX[1] * scale // 2, : CHEEK_PX[0] * scale // 2]
    assert not corners.any()  # where the light is measured, the footage stays
    assert mask[rows, columns].mean() == pytest.approx(np.pi * 34 * 26 / (72 * 56), rel=0.02)


@pytest.mark.parametrize("scale", [1, 2])
@pytest.mark.parametrize("shape", [SHAPE, FaceShape(NARROWEST_PX, LEAST_BOTTOM_PX), FaceShape(WIDEST_PX, 156.0)])
def test_what_is_replaced_lies_inside_and_ends_above_the_chin(shape: FaceShape, scale: int) -> None:
    mask = replaced_part(shape, scale)
    assert mask.shape == (HEIGHT * scale, WIDTH * scale)
    outermost = np.concatenate([mask[[0, -1]].ravel(), mask[:, [0, -1]].ravel()])
    assert not outermost.any()
    rows, columns = np.nonzero(mask)
    assert (rows.min() / scale + CORNER[1], (rows.max() + 1) / scale + CORNER[1]) == pytest.approx(
        (TOP_PX, shape.bottom_px), abs=1.01 / scale
    )
    assert np.ptp(columns) + 1 == pytest.approx(2 * shape.half_width_px * scale, abs=2.01)
    assert np.array_equal(mask, mask[:, ::-1])
    assert mask.mean() == pytest.approx(replaced_part(shape, 1).mean(), rel=0.02)


@pytest.mark.parametrize("scale", [1, 3])
def test_light_is_that_of_the_corners(scale: int) -> None:
    mouths = np.random.default_rng(0).integers(0, 256, (2, 56 * scale, 72 * scale, 3), np.uint8)
    width, height = CHEEK_PX[0] * scale, CHEEK_PX[1] * scale
    for rows in (slice(height), slice(-height, None)):
        for columns in (slice(width), slice(-width, None)):
            mouths[:, rows, columns] = [200, 150, 100]
    mouths[1, :height, :width] = [100, 150, 140]
    assert cheek_light(mouths) == pytest.approx(np.array([[200, 150, 100], [175, 150, 110]]))
    for shape in ((2, 56, 72), (2, 50, 72, 3), (2, 56, 144, 3), (2, 57, 72, 3)):
        with pytest.raises(InputError, match=r"required \(T, 56 · n, 72 · n, 3\)"):
            cheek_light(np.zeros(shape, np.uint8))


def test_relit_pictures_are_lighter_by_their_gains() -> None:
    pictures = np.random.default_rng(1).integers(0, 256, (3, 20, 10, 3), np.uint8)
    gains = np.array([[1, 1, 1], [1.3, 0.5, 0], [2, 1, 1.1]])
    made = relight(pictures, gains)
    assert made.dtype == np.uint8
    assert np.array_equal(made, np.clip(np.rint(pictures * gains[:, None, None]), 0, 255))
    assert np.array_equal(made[0], pictures[0])


def face(seed: int) -> np.ndarray:
    coarse = np.random.default_rng(seed).uniform(40, 200, (16, 16, 3))
    return np.kron(coarse, np.ones((8, 8, 1)))


def test_neither_light_nor_noise_nor_background_make_another_person() -> None:
    one = face(1) + np.random.default_rng(9).normal(0, 5, (4, 128, 128, 3))
    assert likeness(face_signature(one), face_signature(0.6 * one[:1] + 20)) == pytest.approx(1, abs=0.02)
    around = face(1)
    around[112:] = 0
    around[:, :18] = 255
    assert likeness(face_signature(face(1)), face_signature(around)) == pytest.approx(1)
    assert likeness(face_signature(face(1)), face_signature(face(2))) < SAME_PERSON_LIKENESS
    assert likeness(face_signature(np.full((128, 128, 3), 7)), face_signature(face(1))) == pytest.approx(0)  # flat
