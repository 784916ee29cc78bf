"""The frames of a motion: a pose for each, drawn by a few threads."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from lipmotion.faces.base import Staging
from lipmotion.faces.portrait.expression import expression
from lipmotion.faces.portrait.movement import HeadPlacement
from lipmotion.faces.portrait.pose import frame_times, mouth_poses
from lipmotion.faces.portrait.rasteriser import FacePose
from lipmotion.types import Motion, Prosody, Timeline, Unit

CanvasT = TypeVar("CanvasT")
THREADS, AHEAD = 2, 6
"""Threads that draw, and frames that may be drawn before they are asked for."""


def face_poses(
    motion: Motion, units: Timeline[Unit], fps: float, staging: Staging, prosody: Prosody | None = None
) -> list[FacePose]:
    """Return the pose of every video frame, frame n at ``n / fps`` seconds. Raises InputError: as ``mouth_poses``."""
    mouths = mouth_poses(motion, units, fps, staging.intensity)
    moved = expression(
        frame_times(motion, fps),
        motion,
        units,
        prosody,
        seed=staging.seed,
        blinks=staging.blinks,
        gaze=staging.gaze,
        brows=staging.brows,
        head=staging.head,
    )
    curves = (curve.tolist() for curve in moved)
    return [
        FacePose(mouth, lids, gaze_x, gaze_y, brows, worry, HeadPlacement(*head))
        for mouth, lids, gaze_x, gaze_y, brows, worry, head in zip(mouths, *curves, strict=True)
    ]


class Draws(Protocol[CanvasT]):
    """What draws the pictures of poses, each thread on a canvas of its own."""

    def canvas(self) -> CanvasT:
        """Return what ``picture`` draws on."""

    def picture(self, pose: FacePose, canvas: CanvasT) -> NDArray[np.uint8]:
        """Return one frame."""


def pictures(rasteriser: Callable[[], Draws[CanvasT]], poses: Sequence[FacePose]) -> Iterator[NDArray[np.uint8]]:
    """Yield the pictures of poses in order; they are drawn while earlier ones are used.

    rasteriser : makes what draws; called when the first picture is asked for
    """
    drawing = rasteriser()
    canvases = threading.local()

    def drawn(pose: FacePose) -> NDArray[np.uint8]:
        if not hasattr(canvases, "own"):
            canvases.own = drawing.canvas()
        return drawing.picture(pose, canvases.own)

    waiting: deque[Future[NDArray[np.uint8]]] = deque()
    with ThreadPoolExecutor(THREADS) as threads:
        try:
            for pose in poses:
                waiting.append(threads.submit(drawn, pose))
                if len(waiting) > AHEAD:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:  # the pictures may not all have been asked for
            for future in waiting:
                future.cancel()
