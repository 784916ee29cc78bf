"""A three-dimensional head: a friendly character made by this code, drawn without a graphics card.

Motion and phones become poses (``performance``, with ``gestures`` and ``liveliness``); a pose moves the surfaces
(``skin`` with ``lips`` and ``eyelids``, ``inside``, ``eyes``), which ``figure`` puts together, lights and gives to the
rasteriser. The forms are made once: ``forms`` (skin), ``hair``, ``body``.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TYPE_CHECKING, final

import numpy as np
from numpy.typing import NDArray

from lipmotion.faces.base import Face
from lipmotion.faces.character.liveliness import SEED
from lipmotion.faces.character.performance import head_poses
from lipmotion.faces.character.pose import FacePose
from lipmotion.types import Motion, Timeline, Unit

if TYPE_CHECKING:
    from lipmotion.rig.rasteriser import Camera

__all__ = ["Head", "render"]

THREADS = 2
"""Frames that are drawn at the same time."""


@final
class Head(Face):
    """The three-dimensional head, 1280 × 720 pixels, as ``render`` draws it."""

    def render(self, motion: Motion, units: Timeline[Unit], *, fps: float = 25.0) -> Iterator[NDArray[np.uint8]]:  # noqa: D102
        return render(motion, units, fps=fps)


def render(
    motion: Motion,
    units: Timeline[Unit],
    *,
    fps: float = 25.0,
    width: int = 1280,
    height: int = 720,
    seed: int = SEED,
) -> Iterator[NDArray[np.uint8]]:
    """Yield RGB frames [shape=(height, width, 3)] of a motion to its end, frame n at ``n / fps`` seconds.

    motion : needs ``opening``; ``width``, ``outer`` and the chin ``y_152`` are used where they exist.
             ``width`` and ``outer`` are taken relative to the rest pose in silence, so they suit any speaker.
    units  : the phones, for tongue, teeth and the shape of the lips; may be empty
    width, height : even numbers of pixels, at least 64
    seed   : of blinks, glances and the movement of the head
    Raises InputError: no ``opening``, no frames, values that are not finite, a size that is odd or under 64,
    or fps not positive.
    The same input gives the same pixels.
    """
    from lipmotion.faces.character.stage import camera_for

    poses = head_poses(motion, units, fps, seed=seed)
    camera = camera_for(width, height)
    return _frames(poses, camera)


def _frames(poses: list[FacePose], camera: Camera) -> Iterator[NDArray[np.uint8]]:
    from lipmotion.faces.character.stage import Stage

    stage = Stage(camera)
    with ThreadPoolExecutor(THREADS) as threads:
        waiting: deque[Future[NDArray[np.uint8]]] = deque()
        for pose in poses:
            waiting.append(threads.submit(stage.picture, pose))
            if len(waiting) > THREADS:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
