"""The face mesh on a part of the picture that goes along with the face: for faces that are small in a large picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion.vision.packages import import_opencv
from lipmotion.vision.trackers import FaceBox, LandmarkTracker

Image = NDArray[np.uint8]
Array = NDArray[np.float64]

REACH = 2.5
"""Side of a window, in sides of the face in it: the mesh's detector finds faces of a third of a picture best."""
SIZE_PX = 384
"""Every window is scaled to this side: the mesh then always sees faces of about one size."""
STEADY = 1.25
"""The window keeps its side until that of the face has changed by this ratio."""


@dataclass(frozen=True)
class FaceWindow:
    """A square part of a picture, possibly beyond its edges: upper left corner and side, px."""

    left: int
    top: int
    side: int

    @staticmethod
    def around(x: float, y: float, side: float) -> FaceWindow:
        """Return the window whose middle is nearest to a point; of a side given, px."""
        whole = max(1, round(side))
        return FaceWindow(round(x - whole / 2), round(y - whole / 2), whole)

    def shown(self, image: Image) -> Image:
        """Return this part of a picture, scaled to ``SIZE_PX``; beyond the picture it is black."""
        cv2 = import_opencv()
        height, width = image.shape[:2]
        right, bottom = self.left + self.side, self.top + self.side
        part = image[max(self.top, 0) : max(bottom, 0), max(self.left, 0) : max(right, 0)]
        beyond = max(-self.top, 0), max(bottom - height, 0), max(-self.left, 0), max(right - width, 0)
        if not part.size:
            return np.zeros((SIZE_PX, SIZE_PX, 3), np.uint8)
        if any(beyond):
            part = cv2.copyMakeBorder(part, *beyond, cv2.BORDER_CONSTANT)
        way = cv2.INTER_AREA if self.side > SIZE_PX else cv2.INTER_CUBIC
        scaled: Image = cv2.resize(part, (SIZE_PX, SIZE_PX), interpolation=way)
        return scaled

    def to_picture(self, points: Array) -> Array:
        """Return points of the scaled window [shape=(..., 3)] as points of the picture, px."""
        moved: Array = points * (self.side / SIZE_PX) + (self.left, self.top, 0)
        return moved


class WindowedMesh:
    """Follows one face with the mesh of a tracker in a window that goes along with it.

    It is a ``PointFinder``. As the window moves with the face, the mesh sees a face that hardly moves.
    box : of the face in the first picture
    Use it as a context manager.
    """

    def __init__(self, box: FaceBox, tracker: LandmarkTracker) -> None:
        self._window = FaceWindow.around(box.x, box.y, REACH * box.side)
        self._mesh = tracker.points()

    def __enter__(self) -> WindowedMesh:
        return self

    def __exit__(self, *_: object) -> None:
        self._mesh.__exit__(None, None, None)

    def faces(self, image: Image) -> list[Array]:
        """Return the points of the face in the next picture, as ``PointFinder.faces``; none or one."""
        found = [self._window.to_picture(face) for face in self._mesh.faces(self._window.shown(image))]
        if found:
            self._window = self._following(found[0])
        return found

    def _following(self, face: Array) -> FaceWindow:
        low, high = face[:, :2].min(axis=0), face[:, :2].max(axis=0)
        side = REACH * float((high - low).max())
        is_steady = 1 / STEADY < side / self._window.side < STEADY
        x, y = (low + high) / 2
        return FaceWindow.around(float(x), float(y), self._window.side if is_steady else side)
