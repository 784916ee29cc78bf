"""A drawn face: a flat portrait whose mouth is drawn from the motion. It needs numpy and Pillow only.

The stages of a frame: ``pose`` (motion and phones → numbers) → ``geometry`` (numbers → outlines) → ``mouth``
(outlines → pixels, with ``bands``) → ``rasteriser`` (pixels → picture). The still parts are painted once, by
``surroundings``, ``head`` and ``eyes`` on a ``layer``.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import final

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.faces.base import Face
from lipmotion.faces.portrait.eyes import lid_closure
from lipmotion.faces.portrait.pose import MouthPose, mouth_poses
from lipmotion.types import Motion, Timeline, Unit

__all__ = ["Portrait", "render"]


@final
class Portrait(Face):
    """The drawn portrait, 640 × 640 pixels, as ``render`` draws it."""

    def render(self, motion: Motion, units: Timeline[Unit], *, fps: float = 25.0) -> Iterator[NDArray[np.uint8]]:  # noqa: D102
        return render(motion, units, fps=fps)


def render(
    motion: Motion, units: Timeline[Unit], *, fps: float = 25.0, height: int = 640
) -> Iterator[NDArray[np.uint8]]:
    """Yield RGB frames [shape=(height, height, 3)] of a motion to its end, frame n at ``n / fps`` seconds.

    motion : needs ``opening``; ``width``, ``outer`` and the chin ``y_152`` are used where they exist.
             ``width`` and ``outer`` are taken relative to the rest pose in silence, so they suit any speaker.
    units  : the phones, for the lip on the teeth (f v) and the tongue (th dh l t d n); may be empty
    height : even number of pixels
    Raises InputError: no ``opening``, no frames, values that are not finite, a size that is odd or under 64,
    or fps not positive.
    The same input gives the same pixels, blinks included.
    """
    if height < 64 or height % 2:
        raise InputError(f"the height is {height} pixels, required an even number of at least 64")
    poses = mouth_poses(motion, units, fps)
    return _frames(poses, lid_closure(np.arange(len(poses)) / fps), height)


def _frames(poses: list[MouthPose], shut: NDArray[np.float64], height: int) -> Iterator[NDArray[np.uint8]]:
    from lipmotion.faces.portrait.rasteriser import Rasteriser

    rasteriser = Rasteriser(height)
    for pose, lids in zip(poses, shut.tolist(), strict=True):
        yield rasteriser.picture(pose, lids)
