import numpy as np
import pytest

from lipmotion_faces.film.filmed_video import HEIGHT_SHARE, MARGIN_SHARE, WHITE, WIDTH_SHARE, add_inset, inset_box
from lipmotion_faces.video.synthetic_mark import mark_frames


def frames(count: int = 3, height: int = 120, width: int = 160) -> list[np.ndarray]:
    return [np.full((height, width, 3), 10 * n, np.uint8) for n in range(count)]


def drawn(frame: np.ndarray, made: np.ndarray) -> tuple[slice, slice]:
    """Return the rows and columns that differ."""
    rows, columns = np.nonzero((made != frame).any(axis=2))
    return slice(int(rows.min()), int(rows.max()) + 1), slice(int(columns.min()), int(columns.max()) + 1)


@pytest.mark.parametrize("size", [(56, 72), (10, 300), (300, 10), (1, 1)])
@pytest.mark.parametrize("frame_size", [(120, 160), (480, 270)])
def test_it_lies_in_the_lower_right_corner(size, frame_size):
    (frame,), picture = frames(1, *frame_size), np.full((*size, 3), 130, np.uint8)
    (made,) = add_inset([frame], [picture])
    assert (made.shape, made.dtype) == (frame.shape, np.uint8)
    rows, columns = drawn(frame, made)
    assert inset_box(frame_size, size) == (columns.start, rows.start, columns.stop, rows.stop)
    margin = round(MARGIN_SHARE * min(frame_size))
    assert (rows.stop, columns.stop) == (frame_size[0] - margin, frame_size[1] - margin)
    inner = (made[rows, columns] == 130).all(axis=2)
    assert 1 <= inner.any(axis=1).sum() <= HEIGHT_SHARE * frame_size[0] + 1
    assert 1 <= inner.any(axis=0).sum() <= WIDTH_SHARE * frame_size[1] + 1
    border = made[rows, columns][~inner]
    assert (border == WHITE).all()
    assert np.array_equal(np.unique(made[rows, columns]), [130, WHITE])


def test_the_picture_keeps_its_form_and_its_place():
    """A picture that is dark at the left and light at the right, and red above."""
    picture = np.zeros((56, 72, 3), np.uint8)
    picture[:, 36:, 1] = 200
    picture[:28, :, 0] = 200
    (frame,) = frames(1, 288, 360)
    (made,) = add_inset([frame], [picture])
    rows, columns = drawn(frame, made)
    inner = made[rows, columns][2:-2, 2:-2].astype(int)
    height, width = inner.shape[:2]
    assert width / height == pytest.approx(72 / 56, abs=0.03)
    assert inner[3, 3].tolist() == [200, 0, 0]
    assert inner[-4, 3].tolist() == [0, 0, 0]
    assert inner[3, -4].tolist() == [200, 200, 0]
    assert inner[-4, -4].tolist() == [0, 200, 0]
    middle = np.abs(np.diff(inner[-4, :, 1])).argmax()
    assert middle == pytest.approx(width / 2, abs=1.5)
    (turned,) = add_inset([frame], [picture[::-1, ::-1]])
    assert np.abs(turned[rows, columns].astype(int) - made[rows, columns][::-1, ::-1]).max() <= 1


def test_every_frame_has_its_own_picture_and_is_not_changed():
    films, pictures = frames(5), [np.full((56, 72, 3), 100 + n, np.uint8) for n in range(4)]
    before = [frame.copy() for frame in films]
    made = list(add_inset(films, pictures))
    assert len(made) == 4  # as many as there are of both
    assert [frame[-15, -15, 0] for frame in made] == [100, 101, 102, 103]
    assert all(np.array_equal(frame, old) for frame, old in zip(films, before, strict=True))
    assert [frame[0, 0, 0] for frame in made] == [0, 10, 20, 30]
    assert list(add_inset([], pictures)) == []


def test_a_label_leaves_the_inset_free():
    (made,) = add_inset(frames(1, 288, 360), [np.full((56, 72, 3), 130, np.uint8)])
    left, top, right, bottom = inset_box((288, 360), (56, 72))
    (marked,) = mark_frames([made], (left, top, right, bottom))
    assert np.array_equal(marked[top:bottom, left:right], made[top:bottom, left:right])
    assert (marked != made).any()
