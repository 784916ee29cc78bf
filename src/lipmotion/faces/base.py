"""The interface of faces."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from lipmotion.types import Motion, Timeline, Unit


class Face(ABC):
    """Draws motion as pictures. A subclass needs no arguments to be made.

    An entry point of the group ``lipmotion.faces`` makes it known by a name, for ``lipmotion animate --face NAME``;
    ``lipmotion.testing.check_face`` tests the contract.
    """

    @abstractmethod
    def render(self, motion: Motion, units: Timeline[Unit], *, fps: float = 25.0) -> Iterator[NDArray[np.uint8]]:
        """Return RGB frames [shape=(H, W, 3)] of even height and width; frame n shows the time ``n / fps`` seconds.

        The last frame is at or before the last frame of the motion. The same input gives the same pixels.
        units : phones in time; may be empty
        Raises InputError: a channel that the face needs is missing, values are not finite, or fps is not positive.
        """
