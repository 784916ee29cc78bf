"""MediaPipe's face mesh: one instance a clip, without its log output."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion_faces.tracking.landmarks import TRACKED_POINTS
from lipmotion_faces.tracking.packages import import_face_mesh


class FaceMesh:
    """Finds the faces in the frames of one clip, in order; it follows them from frame to frame.

    most : the largest number of faces to find; with 1, the most probable one is kept
    Use it as a context manager. Raises MissingDependencyError: MediaPipe is not installed.
    """

    def __init__(self, most: int = 1) -> None:
        self._module = import_face_mesh()
        self._most = most
        self._mesh: Any = None

    def __enter__(self) -> FaceMesh:
        return self

    def __exit__(self, *_: object) -> None:
        if self._mesh is not None:
            self._mesh.close()

    def faces(self, image: NDArray[np.uint8]) -> list[NDArray[np.float64]]:
        """Return the points of every face in the next frame.

        image : uint8 array [shape=(H, W, 3)], RGB
        Returns one array a face [shape=(len(TRACKED_POINTS), 3)]: px, x to the right, y down, z away from the camera.
        """
        height, width = image.shape[:2]
        return [
            np.array([(point.x, point.y, point.z) for point in (face.landmark[index] for index in TRACKED_POINTS)])
            * (width, height, width)
            for face in self._process(image).multi_face_landmarks or ()
        ]

    def _process(self, image: NDArray[np.uint8]) -> Any:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "SymbolDatabase.GetPrototype", UserWarning)
            if self._mesh is not None:
                return self._mesh.process(image)
            with quiet_stderr():  # the graph logs while it starts, up to its first result
                self._mesh = self._module.FaceMesh(max_num_faces=self._most, refine_landmarks=True)
                return self._mesh.process(image)


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
