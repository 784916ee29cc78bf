import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from lipmotion.errors import MissingDependencyError
from lipmotion_faces.tracking.mediapipe import FaceFinder, parts

Box = tuple[float, float, float, float]  # left, top, side, score, px of a picture of 1280 × 720


class Detector:
    """Stands for MediaPipe's: finds a bright square if it takes a fiftieth of the picture's longer side."""

    def __init__(self) -> None:
        self.shapes: list[tuple[int, ...]] = []

    def process(self, image: NDArray[np.uint8]) -> SimpleNamespace:
        self.shapes.append(image.shape[:2])
        rows, columns = np.nonzero(image[..., 0] > 200)
        if not rows.size or np.ptp(columns) + 1 < max(image.shape) / 50:
            return SimpleNamespace(detections=None)
        height, width = image.shape[:2]
        sides = {"width": (np.ptp(columns) + 1) / width, "height": (np.ptp(rows) + 1) / height}
        box = SimpleNamespace(xmin=columns.min() / width, ymin=rows.min() / height, **sides)
        data = SimpleNamespace(relative_bounding_box=box)
        return SimpleNamespace(detections=[SimpleNamespace(location_data=data, score=[0.8])])

    def close(self) -> None:
        pass


def bright(height: int, width: int, left: int, top: int, side: int) -> NDArray[np.uint8]:
    image = np.zeros((height, width, 3), np.uint8)
    image[top : top + side, left : left + side] = 255
    return image


@pytest.fixture
def finder() -> FaceFinder:
    found = FaceFinder()
    found._running = Detector()
    return found


def test_the_whole_picture_is_enough(finder):
    boxes = finder.boxes(bright(720, 1280, 300, 100, 80))
    assert [(box.x, box.y, box.side) for box in boxes] == [pytest.approx((340, 140, 80))]
    assert finder._running.shapes == [(720, 1280)]


def test_what_is_smaller_is_found_in_a_part_once(finder):
    image = bright(720, 1280, 400, 300, 20)  # in the left part and in the middle one
    assert [(box.x, box.y, box.side) for box in finder.boxes(image)] == [pytest.approx((410, 310, 20))]
    assert finder._running.shapes[1:] == [(720, 720)] * 3
    assert finder.boxes(image, thorough=False) == []
    finder._running.shapes.clear()
    finder.boxes(np.zeros((288, 360, 3), np.uint8))
    assert finder._running.shapes == [(288, 360)]  # a small picture has no parts


def test_a_large_picture_is_reduced_and_the_box_is_not(finder):
    pytest.importorskip("cv2")
    boxes = finder.boxes(bright(2160, 3840, 900, 600, 300))
    assert finder._running.shapes == [(720, 1280)]
    assert (boxes[0].x, boxes[0].y, boxes[0].side) == pytest.approx((1050, 750, 300), abs=3)


@pytest.mark.parametrize(("height", "width"), [(720, 1280), (1280, 720), (600, 600)])
def test_parts_cover_the_picture(height, width):
    covered = np.zeros((height, width), bool)
    for left, top, side in parts(height, width):
        assert 0 <= left <= width - side
        assert 0 <= top <= height - side
        covered[top : top + side, left : left + side] = True
    assert covered.all()


def test_missing_mediapipe_is_named_when_it_is_first_needed(monkeypatch):
    monkeypatch.setitem(sys.modules, "mediapipe.python.solutions", None)
    with FaceFinder() as finder, pytest.raises(MissingDependencyError):
        finder.boxes(np.zeros((48, 64, 3), np.uint8))


@pytest.mark.video
@pytest.mark.recordings
@pytest.mark.parametrize("scale", [1.0, 0.4])
def test_a_face_in_a_large_picture(recordings: Path, scale: float):
    """The outer eye corners of this face are 66 px apart: 26 at the smaller scale."""
    pytest.importorskip("mediapipe")
    cv2 = pytest.importorskip("cv2")
    from vision.variants import frames_of

    frame = cv2.resize(frames_of(recordings / "grid-s1" / "clips" / "bbaf2n.mkv")[0], None, fx=scale, fy=scale)
    image = np.full((720, 1280, 3), 128, np.uint8)
    image[100 : 100 + frame.shape[0], 700 : 700 + frame.shape[1]] = frame
    with FaceFinder() as finder:
        boxes = finder.boxes(image)
    assert len(boxes) == 1
    assert boxes[0].x == pytest.approx(700 + 157 * scale, abs=12)
    assert boxes[0].y == pytest.approx(100 + 175 * scale, abs=20)
