import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion_faces.appearance.placing import cut, feather, inverse_map, place
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


def test_smooth_functions_are_exact_between_pixels() -> None:
    def function(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return (3 + x - 2 * y) ** 2

    y, x = np.mgrid[:60, :60] / 60
    made = resample(np.repeat(function(x, y)[None, :, :, None], 3, axis=3), TURNED, (40, 40))[0, :, :, 2]
    row, column = np.mgrid[:40, :40]
    at_x, at_y = (TURNED[i, 0] * column + TURNED[i, 1] * row + TURNED[i, 2] for i in range(2))
    assert made == pytest.approx(function(at_x / 60, at_y / 60), abs=1e-4)


def test_there_and_back() -> None:
    back, point = inverse_map(TURNED), np.array([3.0, 5.0])
    assert back[:, :2] @ (TURNED[:, :2] @ point + TURNED[:, 2]) + back[:, 2] == pytest.approx(point)


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


def test_a_patch_of_pixels_as_large_as_the_frames_is_resampled() -> None:
    frame = noise((60, 60, 3))
    assert (cut(frame, TURNED, (20, 24)) == resample(frame[None], TURNED, (20, 24))[0]).all()
    assert cut(frame, TURNED, (20, 24)).dtype == np.float32


def test_pixels_of_a_large_frame_are_averaged() -> None:
    """A patch whose pixels are blocks of the frame's holds the means of these blocks."""
    frame = noise((60, 90, 3))
    for samples in (2, 3, 5):
        to_frame = np.array([[samples, 0, (samples - 1) / 2], [0, samples, (samples - 1) / 2]], float)
        patch = cut(frame, to_frame, (60 // samples, 90 // samples))
        blocks = frame.reshape(60 // samples, samples, 90 // samples, samples, 3).mean((1, 3))
        assert patch == pytest.approx(blocks, abs=1e-3)


def test_no_pixel_of_a_large_frame_is_skipped() -> None:
    """Every pixel of the frame counts about as much in the patch as every other."""
    for scale in (1.6, 3.4):
        turned = np.column_stack([scale * np.array([[0.95, -0.3], [0.3, 0.95]]), [9.3, 4.1]])
        frame = np.zeros((60, 60, 3), np.uint8)
        seen = np.zeros((7, 7))
        for row, column in np.ndindex(7, 7):
            frame[24 + row, 24 + column] = 200
            seen[row, column] = cut(frame, turned, (36, 36)).sum()
            frame[24 + row, 24 + column] = 0
        assert (0.9 * seen.mean() < seen).all()
        assert (seen < 1.1 * seen.mean()).all()


def test_what_was_cut_is_placed_where_it_was() -> None:
    y, x = np.mgrid[:80, :90]
    frame = np.rint(127 + 90 * np.sin(x / 7)[..., None] * np.cos(y / 9)[..., None] * [1, 0.5, -1]).astype(np.uint8)
    placed = frame.copy()
    weight = feather(np.pad(np.ones((58, 68), bool), 1), 5)
    place(placed, cut(frame, TURNED, (60, 70)), weight, TURNED)
    assert (np.abs(placed.astype(int) - frame) <= 1).all()
