from __future__ import annotations

import numpy as np
import pytest

from lipmotion.vision.face_pictures import face_pictures
from lipmotion.vision.footage import Footage, track_footage
from vision.conftest import WriteVideo
from vision.scripted import face, script

SIZE = (200, 240)
ROWS, COLUMNS = np.mgrid[: SIZE[1], : SIZE[0]]
RAMP = np.stack([ROWS, np.zeros_like(ROWS), COLUMNS], axis=2).astype(np.uint8)
"""Red is the row, blue the column."""


@pytest.fixture
def footage(write_video: WriteVideo, monkeypatch: pytest.MonkeyPatch):
    pytest.importorskip("cv2")

    def make(
        count: int, rate: int = 25, left: float = 60, moved: float = 0, picture: np.ndarray | None = RAMP
    ) -> Footage:
        script(monkeypatch, [face(0.1) + np.array([left + moved * (n % 2), 40, 0]) for n in range(count)])
        path = write_video(ticks=range(count), rate=rate, size=SIZE, picture=picture)
        return track_footage(path)

    return make


def test_the_face_is_in_the_upper_part(footage) -> None:
    """From the forehead, 56 px over the eyes where these are 90 px apart, to 195 px under it."""
    tracked = footage(3)
    (first, *_), to_image = face_pictures(tracked, 25.0, 224), tracked.face_to_image[0]
    assert (first.shape, first.dtype) == ((224, 224, 3), np.uint8)
    scale = np.sqrt(np.linalg.det(to_image[:, :2]))
    x, y = to_image @ (0, 33 + 0.4 * 89, 1)
    for row in (111, 150):
        for column in (80, 111):
            blue, _, red = first[row, column].astype(float)
            step = 2.8 * 89 * scale / 224
            assert red == pytest.approx(y + (row - 111.5) * step, abs=4)
            assert blue == pytest.approx(x + (column - 111.5) * step, abs=4)


def test_beyond_the_frame_it_is_grey(footage) -> None:
    """The face's middle is 32 px from the left edge, half of the picture 83 px wide."""
    (picture, *_) = face_pictures(footage(2, left=0, picture=np.zeros_like(RAMP)), 25.0, 64)
    assert picture[:, :18].min() == picture[:, :18].max() == 110
    assert picture[:, 22:].max() < 20


def test_there_are_as_many_a_second_as_wanted(footage) -> None:
    levels = [round(float(picture.mean()) / 10) for picture in face_pictures(footage(20, 50, picture=None), 25.0, 16)]
    assert levels == list(range(0, 20, 2))
    levels = [round(float(picture.mean()) / 10) for picture in face_pictures(footage(10, 10, picture=None), 25.0, 16)]
    assert levels[:6] == [0, 0, 1, 1, 2, 2]
    assert len(levels) == 23


def test_place_and_size_are_steady(footage) -> None:
    """Every second frame, the face is 4 px to the right: the median does not tremble."""
    pictures = [picture.astype(int) for picture in face_pictures(footage(30, moved=4.0), 25.0, 64)]
    middle = [picture[32, 32, 0] for picture in pictures[6:-6]]
    assert max(middle) - min(middle) <= 5
    assert len(set(middle[1::2])) <= 2
