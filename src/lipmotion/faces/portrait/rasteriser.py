"""Pictures of poses. The portrait is painted once; for each frame only jaw, mouth and eyes are painted again."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from lipmotion.faces.portrait import surroundings
from lipmotion.faces.portrait.eyes import paint_eyes
from lipmotion.faces.portrait.head import paint_head
from lipmotion.faces.portrait.mouth import paint_mouth
from lipmotion.faces.portrait.pose import MouthPose
from lipmotion.faces.portrait.view import Pixels, View

JAW_TOP, CHIN = 0.66, 1.3
"""Between these heights the skin is stretched when the jaw drops; below, it moves with the chin."""
LID_POSITIONS = 12


class Rasteriser:
    """Draws the face at one size."""

    def __init__(self, size: int) -> None:
        view = View(size)
        whole = view.window(-9, -9, 9, 9)
        self._jaw = view.window(-0.8, JAW_TOP, 0.8, 1.95)
        self._mouth = view.window(-0.46, JAW_TOP, 0.46, 1.6)
        self._mouth_in_jaw = self._mouth.area_in(self._jaw)
        self._eyes = view.window(-0.62, -0.2, 0.62, 0.14)
        backdrop, skin = surroundings.backdrop(whole), paint_head(whole)
        face = surroundings.hair(whole).over(skin.over(backdrop))
        self._still = _bytes(face)
        self._bare_eyes = face[self._eyes.area]
        self._behind_jaw = backdrop[self._jaw.area]
        self._neck_shade = surroundings.shaded_neck(self._jaw).over(self._behind_jaw) - self._behind_jaw
        shadow = surroundings.chin_shadow(self._jaw)
        self._jaw_skin = np.dstack([skin.pixels[self._jaw.area], shadow])
        self._jaw_steps = np.diff(self._jaw_skin, axis=0)
        self._lids = lru_cache(maxsize=LID_POSITIONS + 1)(self._painted_eyes)

    def picture(self, pose: MouthPose, shut: float) -> NDArray[np.uint8]:
        """Return one RGB frame [shape=(size, size, 3)].

        shut : how far the eyes are closed, 0..1
        """
        frame = self._still.copy()
        frame[self._eyes.area] = self._lids(round(shut * LID_POSITIONS))
        skin = self._dropped(pose.jaw)
        paint_mouth(skin[self._mouth_in_jaw], self._mouth, pose)
        frame[self._jaw.area] = _bytes(skin)
        return frame

    def _painted_eyes(self, position: int) -> NDArray[np.uint8]:
        return _bytes(paint_eyes(self._eyes, position / LID_POSITIONS).over(self._bare_eyes))

    def _dropped(self, jaw: float) -> Pixels:
        """Return the lower face with the chin lowered by ``jaw`` [shape=(h, w, 3)]; the skin above is stretched."""
        y = self._jaw.rows()
        share = np.clip((y - JAW_TOP) / (CHIN - JAW_TOP), 0, 1)
        row = np.interp(y, y + jaw * share * share * (3 - 2 * share), np.arange(len(y)))
        low = np.minimum(row.astype(int), len(y) - 2)
        part = (row - low).astype(np.float32)[:, None, None]
        skin = self._jaw_steps[low]
        skin *= part
        skin += self._jaw_skin[low]
        behind = skin[..., 4:] * self._neck_shade
        behind += self._behind_jaw
        behind *= 1 - skin[..., 3:4]
        behind += skin[..., :3]
        return behind


def _bytes(pixels: Pixels) -> NDArray[np.uint8]:
    return (pixels + np.float32(0.5)).astype(np.uint8)
