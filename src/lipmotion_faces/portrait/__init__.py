"""Drawn characters: flat portraits whose mouths are drawn from the motion. They need numpy and Pillow only.

The stages of a frame: ``list_face_poses`` (motion, phones and voice → numbers) → ``geometry`` (numbers → outlines) →
``mouth_painting`` (outlines → pixels) → ``portrait_rasteriser`` (pixels → picture, moved by ``movement``). The still
parts are painted once, by ``parts`` on a ``layer``.
A character is a ``design``: ``woman``, ``man``, ``cartoon``.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar, final

import numpy as np
from numpy.typing import NDArray

from lipmotion.types import Motion, Prosody, Timeline, Unit
from lipmotion_faces.base import TRANSPARENT, DrawnMotion, Face, Staging

if TYPE_CHECKING:
    from lipmotion_faces.portrait.portrait_rasteriser import FacePose, Rasteriser

__all__ = ["Cartoon", "DrawnFace", "Man", "Portrait", "Woman"]

OWN_SIZE = 640  # height of pictures whose size is not given


class DrawnFace(Face):
    """A drawn character; ``character`` names its design in ``characters``.

    Motion needs ``opening``; ``width``, ``outer``, the chin ``y_152`` and the articulatory channels are used where they
    exist. ``width`` and ``outer`` are taken relative to the rest pose in silence, so they suit any speaker.
    """

    character: ClassVar[str]

    def __init__(self, staging: Staging | None = None, prosody: Prosody | None = None) -> None:
        self.staging, self.prosody = staging or Staging(), prosody

    def with_staging(self, staging: Staging, prosody: Prosody | None = None) -> DrawnFace:
        """Return the same character with other settings; ``prosody`` is of the speech that will be rendered."""
        return type(self)(staging, prosody)

    def render(self, motion: Motion, units: Timeline[Unit], *, fps: float = 25.0) -> Iterator[NDArray[np.uint8]]:  # noqa: D102
        return iter(self.draw(motion, units, fps=fps))

    def draw(self, motion: Motion, units: Timeline[Unit], *, fps: float = 25.0) -> DrawnMotion[FacePose]:  # noqa: D102
        from lipmotion_faces.portrait.portrait_rasteriser import list_face_poses

        poses = list_face_poses(motion, units, fps, self.staging, self.prosody)
        return DrawnMotion(poses, lambda: self._rasteriser.paint)

    @cached_property
    def _rasteriser(self) -> Rasteriser:
        from lipmotion_faces.portrait import characters
        from lipmotion_faces.portrait.portrait_rasteriser import Rasteriser

        chosen = self.staging
        background = None if chosen.background == TRANSPARENT else chosen.colour or chosen.background
        return Rasteriser(getattr(characters, self.character), chosen.size or OWN_SIZE, background)


@final
class Woman(DrawnFace):
    """A woman with long hair."""

    character = "WOMAN"


Portrait = Woman  # the best of the characters: what is shown where none is asked for


@final
class Man(DrawnFace):
    """A man with short hair."""

    character = "MAN"


@final
class Cartoon(DrawnFace):
    """A flat cartoon with lines around its surfaces."""

    character = "CARTOON"
