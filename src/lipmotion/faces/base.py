"""The interface of faces."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Generic, Protocol, TypeVar, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.liveliness import Liveliness, liveliness
from lipmotion.errors import InputError, shortened
from lipmotion.types import Configuration, Motion, Prosody, Rule, Timeline, Unit, option

PoseT = TypeVar("PoseT")
Picture = NDArray[np.uint8]
THREADS = 2
"""Pictures that are drawn at the same time."""
SCENE, TRANSPARENT = "scene", "transparent"
SMALLEST, LARGEST = 64, 4096
"""Range of the height of pictures, in pixels."""


class Face(ABC):
    """Draws motion as pictures. A subclass needs no arguments to be made.

    An entry point of the group ``lipmotion.faces`` makes it known by a name, for ``lipmotion animate --face NAME``;
    ``lipmotion.testing.check_face`` tests the contract.
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
    painter : returns what draws the picture of a pose; called when the first picture is asked for. Several threads use
              what it returns
    ahead   : pictures that are drawn before they are asked for, by ``THREADS`` threads
    The same pose gives the same pixels, whatever was drawn before.
    """

    def __init__(
        self, poses: Sequence[PoseT], painter: Callable[[], Callable[[PoseT], Picture]], ahead: int = 6
    ) -> None:
        self._poses, self._painter, self._ahead = poses, painter, ahead

    def __len__(self) -> int:
        return len(self._poses)

    def picture(self, number: int) -> Picture:
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

    def drawn(self, motion: Motion, units: Timeline[Unit], *, fps: float = 25.0) -> DrawnMotion[Any]:
        """Return the pictures of ``Face.render``, each of which can be drawn alone. Raises as ``render``.

        A face that is asked again, for other motion, does not paint again what does not move.
        """


@dataclass(frozen=True)
class Staging(Configuration):
    """How a face is shown, beside what it says.

    size       : height of the picture in pixels, an even number; 0: the face's own
    background : ``scene`` (the face's own), ``transparent``, or a colour as ``#40a0ff``
    blinks, gaze, brows, head : whether these move on their own
    seed       : of the movements that depend on chance
    Raises InputError: a value out of its range, or no such background.
    """

    size: int = option(0, Rule(least=0))
    background: str = SCENE
    blinks: bool = True
    gaze: bool = True
    brows: bool = True
    head: bool = True
    seed: int = option(0, Rule(least=0))

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.size and not (SMALLEST <= self.size <= LARGEST and self.size % 2 == 0):
            raise InputError(f"the size is {self.size} pixels, required an even number from {SMALLEST} to {LARGEST}")
        if self.background not in (SCENE, TRANSPARENT) and not re.fullmatch("#[0-9a-fA-F]{6}", self.background):
            raise InputError(
                f"the background is {shortened(self.background)!r}, required scene, transparent, or a colour as "
                "#40a0ff; a video is for filmed faces; give one: --face FILE.face"
            )

    @property
    def colour(self) -> tuple[int, int, int] | None:
        """Red, green and blue of the background, 0..255; None: it has no single colour."""
        if not self.background.startswith("#"):
            return None
        return int(self.background[1:3], 16), int(self.background[3:5], 16), int(self.background[5:7], 16)


def alive(
    time_s: NDArray[np.float64],
    motion: Motion,
    units: Timeline[Unit],
    staging: Staging | None = None,
    prosody: Prosody | None = None,
) -> Liveliness:
    """Return what moves beside the mouth at some times, as a staging asks for it; None: everything moves.

    motion, units, prosody : as of ``articulation.liveliness``
    """
    chosen = staging or Staging()
    moving = {name: getattr(chosen, name) for name in ("blinks", "gaze", "brows", "head")}
    return liveliness(time_s, motion, units, prosody, seed=chosen.seed, **moving)


@runtime_checkable
class Stageable(Protocol):
    """A face that can be staged; a face has this ability if it has the method."""

    def staged(self, staging: Staging, prosody: Prosody | None = None) -> Face:
        """Return the same face with other settings.

        prosody : of the speech that will be rendered, for movements of brows and head; None: not known
        """


@runtime_checkable
class DrawsPlanes(Protocol):
    """A face that draws in the colours of video encoders, which takes less time; a face has this ability if it has the
    method."""

    def render_planes(
        self, motion: Motion, units: Timeline[Unit], *, fps: float = 25.0
    ) -> Iterator[NDArray[np.uint8]] | None:
        """Return the frames of ``render`` as YUV 4:2:0 [shape=(H · 3 / 2, W)], or None where they are transparent.

        Of each frame the brightness (Y) comes first [shape=(H, W)], then the colours U and V [shape=(H / 2, W / 2)]:
        ITU-R BT.601, limited range. H and W are even.
        """
