"""A face mesh that answers as a test tells it to."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lipmotion_faces.tracking.trackers import TRACKED_POINTS, TRACKERS, FaceBox, LandmarkTracker

COLUMN = {index: n for n, index in enumerate(TRACKED_POINTS)}


def face(opening: float) -> NDArray[np.float64]:
    """A face of 60 px between the eyes, as the face mesh gives it [shape=(N, 3)]."""
    points = np.random.default_rng(11).uniform(0, 48, (len(TRACKED_POINTS), 3))
    points[[COLUMN[33], COLUMN[263], COLUMN[10], COLUMN[168]]] = [[2, 20, 0], [62, 20, 0], [32, 2, 5], [32, 20, 0]]
    points[[COLUMN[13], COLUMN[14]], :2] = [[32.0, 40.0], [32.0, 40 + 60 * opening]]
    return points


class Opened(AbstractContextManager[Any]):
    """Stands for what is opened and closed."""

    def __exit__(self, *_: object) -> None:
        pass


class NoFinder(Opened):
    """Stands for the detector, which finds no more than the mesh."""

    def find_boxes(self, image: NDArray[np.uint8], *, thorough: bool = True) -> list[FaceBox]:  # noqa: ARG002
        return []


class StandIn(LandmarkTracker):
    """A tracker of what a test gives it: a mesh, opened for so many faces, and a detector."""

    mesh: Callable[..., Any]
    finder: Callable[[], Any] = NoFinder

    def list_versions(self) -> dict[str, str]:
        return {"mediapipe": "scripted"}

    def open_point_finder(self, most: int = 1) -> Any:
        return type(self).mesh(most)

    def open_box_finder(self) -> Any:
        return type(self).finder()


class ScriptedMesh(Opened):
    """Stands for the face mesh: one answer a frame, None for no face."""

    answers: Iterator[NDArray[np.float64] | None] = iter(())
    last: NDArray[np.float64] | None = None

    def __init__(self, most: int) -> None:
        self.most = most

    def find_faces(self, image: NDArray[np.uint8]) -> list[NDArray[np.float64]]:  # noqa: ARG002
        if self.most == 1:
            ScriptedMesh.last = next(self.answers)
        return [] if self.last is None else [self.last]


class Scripted(StandIn):
    """The faces that ``script`` was given."""

    mesh = ScriptedMesh


def script(monkeypatch: pytest.MonkeyPatch, answers: Iterable[NDArray[np.float64] | None]) -> None:
    """Let the faces of the next video be these, one answer a frame."""
    ScriptedMesh.answers = iter(answers)
    monkeypatch.setitem(TRACKERS.built_in, "mediapipe", f"{__name__}:Scripted")  # type: ignore[arg-type]
