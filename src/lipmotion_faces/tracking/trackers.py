"""Landmark trackers: methods that find faces in pictures, and the points of each. MediaPipe is one of them.

Points have the numbers of the face mesh (478). Left and right are the speaker's own: his left is right in the picture.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lipmotion.extensions import Registry
from lipmotion.storage.sources import read_shipped_table

EYE_CORNERS = (33, 263)  # outer corners, right and left: the unit of length and the x axis

_PARTS = read_shipped_table(__package__, "points.csv")
LIP_POINTS, JAW_POINTS, RIGID_POINTS = (
    tuple(int(point) for row in _PARTS if row["group"] == group for point in row["points"].split())
    for group in ("lips", "jaw", "rigid")
)
"""All 40 lip points of the face mesh; chin and jaw line; and those that speech does not move, of which the head pose is
estimated."""

FOREHEAD, NASION = 10, 168
"""Top of the forehead, and bridge of the nose between the eyes; they give the upright direction."""

FOREHEAD_SLOPE_DEG = 8.6
"""Slope of the line from NASION to FOREHEAD, backwards, in MediaPipe's canonical face, which looks straight ahead."""

DISTANCES = {"opening": (13, 14), "width": (61, 291), "outer": (0, 17)}
"""The three distances as pairs of points: between the inner lips, the lip corners, the outer lips."""

TRACKED_POINTS = tuple(sorted({*LIP_POINTS, *JAW_POINTS, *RIGID_POINTS}))  # every point that is kept from a frame


Image = NDArray[np.uint8]
MEDIAPIPE = "mediapipe"  # the tracker that is used where no other one is named


@dataclass(frozen=True)
class FaceBox:
    """A square around a face, from the brows to the chin: its middle and its side, px; and the detector's score."""

    x: float
    y: float
    side: float
    score: float


class PointFinder(AbstractContextManager["PointFinder"], Protocol):
    """Finds the points of faces in the pictures of one clip, in order; it may follow them from picture to picture."""

    def find_faces(self, image: Image) -> list[NDArray[np.float64]]:
        """Return the points of every face in the next picture.

        image : uint8 array [shape=(H, W, 3)], RGB
        Returns one array a face [shape=(len(TRACKED_POINTS), 3)], in the order of ``TRACKED_POINTS``:
        px, x to the right, y down, z away from the camera.
        """


class BoxFinder(AbstractContextManager["BoxFinder"], Protocol):
    """Finds faces in single pictures, in any order, small ones too."""

    def find_boxes(self, image: Image, *, thorough: bool = True) -> list[FaceBox]:
        """Return the faces in a picture [shape=(H, W, 3)], best score first; ``thorough``: search longer for any."""


class LandmarkTracker(ABC):
    """A method that finds faces and their points.

    A subclass takes no arguments. An entry point of the group ``lipmotion.trackers`` registers it (docs/corpora.md).
    Which face is whose, and what lies between pictures, is not its business (``FaceFollower``).
    """

    @abstractmethod
    def list_versions(self) -> dict[str, str]:
        """Return the versions of packages that results depend on. Raises MissingDependencyError: one is missing."""

    @abstractmethod
    def open_point_finder(self, most: int = 1) -> PointFinder:
        """Return a finder of the points of up to ``most`` faces. Raises MissingDependencyError: no package."""

    @abstractmethod
    def open_box_finder(self) -> BoxFinder:
        """Return what finds faces in single pictures."""


TRACKERS: Registry[type[LandmarkTracker]] = Registry(
    "tracker", "lipmotion.trackers", {MEDIAPIPE: "lipmotion_faces.tracking.mediapipe:MediaPipe"}, LandmarkTracker
)


def make_tracker(name: str = MEDIAPIPE) -> LandmarkTracker:
    """Return a tracker. Raises InputError: none of that name, or what an installed package adds is no tracker."""
    return TRACKERS.load(name)()
