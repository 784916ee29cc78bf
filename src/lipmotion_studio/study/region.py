"""Parts of pictures: what of a video raters see."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from lipmotion.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Pictures = NDArray[np.uint8]
SMALLEST_REGION_PX = 16


@dataclass(frozen=True)
class Region:
    """A part of pictures, as shares of their width and height, from the upper left corner.

    Raises InputError: it is not inside.

    >>> Region.parsed("0.25,0.5,0.5,0.4")
    Region(left=0.25, top=0.5, width=0.5, height=0.4)
    """

    left: float = 0.0
    top: float = 0.0
    width: float = 1.0
    height: float = 1.0

    def __post_init__(self) -> None:
        inside = (
            0 <= self.left < self.left + self.width <= 1 + 1e-9 and 0 <= self.top < self.top + self.height <= 1 + 1e-9
        )
        if not inside:
            raise InputError(
                f"the region {self.left:g},{self.top:g},{self.width:g},{self.height:g}, required shares of width and "
                "height inside the picture: LEFT,TOP,WIDTH,HEIGHT"
            )

    @classmethod
    def parsed(cls, text: str) -> Region:
        """Return the region of a text ``LEFT,TOP,WIDTH,HEIGHT``; of an empty one, the whole picture.

        Raises InputError: not four numbers, or not inside.
        """
        if not text:
            return cls()
        try:
            left, top, width, height = map(float, text.split(","))
        except ValueError as error:
            raise InputError(f"the region {text!r}, required four numbers: LEFT,TOP,WIDTH,HEIGHT") from error
        return cls(left, top, width, height)

    def cut(self, picture: Pictures) -> Pictures:
        """Return the part of a picture [shape=(H, W, 3)], of even height and width. Raises InputError: too small."""
        full_height, full_width = picture.shape[:2]
        top, left = round(self.top * full_height), round(self.left * full_width)
        height, width = (round(self.height * full_height) // 2 * 2, round(self.width * full_width) // 2 * 2)
        part = picture[top : top + height, left : left + width]
        part = part[: len(part) // 2 * 2, : part.shape[1] // 2 * 2]
        if min(part.shape[:2]) < SMALLEST_REGION_PX:
            raise InputError(f"the region has {part.shape[1]} × {part.shape[0]} pixels; give a larger one")
        return part
