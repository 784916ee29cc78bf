"""MediaPipe as a landmark tracker: its face mesh, and its full-range detector of faces."""

from __future__ import annotations

from importlib import metadata
from typing import final

from lipmotion.vision.face_finder import FaceFinder
from lipmotion.vision.mesh import FaceMesh
from lipmotion.vision.packages import import_opencv, missing
from lipmotion.vision.trackers import MEDIAPIPE, LandmarkTracker


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
