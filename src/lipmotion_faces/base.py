"""The interface of faces."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cached_property
from typing import Any, Generic, Protocol, TypeVar, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from lipmotion.meshes.fitting.eyes_and_brows import stage_liveliness
from lipmotion.types import Motion, Prosody, Timeline, Unit
from lipmotion.types.delivery import SCENE, SMALLEST_PX, TRANSPARENT, Staging

__all__ = [
    "SCENE",
    "SMALLEST_PX",
    "TRANSPARENT",
    "DrawnMotion",
    "DrawsSingly",
    "Face",
    "Picture",
    "Stageable",
    "Staging",
    "rotate_head",
    "stage_liveliness",
]

PoseT = TypeVar("PoseT")
Picture = NDArray[np.uint8]
THREADS = 2  # pictures that are drawn at the same time


class Face(ABC):
    """Draws motion as pictures. A subclass needs no arguments to be made.

    An entry point of the group ``lipmotion.faces`` makes it known by a name, for ``lipmotion animate --face NAME``;
    ``lipmotion_faces.testing.check_face`` tests the contract.
    """

    @abstractmethod
    def render(self, motion: Motion, units: Timeline[Unit], *, fps: float = 25.0) -> Iterator[NDArray[np.uint8]]:
        """Return RGB frames [shape=(H, W, 3)] of even height and width; frame n shows the time ``n / fps`` seconds.

        A face that is staged with a transparent background returns RGBA frames [shape=(H, W, 4)], with straight alpha.
        The last frame is at or before the last frame of the motion. The same input gives the same pixels.
        units : phones in time; may be empty
        Raises InputError: a channel that the face needs is missing, values are not finite, or fps is not positive.
        """


class DrawnMotion(Generic[PoseT]):
    """The pictures of a motion as a face draws them: all in order, or single ones.

    poses   : of every frame
    painter : returns what draws the picture of a pose, in several threads; called for the first picture
    ahead   : pictures that are drawn before they are asked for, by ``THREADS`` threads
    The same pose gives the same pixels, whatever was drawn before.
    """

    def __init__(
        self, poses: Sequence[PoseT], painter: Callable[[], Callable[[PoseT], Picture]], ahead: int = 6
    ) -> None:
        self._poses, self._painter, self._ahead = poses, painter, ahead

    def __len__(self) -> int:
        return len(self._poses)

    def draw(self, number: int) -> Picture:
        """Return the picture of a frame [shape as of ``Face.render``]."""
        return self._paint(self._poses[number])

    def __iter__(self) -> Iterator[Picture]:
        """Yield the pictures in order; they are drawn while earlier ones are used."""
        waiting: deque[Future[Picture]] = deque()
        with ThreadPoolExecutor(THREADS) as threads:
            try:
                for pose in self._poses:
                    waiting.append(threads.submit(self._paint, pose))
                    if len(waiting) > self._ahead:
                        yield waiting.popleft().result()
                while waiting:
                    yield waiting.popleft().result()
            finally:  # the pictures may not all have been asked for
                for future in waiting:
                    future.cancel()

    @cached_property
    def _paint(self) -> Callable[[PoseT], Picture]:
        return self._painter()


@runtime_checkable
class DrawsSingly(Protocol):
    """A face that can draw single pictures; a face has this ability if it has the method."""

    def draw(self, motion: Motion, units: Timeline[Unit], *, fps: float = 25.0) -> DrawnMotion[Any]:
        """Return the pictures of ``Face.render``, each of which can be drawn alone. Raises as ``render``."""


@runtime_checkable
class Stageable(Protocol):
    """A face that can be staged; a face has this ability if it has the method."""

    def with_staging(self, staging: Staging, prosody: Prosody | None = None) -> Face:
        """Return the same face with other settings, and the speech's prosody (None: not known) for brows and head."""


def rotate_head(yaw: float, pitch: float, roll: float = 0.0) -> NDArray[np.float64]:
    """Return the rotation to the character's left, upwards and to the left shoulder, in radians [shape=(3, 3)]."""
    (cy, sy), (cp, sp), (cr, sr) = ((np.cos(a), np.sin(a)) for a in (yaw, pitch, roll))
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_x = np.array([[1, 0, 0], [0, cp, sp], [0, -sp, cp]])
    about_z = np.array([[cr, sr, 0], [-sr, cr, 0], [0, 0, 1]])
    return np.asarray(about_y @ about_x @ about_z)
