"""MediaPipe as a landmark tracker: its face mesh, and its full-range detector of faces."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import metadata
from typing import Any, TypeVar, final

import numpy as np
from numpy.typing import NDArray

from lipmotion_faces.tracking.packages import explain_missing, import_opencv, import_solution
from lipmotion_faces.tracking.trackers import MEDIAPIPE, TRACKED_POINTS, FaceBox, LandmarkTracker

GraphT = TypeVar("GraphT", bound="_Graph")
Image = NDArray[np.uint8]

FULL_RANGE_MODEL = 1
"""MediaPipe's number of the model for faces within five metres; the face mesh's own detector reaches two."""
MIN_SCORE = 0.5
"""Detections with a lower score are not returned. Small faces of GRID, VidTIMIT and open speech are at 0.64 or more."""
LONGEST_PX = 1280
"""A larger picture is reduced to this for the search; the detector itself sees 192 × 192 pixels of each part."""
MIN_PART_PX = 480
"""Pictures with a shorter side below this are searched as a whole only: parts would show no smaller faces."""


class _Graph:
    """A graph of MediaPipe that starts with its first picture, without its log output. Use it as a context manager."""

    def __init__(self, start: Callable[[], Any]) -> None:
        self._start = start
        self._running: Any = None

    def __enter__(self: GraphT) -> GraphT:
        return self

    def __exit__(self, *_: object) -> None:
        if self._running is not None:
            self._running.close()

    def _process(self, image: Image) -> Any:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "SymbolDatabase.GetPrototype", UserWarning)
            if self._running is not None:
                return self._running.process(image)
            with quiet_stderr():  # the graph logs while it starts, up to its first result
                self._running = self._start()
                return self._running.process(image)


class FaceMesh(_Graph):
    """Finds up to ``most`` faces in frames, and follows them. Raises MissingDependencyError: no MediaPipe."""

    def __init__(self, most: int = 1) -> None:
        module = import_solution("face_mesh")
        super().__init__(lambda: module.FaceMesh(max_num_faces=most, refine_landmarks=True))

    def find_faces(self, image: Image) -> list[NDArray[np.float64]]:  # noqa: D102
        height, width = image.shape[:2]
        return [
            np.array([(point.x, point.y, point.z) for point in (face.landmark[index] for index in TRACKED_POINTS)])
            * (width, height, width)
            for face in self._process(image).multi_face_landmarks or ()
        ]


class FaceFinder(_Graph):
    """Finds the faces in single pictures. Raises MissingDependencyError when first used: no MediaPipe."""

    def __init__(self) -> None:
        settings = {"min_detection_confidence": MIN_SCORE, "model_selection": FULL_RANGE_MODEL}
        super().__init__(lambda: import_solution("face_detection").FaceDetection(**settings))

    def find_boxes(self, image: Image, *, thorough: bool = True) -> list[FaceBox]:
        """Return the faces in a picture, those with the highest score first, as ``BoxFinder.find_boxes``.

        thorough : where the whole picture shows none, search ``list_parts`` too, which takes four times as long
        A face needs an eye distance of a fortieth of the picture's longer side; in a part, of the shorter side.
        """
        scale = max(max(image.shape[:2]) / LONGEST_PX, 1.0)
        if scale > 1:
            cv2 = import_opencv()
            size = round(image.shape[1] / scale), round(image.shape[0] / scale)
            image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
        boxes = self._find(image)
        if not boxes and thorough and min(image.shape[:2]) >= MIN_PART_PX:
            for left, top, side in list_parts(*image.shape[:2]):
                part = np.ascontiguousarray(image[top : top + side, left : left + side])
                boxes += [FaceBox(box.x + left, box.y + top, box.side, box.score) for box in self._find(part)]
        distinct: list[FaceBox] = []
        for box in sorted(boxes, key=lambda box: -box.score):  # a face may be in several parts
            if not any(max(abs(box.x - other.x), abs(box.y - other.y)) < other.side / 2 for other in distinct):
                distinct.append(box)
        return [FaceBox(box.x * scale, box.y * scale, box.side * scale, box.score) for box in distinct]

    def _find(self, image: Image) -> list[FaceBox]:
        height, width = image.shape[:2]
        boxes = []
        for detection in self._process(image).detections or ():
            box = detection.location_data.relative_bounding_box
            middle = (box.xmin + box.width / 2) * width, (box.ymin + box.height / 2) * height
            boxes.append(FaceBox(*middle, max(box.width * width, box.height * height), detection.score[0]))
        return boxes


def list_parts(height: int, width: int) -> Iterator[tuple[int, int, int]]:
    """Yield left, top and side of three squares that cover a picture along its longer side and overlap, px."""
    side = min(height, width)
    for third in (1, 0, 2):  # the middle first
        yield (width - side) * third // 2, (height - side) * third // 2, side


@contextmanager
def quiet_stderr() -> Iterator[None]:
    """Discard the output of native code to stderr: MediaPipe logs before its log level can be set."""
    try:
        saved = os.dup(2)
    except OSError:  # the process has no stderr
        yield
        return
    try:
        if sys.stderr is not None:
            sys.stderr.flush()
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 2)
        os.close(nowhere)
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)


@final
class MediaPipe(LandmarkTracker):
    """The face mesh of MediaPipe, whose numbers of points are those of ``trackers``."""

    def list_versions(self) -> dict[str, str]:  # noqa: D102
        try:
            mediapipe = metadata.version("mediapipe")
        except metadata.PackageNotFoundError as error:
            raise explain_missing("MediaPipe", error) from error
        return {MEDIAPIPE: mediapipe, "opencv": str(import_opencv().__version__), "av": metadata.version("av")}

    def open_point_finder(self, most: int = 1) -> FaceMesh:  # noqa: D102
        return FaceMesh(most)

    def open_box_finder(self) -> FaceFinder:  # noqa: D102
        return FaceFinder()
