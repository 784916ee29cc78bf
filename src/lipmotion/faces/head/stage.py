"""The character before the camera: pictures of poses."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from lipmotion.faces.head.figure import Figure
from lipmotion.faces.head.head_blendshapes import head_mesh
from lipmotion.faces.head.pose import CharacterPose
from lipmotion.meshes.model.mesh import Mesh
from lipmotion.meshes.rendering.rasteriser import Camera, Canvas, flat

CENTRE = (0.0, -0.03)
PICTURE_HEIGHT = 3.35
"""Height of the picture, in eye distances."""


@cache
def figure() -> Figure:
    """Return the character, made once in a process."""
    return Figure()


@cache
def mesh_of_figure(*, moods: bool = False) -> Mesh:
    """Return the character as a mesh with blendshapes, of ``head_mesh``, made once in a process."""
    return head_mesh(figure(), moods=moods)


def camera_for(width: int, height: int) -> Camera:
    """Return the camera for a size of pictures. Raises InputError: a size that is odd or under 64."""
    return Camera(width, height, CENTRE, PICTURE_HEIGHT)


class Stage:
    """Character, light and camera; may be used by several threads at once.

    colour : red, green and blue of the background, 0 to 255; None: a soft gradient
    """

    def __init__(self, camera: Camera, colour: tuple[int, int, int] | None = None) -> None:
        self.figure = figure()
        self.canvas = Canvas(camera, None if colour is None else flat(camera, colour))
        self._dark = Canvas(camera, flat(camera, (0, 0, 0)))
        still = self.figure.frame(CharacterPose(), camera.place)
        first = self.figure.first_still_triangle
        self._still = self.canvas.picture(still.places, still.light, self.figure.triangles[first:])

    def picture(self, pose: CharacterPose) -> NDArray[np.uint8]:
        """Return the picture of a pose [shape=(H, W, 3)]; only the box around head and neck is drawn anew."""
        drawn = self.figure.frame(pose, self.canvas.camera.place)
        return self.canvas.picture(
            drawn.places, drawn.light, self.figure.triangles, onto=self._still, moving=self.figure.head
        )

    def cut_out(self, pose: CharacterPose) -> NDArray[np.uint8]:
        """Return the picture of a pose without background, with straight alpha [shape=(H, W, 4)]."""
        drawn = self.figure.frame(pose, self.canvas.camera.place)
        return self._dark.cut_out(drawn.places, drawn.light, self.figure.triangles)

    def parts_seen(self, pose: CharacterPose) -> dict[str, NDArray[np.bool_]]:
        """Return which pixels show each part of the mouth: lips, wall, tongue, teeth (lower), upper teeth.

        Every mask has the size of the picture [shape=(H, W)].
        """
        drawn = self.figure.frame(pose, self.canvas.camera.place)
        seen = {}
        for name, rows in self.figure.mouth_rows().items():
            marked = np.zeros(len(drawn.places), bool)
            marked[rows] = True
            seen[name] = self.canvas.shown(drawn.places, marked, self.figure.triangles)
        return seen
