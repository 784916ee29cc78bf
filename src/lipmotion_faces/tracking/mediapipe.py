"""MediaPipe as a landmark tracker: its face mesh, and its full-range detector of faces."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from importlib import metadata
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from lipmotion_faces.tracking.face_mesh import FaceMesh, quiet_stderr
from lipmotion_faces.tracking.packages import import_face_detection, import_opencv, missing
from lipmotion_faces.tracking.trackers import MEDIAPIPE, FaceBox, LandmarkTracker

Image = NDArray[np.uint8]

FULL_RANGE_MODEL = 1
"""MediaPipe's number of the model for faces within five metres; the face mesh's own detector reaches two."""
LEAST_SCORE = 0.5
"""Detections with a lower score are not returned. Small faces of GRID, VidTIMIT and open speech are at 0.64 or more."""
LONGEST_PX = 1280
"""A larger picture is reduced to this for the search; the detector itself sees 192 × 192 pixels of each part."""
LEAST_PART_PX = 480
"""Pictures with a shorter side below this are searched as a whole only: parts would show no smaller faces."""


class FaceFinder:
    """Finds the faces in single pictures, in any order; it keeps nothing from one picture to the next.

    Use it as a context manager. Raises MissingDependencyError when it is first used: MediaPipe is not installed.
    """

    def __init__(self) -> None:
        self._detector: Any = None

    def __enter__(self) -> FaceFinder:
        return self

    def __exit__(self, *_: object) -> None:
        if self._detector is not None:
            self._detector.close()

    def boxes(self, image: Image, *, thorough: bool = True) -> list[FaceBox]:
        """Return the faces in a picture, those with the highest score first.

        image    : uint8 array [shape=(H, W, 3)], RGB
        thorough : where the whole picture shows none, search the parts of ``parts`` too, which takes four times as long
        A face needs an eye distance of a fortieth of the picture's longer side; in a part, of the shorter side.
        """
        reduced, scale = _reduced(image)
        found = self._found(reduced)
        if not found and thorough and min(reduced.shape[:2]) >= LEAST_PART_PX:
            for left, top, side in parts(*reduced.shape[:2]):
                part = np.ascontiguousarray(reduced[top : top + side, left : left + side])
                found += [FaceBox(box.x + left, box.y + top, box.side, box.score) for box in self._found(part)]
        boxes = [FaceBox(box.x * scale, box.y * scale, box.side * scale, box.score) for box in found]
        return _distinct(sorted(boxes, key=lambda box: -box.score))

    def _found(self, image: Image) -> list[FaceBox]:
        height, width = image.shape[:2]
        found = []
        for detection in self._process(image).detections or ():
            box = detection.location_data.relative_bounding_box
            middle = (box.xmin + box.width / 2) * width, (box.ymin + box.height / 2) * height
            found.append(FaceBox(*middle, max(box.width * width, box.height * height), detection.score[0]))
        return found

    def _process(self, image: Image) -> Any:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "SymbolDatabase.GetPrototype", UserWarning)
            if self._detector is not None:
                return self._detector.process(image)
            module = import_face_detection()
            with quiet_stderr():  # the graph logs while it starts, up to its first result
                self._detector = module.FaceDetection(
                    min_detection_confidence=LEAST_SCORE, model_selection=FULL_RANGE_MODEL
                )
                return self._detector.process(image)


def parts(height: int, width: int) -> Iterator[tuple[int, int, int]]:
    """Yield left, top and side of three squares that cover a picture along its longer side and overlap, px."""
    side = min(height, width)
    for third in (1, 0, 2):  # the middle first
        yield (width - side) * third // 2, (height - side) * third // 2, side


def _reduced(image: Image) -> tuple[Image, float]:
    """Return a picture of at most ``LONGEST_PX``, and the size of its pixels in those of the picture given."""
    scale = max(image.shape[:2]) / LONGEST_PX
    if scale <= 1:
        return image, 1.0
    cv2 = import_opencv()
    size = round(image.shape[1] / scale), round(image.shape[0] / scale)
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA), scale


def _distinct(boxes: list[FaceBox]) -> list[FaceBox]:
    """Return the boxes without those whose middle lies in an earlier one: a face may be in several parts."""
    kept: list[FaceBox] = []
    for box in boxes:
        if not any(max(abs(box.x - other.x), abs(box.y - other.y)) < other.side / 2 for other in kept):
            kept.append(box)
    return kept


@final
class MediaPipe(LandmarkTracker):
    """The face mesh of MediaPipe, whose numbers of points are those of ``vision.landmarks``."""

    def versions(self) -> dict[str, str]:  # noqa: D102
        try:
            mediapipe = metadata.version("mediapipe")
        except metadata.PackageNotFoundError as error:
            raise missing("MediaPipe", error) from error
        return {MEDIAPIPE: mediapipe, "opencv": str(import_opencv().__version__), "av": metadata.version("av")}

    def points(self, most: int = 1) -> FaceMesh:  # noqa: D102
        return FaceMesh(most)

    def boxes(self) -> FaceFinder:  # noqa: D102
        return FaceFinder()
