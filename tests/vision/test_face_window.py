from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from numpy.typing import NDArray

from lipmotion_faces.tracking.face_follower import REACH, SIZE_PX, FaceWindow, WindowedMesh
from lipmotion_faces.tracking.trackers import FaceBox, LandmarkTracker

pytest.importorskip("cv2")
pytestmark = pytest.mark.video


def dot(height: int, width: int, x: int, y: int) -> NDArray[np.uint8]:
    """Return a picture with a bright square of 8 px, its upper left corner at a position."""
    image = np.zeros((height, width, 3), np.uint8)
    image[max(y, 0) : y + 8, max(x, 0) : x + 8] = 255
    return image


def middle_of_bright(image: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Return x, y and 0 of the middle of what is bright, as landmarks are counted: 0 is the edge of the picture."""
    rows, columns = np.nonzero(image[..., 0] > 127)
    return np.array([columns.mean() + 0.5, rows.mean() + 0.5, 0.0])


def test_positions_in_the_window_are_those_in_the_picture():
    for side in (96, 384, 800):
        window = FaceWindow.around(500, 300, side)
        shown = window.cut(dot(720, 1280, 480, 310))
        assert shown.shape == (SIZE_PX, SIZE_PX, 3)
        np.testing.assert_allclose(window.to_picture(middle_of_bright(shown)), [484, 314, 0], atol=0.6)
    scaled = FaceWindow(10, 20, 2 * SIZE_PX).to_picture(np.array([[3.0, 4.0, 5.0]]))  # depth is scaled, too
    np.testing.assert_allclose(scaled, [[16.0, 28.0, 10.0]])


def test_beyond_the_edges_it_is_black():
    for x, y in ((4, 4), (1270, 4), (4, 710), (1270, 710)):
        window = FaceWindow.around(x, y, 300)
        shown = window.cut(dot(720, 1280, x - 4, y - 4))
        np.testing.assert_allclose(window.to_picture(middle_of_bright(shown)), [x, y, 0], atol=3)
        assert (shown == 0).mean() > 0.9
    assert not FaceWindow(2000, 0, 100).cut(np.full((72, 128, 3), 255, np.uint8)).any()


class BrightMesh:
    """Stands for the face mesh: a face is the box around what is bright."""

    shapes: list[tuple[int, ...]] = []  # noqa: RUF012
    closed = 0

    def __exit__(self, *_: object) -> None:
        BrightMesh.closed += 1

    def faces(self, image: NDArray[np.uint8]) -> list[NDArray[np.float64]]:
        rows, columns = np.nonzero(image[..., 0] > 127)
        if not rows.size:
            return []
        return [np.array([[columns.min(), rows.min(), 0.0], [columns.max() + 1.0, rows.max() + 1.0, 0.0]])]


def square(x: int, side: int) -> NDArray[np.uint8]:
    image = np.zeros((720, 1280, 3), np.uint8)
    image[300 : 300 + side, x : x + side] = 255
    return image


def test_the_window_goes_along_and_grows_with_the_face():
    with WindowedMesh(FaceBox(230, 330, 60, 0.9), cast(LandmarkTracker, SimpleNamespace(points=BrightMesh))) as mesh:
        for n in range(40):  # it moves much further than a window's side, and becomes twice as large
            x, side = 200 + 20 * n, 60 + 2 * n
            (found,) = mesh.faces(square(x, side))
            np.testing.assert_allclose(found[:, :2], [[x, 300], [x + side, 300 + side]], atol=2)
        assert mesh._window.side == pytest.approx(REACH * side, rel=0.3)
        assert mesh.faces(np.zeros((720, 1280, 3), np.uint8)) == []
        assert len(mesh.faces(square(x, side))) == 1
    assert BrightMesh.closed == 1
