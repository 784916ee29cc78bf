"""A three-dimensional head: a friendly character made by this code, drawn without a graphics card.

The spoken mouth and what moves beside it (``articulation``) become poses (``pose``); a pose moves the surfaces
(``skin`` with ``lips``, ``inside``, ``eyes``), which ``make_figure`` makes once, lights and gives to the rasteriser.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property
from typing import final

import numpy as np
from numpy.typing import NDArray

from lipmotion.types import Motion, Prosody, Timeline, Unit
from lipmotion_faces.base import SMALLEST_PX, TRANSPARENT, DrawnMotion, Face, Picture, Staging
from lipmotion_faces.head.pose import CharacterPose, list_head_poses

__all__ = ["CharacterPose", "Head", "list_head_poses"]

SIZE = (1280, 720)  # width and height of pictures whose size is not given
FRAMES_AHEAD = 2


@final
class Head(Face):
    """The three-dimensional head.

    Motion needs ``opening``; ``width``, ``outer``, the chin ``y_152`` and the articulatory channels are used where they
    exist. ``width`` and ``outer`` count relative to the rest pose in silence, so they suit any speaker.
    size : width and height of the pictures, even, at least 64; a size of the staging counts instead, 16 to 9
    """

    def __init__(
        self, staging: Staging | None = None, prosody: Prosody | None = None, size: tuple[int, int] = SIZE
    ) -> None:
        self.staging, self.prosody, self._size = staging or Staging(), prosody, size

    def with_staging(self, staging: Staging, prosody: Prosody | None = None) -> Head:
        """Return the same character with other settings; ``prosody`` is of the speech that will be rendered."""
        return Head(staging, prosody, self._size)

    def render(self, motion: Motion, units: Timeline[Unit], *, fps: float = 25.0) -> Iterator[NDArray[np.uint8]]:  # noqa: D102
        return iter(self.draw(motion, units, fps=fps))

    def draw(self, motion: Motion, units: Timeline[Unit], *, fps: float = 25.0) -> DrawnMotion[CharacterPose]:  # noqa: D102
        poses = list_head_poses(motion, units, fps, self.staging, self.prosody)
        if self._size != SIZE:
            from lipmotion_faces.head.stage import make_camera

            make_camera(*self._size)  # refuses sizes before the first picture is asked for
        return DrawnMotion(poses, lambda: self._painter, FRAMES_AHEAD)

    @cached_property
    def _painter(self) -> Callable[[CharacterPose], Picture]:
        from lipmotion_faces.head.stage import Stage, make_camera

        width, height = self._size
        if self.staging.size:
            width, height = max(2 * round(self.staging.size * 8 / 9), SMALLEST_PX), self.staging.size
        stage = Stage(make_camera(width, height), self.staging.colour)
        return stage.cut_out if self.staging.background == TRANSPARENT else stage.draw
