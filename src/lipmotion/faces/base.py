"""The interface of faces."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.liveliness import Liveliness, liveliness
from lipmotion.types import Motion, Prosody, Timeline, Unit
from lipmotion.types.staging import LARGEST, SCENE, SMALLEST, TRANSPARENT, Staging

__all__ = [
    "LARGEST",
    "SCENE",
    "SMALLEST",
    "TRANSPARENT",
    "DrawsPlanes",
    "Face",
    "Stageable",
    "Staging",
    "alive",
]


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
