"""The user's own character as a face: its mesh, moved by its blendshapes or control points, drawn by the rasteriser."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property
from pathlib import Path
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.mouth import frame_times
from lipmotion.errors import InputError
from lipmotion.meshes.fitting.blendshape_motion import with_mouth
from lipmotion.meshes.fitting.driven import DrivenCharacter, DrivenPose
from lipmotion.meshes.fitting.eyes_and_brows import eye_and_brow_weights
from lipmotion.storage.files import atomic_file
from lipmotion.types import Motion, Prosody, Timeline, Unit
from lipmotion_faces.base import SMALLEST_PX, TRANSPARENT, DrawnMotion, Face, Picture, Staging, stage_liveliness
from lipmotion_faces.mesh.stage import MeshStage

__all__ = ["MeshFace", "MeshStage", "write_picture"]

WIDTH, HEIGHT = 1280, 720
FRAMES_AHEAD = 2
"""Pictures that are drawn before they are asked for."""


class MeshPose(NamedTuple):
    """A character in one frame: of ``DrivenCharacter.poses``, angles of the head, and of the eyes, in radians."""

    row: DrivenPose
    turn: tuple[float, float, float]
    look: tuple[float, float]


@final
class MeshFace(Face):
    """A character from a file, head and shoulders from the front.

    character     : from ``load_character``
    width, height : of the pictures in pixels, even; a size of the staging counts instead, 16 to 9
    staging       : background, seed, and what moves on its own; None: the defaults
    prosody       : of the speech that will be rendered, for accents of brows and head; None: not known
    """

    def __init__(
        self,
        character: DrivenCharacter,
        width: int = WIDTH,
        height: int = HEIGHT,
        staging: Staging | None = None,
        prosody: Prosody | None = None,
    ) -> None:
        self.staging = staging or Staging()
        self._character, self._prosody, self._size = character, prosody, (width, height)

    @property
    def character(self) -> DrivenCharacter:
        """The character that is shown."""
        return self._character

    def staged(self, staging: Staging, prosody: Prosody | None = None) -> MeshFace:
        """Return the same character with other settings.

        prosody : of the speech that will be rendered, for accents of brows and head; None: not known
        """
        return MeshFace(self._character, *self._size, staging, prosody)

    def render(self, motion: Motion, units: Timeline[Unit], *, fps: float = 25.0) -> Iterator[NDArray[np.uint8]]:  # noqa: D102
        return iter(self.drawn(motion, units, fps=fps))

    def drawn(self, motion: Motion, units: Timeline[Unit], *, fps: float = 25.0) -> DrawnMotion[MeshPose]:  # noqa: D102
        if not 0 < fps < np.inf:
            raise InputError(f"the frame rate is {fps}, required more than 0")
        time_s = frame_times(len(motion.values), motion.rate_hz, fps)
        moved = stage_liveliness(time_s, with_mouth(motion), units, self.staging, self._prosody)
        rows = self._character.poses(motion, units, time_s, eye_and_brow_weights(moved))
        gaze = moved.gaze if not self._character.has_shape("eyeLookOutLeft") else np.zeros_like(moved.gaze)
        turns, looks = moved.turn.tolist(), gaze.tolist()
        poses = [
            MeshPose(row, (yaw, pitch, roll), (across, up))
            for row, (yaw, pitch, roll), (across, up) in zip(rows, turns, looks, strict=True)
        ]
        return DrawnMotion(poses, lambda: self._painter, FRAMES_AHEAD)

    @cached_property
    def _painter(self) -> Callable[[MeshPose], Picture]:
        width, height = self._size
        if self.staging.size:
            width, height = max(2 * round(self.staging.size * 8 / 9), SMALLEST_PX), self.staging.size
        stage = MeshStage(self._character, width, height, self.staging.colour)
        draw = stage.cut_out if self.staging.background == TRANSPARENT else stage.picture
        return lambda pose: draw(self._character.place_vertices(pose.row), pose.turn, pose.look)


def write_picture(path: Path, character: DrivenCharacter) -> None:
    """Write a picture of a character at rest as PNG. Raises ExportError: it cannot be written."""
    from PIL import Image

    picture = MeshStage(character, WIDTH, HEIGHT).picture(character.mesh.vertices)
    with atomic_file(path) as unfinished:
        Image.fromarray(picture).save(unfinished, format="PNG")
