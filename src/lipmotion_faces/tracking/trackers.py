"""Landmark trackers: methods that find faces in pictures, and the points of each. MediaPipe is one of them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.extensions import Registry

Image = NDArray[np.uint8]
MEDIAPIPE = "mediapipe"
"""The tracker that is used where no other one is named."""


@dataclass(frozen=True)
class FaceBox:
    """A square around a face, from the brows to the chin: its middle and its side, px; and the detector's score."""

    x: float
    y: float
    side: float
    score: float


class PointFinder(AbstractContextManager["PointFinder"], Protocol):
    """Finds the points of faces in the pictures of one clip, in order; it may follow them from picture to picture."""

    def faces(self, image: Image) -> list[NDArray[np.float64]]:
        """Return the points of every face in the next picture.

        image : uint8 array [shape=(H, W, 3)], RGB
        Returns one array a face [shape=(len(TRACKED_POINTS), 3)], in the order of ``landmarks.TRACKED_POINTS``:
        px, x to the right, y down, z away from the camera.
        """


class BoxFinder(AbstractContextManager["BoxFinder"], Protocol):
    """Finds faces in single pictures, in any order, small ones too."""

    def boxes(self, image: Image, *, thorough: bool = True) -> list[FaceBox]:
        """Return the faces in a picture, those with the highest score first.

        image    : uint8 array [shape=(H, W, 3)], RGB
        thorough : whether more time may be spent where none is found at first
        """


class LandmarkTracker(ABC):
    """A method that finds faces and their points.

    A subclass takes no arguments. An entry point of the group ``lipmotion.trackers`` registers it (docs/corpora.md).
    Which face is whose, and what lies between pictures, is not its business (``FaceFollower``).
    """

    @abstractmethod
    def versions(self) -> dict[str, str]:
        """Return the versions of the packages that the results depend on; one has the name of the tracker.

        Raises MissingDependencyError: one is not installed.
        """

    @abstractmethod
    def points(self, most: int = 1) -> PointFinder:
        """Return what finds the points of at most so many faces in a clip; with 1, those of the most probable one.

        Raises MissingDependencyError: a package is not installed.
        """

    @abstractmethod
    def boxes(self) -> BoxFinder:
        """Return what finds faces in single pictures."""


TRACKERS: Registry[type[LandmarkTracker]] = Registry(
    "tracker", "lipmotion.trackers", {MEDIAPIPE: "lipmotion_faces.tracking.mediapipe:MediaPipe"}
)


def tracker_named(name: str = MEDIAPIPE) -> LandmarkTracker:
    """Return a tracker. Raises InputError: none of that name, or what an installed package adds is no tracker."""
    chosen = TRACKERS.load(name)
    if not (isinstance(chosen, type) and issubclass(chosen, LandmarkTracker)):
        raise InputError(
            f"{chosen!r} is called a tracker, {name!r}, by an installed package; required a class of LandmarkTracker"
        )
    return chosen()
