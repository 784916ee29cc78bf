"""A three-dimensional head: a friendly character made by this code, drawn without a graphics card.

The spoken mouth and what moves beside it (``articulation``) become poses (``pose``); a pose moves the surfaces
(``skin`` with ``lips``, ``inside``, ``eyes``), which ``figure`` puts together, lights and gives to the rasteriser. The
forms are made once: ``forms`` (skin), ``hair``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property
from typing import final

import numpy as np
from numpy.typing import NDArray

from lipmotion.types import Motion, Prosody, Timeline, Unit
from lipmotion_faces.base import SMALLEST_PX, TRANSPARENT, DrawnMotion, Face, Picture, Staging
from lipmotion_faces.head.pose import CharacterPose, head_poses

__all__ = ["Head", "render"]

OWN_SIZE = 720
"""Height of pictures whose size is not given."""
FRAMES_AHEAD = 2
"""Pictures that are drawn before they are asked for."""


@final
class Head(Face):
    """The three-dimensional head, 1280 × 720 pixels if no size is asked for, as ``render`` draws it."""

    def __init__(self, staging: Staging | None = None, prosody: Prosody | None = None) -> None:
        self.staging, self.prosody = staging or Staging(), prosody

    def staged(self, staging: Staging, prosody: Prosody | None = None) -> Head:
        """Return the same character with other settings; pictures are 16 to 9.

        prosody : of the speech that will be rendered, for accents of brows and head; None: not known
        """
        return Head(staging, prosody)

    def render(self, motion: Motion, units: Timeline[Unit], *, fps: float = 25.0) -> Iterator[NDArray[np.uint8]]:  # noqa: D102
        return iter(self.drawn(motion, units, fps=fps))

    def drawn(self, motion: Motion, units: Timeline[Unit], *, fps: float = 25.0) -> DrawnMotion[CharacterPose]:  # noqa: D102
        poses = head_poses(motion, units, fps, self.staging, self.prosody)
        return DrawnMotion(poses, lambda: self._painter, FRAMES_AHEAD)

    @cached_property
    def _painter(self) -> Callable[[CharacterPose], Picture]:
        height = self.staging.size or OWN_SIZE
        return _painter(max(2 * round(height * 8 / 9), SMALLEST_PX), height, self.staging)


def render(
    motion: Motion,
    units: Timeline[Unit],
    *,
    fps: float = 25.0,
    width: int = 1280,
    height: int = OWN_SIZE,
    staging: Staging | None = None,
    prosody: Prosody | None = None,
) -> Iterator[NDArray[np.uint8]]:
    """Yield frames [shape=(height, width, 3)] of a motion to its end, frame n at ``n / fps`` seconds.

    motion  : needs ``opening``; ``width``, ``outer``, the chin ``y_152`` and the articulatory channels are used where
              they exist. ``width`` and ``outer`` count relative to the rest pose in silence, so they suit any speaker
    units   : the phones, for tongue, teeth and the shape of the lips; may be empty
    width, height : even numbers of pixels, at least 64; the size of the staging does not count here
    staging : background, seed, and what moves on its own; None: everything moves
    prosody : of the speech, for accents of brows and head; None: not known
    Returns RGB, or RGBA [shape=(height, width, 4)] with straight alpha where the background is transparent.
    Raises InputError: no ``opening``, no frames, values that are not finite, a size that is odd or under 64,
    or fps not positive.
    The same input gives the same pixels.
    """
    from lipmotion_faces.head.stage import camera_for

    chosen = staging or Staging()
    poses = head_poses(motion, units, fps, chosen, prosody)
    camera_for(width, height)  # refuses sizes before the first picture is asked for
    return iter(DrawnMotion(poses, lambda: _painter(width, height, chosen), FRAMES_AHEAD))


def _painter(width: int, height: int, staging: Staging) -> Callable[[CharacterPose], Picture]:
    from lipmotion_faces.head.stage import Stage, camera_for

    stage = Stage(camera_for(width, height), staging.colour)
    return stage.cut_out if staging.background == TRANSPARENT else stage.picture
