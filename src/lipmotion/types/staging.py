"""How a face is shown, beside what it says."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from lipmotion.errors import InputError, shorten
from lipmotion.types.configuration import Configuration, Rule, option

SCENE, TRANSPARENT = "scene", "transparent"
SMALLEST_PX, LARGEST_PX = 64, 4096
"""Range of the height of pictures, in pixels."""
_MOVING: dict[str, Any] = {
    "still": "--still",
    "metavar": "NAME,NAME",
    "help": "what does not move on its own, with commas: blinks,gaze,brows,head",
}


@dataclass(frozen=True)
class Staging(Configuration):
    """How a face is shown, beside what it says.

    size       : height of the picture in pixels, an even number; 0: the face's own
    background : ``scene`` (the face's own), ``transparent``, or a colour as ``#40a0ff``
    blinks, gaze, brows, head : whether these move on their own
    seed       : of the movements that depend on chance
    Raises InputError: a value out of its range, or no such background.

    >>> Staging(size=480, head=False, background="#40a0ff").colour
    (64, 160, 255)
    """

    size: int = option(0, Rule(least=0), metavar="PIXELS", help="height of the face's picture")
    background: str = SCENE
    blinks: bool = option(True, **_MOVING)
    gaze: bool = option(True, **_MOVING)
    brows: bool = option(True, **_MOVING)
    head: bool = option(True, **_MOVING)
    seed: int = option(0, Rule(least=0), flags=("--face-seed",), metavar="N", help="other blinks, glances and nods")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.size and not (SMALLEST_PX <= self.size <= LARGEST_PX and self.size % 2 == 0):
            raise InputError(
                f"the size is {self.size} pixels, required an even number from {SMALLEST_PX} to {LARGEST_PX}"
            )
        if self.background not in (SCENE, TRANSPARENT) and not re.fullmatch("#[0-9a-fA-F]{6}", self.background):
            raise InputError(
                f"the background is {shorten(self.background)!r}, required scene, transparent, or a colour as "
                "#40a0ff; a video is for filmed faces; give one: --face FILE.face"
            )

    @property
    def colour(self) -> tuple[int, int, int] | None:
        """Red, green and blue of the background, 0..255; None: it has no single colour."""
        if not self.background.startswith("#"):
            return None
        return int(self.background[1:3], 16), int(self.background[3:5], 16), int(self.background[5:7], 16)
