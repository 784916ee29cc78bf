import numpy as np
import pytest

from lipmotion_faces.kernels.textured import SOLID, TexturedTriangles, draw_textured

TONE = np.arange(256).astype(np.uint8)
HEIGHT, WIDTH = 40, 56
FACING = [[0, 1, 2], [0, 2, 3]]
CORNERS = np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]])  # of a square, as ``square`` has them: v goes down
WHITE = np.full((4, 3), 1.0)


def surface(triangles, uv, texture, *, kind=SOLID, cut=0.5, factor=1.0, row=0) -> TexturedTriangles:
    """Triangles with one texture [shape=(h, w, 4), 0 to 1]."""
    count = len(triangles)
    return TexturedTriangles(
        np.asarray(triangles, np.int32),
        np.asarray(uv, float),
        np.tile(np.array([row, kind], np.int32), (count, 1)),
        np.tile([cut, factor], (count, 1)),
        np.rint(65535 * np.asarray(texture, float)).astype(np.uint16).reshape(-1, 4),
        np.array([[0, np.shape(texture)[1], np.shape(texture)[0]]]),
    )


def drawn(points, light, what, *, shine=None, area=(0, 0, WIDTH, HEIGHT), background=0.0, draw=draw_textured):
    picture, opacity = np.full((HEIGHT, WIDTH, 3), 7, np.uint8), np.full((HEIGHT, WIDTH), 7, np.uint8)
    behind = np.full((HEIGHT, WIDTH, 3), background, np.float32)
    glare = np.zeros(np.shape(light)) if shine is None else shine
    lights = np.asarray(light, np.float32), np.asarray(glare, np.float32)
    draw(np.asarray(points, float), *lights, what, area, behind, TONE, picture, opacity)
    return picture, opacity


def square(x0: float, y0: float, x1: float, y1: float, near: float = 1.0) -> list[list[float]]:
    return [[x0, y0, -near], [x0, y1, -near], [x1, y1, -near], [x1, y0, -near]]


def test_a_texture_is_seen_where_it_lies():
    texture = np.ones((2, 2, 4))
    texture[0, 0, :3], texture[0, 1, :3] = (1, 0, 0), (0, 1, 0)
    texture[1, 0, :3], texture[1, 1, :3] = (0, 0, 1), (1, 1, 1)
    picture, opacity = drawn(square(8, 10, 28, 30), WHITE, surface(FACING, CORNERS[FACING], texture))
    assert picture[15, 13].tolist() == pytest.approx([255, 0, 0], abs=30)
    assert picture[15, 23].tolist() == pytest.approx([0, 255, 0], abs=30)
    assert picture[25, 13].tolist() == pytest.approx([0, 0, 255], abs=30)
    assert picture[25, 23].tolist() == pytest.approx([255, 255, 255], abs=30)
    assert opacity[15, 13] == 255
    assert opacity[5, 5] == 0


def test_between_texels_the_texture_is_interpolated():
    """From black in the middle of the first texel to white in that of the second one, evenly."""
    texture = np.ones((1, 2, 4))
    texture[0, 0, :3] = 0
    picture, _ = drawn(square(0, 0, 40, 40), WHITE, surface(FACING, CORNERS[FACING], texture))
    assert np.diff(picture[20, 10:30, 0].astype(int)) == pytest.approx(np.full(19, 255 / 20), abs=1)


def test_a_texture_on_a_slanting_surface_is_seen_in_perspective():
    """A square whose right edge is three times as far: its middle is seen nearer to that edge."""
    near, far = 1.0, 1 / 3
    points = [[0, 0, -near], [0, 40, -near], [40, 40, -far], [40, 0, -far]]
    texture = np.ones((1, 64, 4))
    texture[0, 32:, :3] = 0
    picture, _ = drawn(points, WHITE, surface(FACING, CORNERS[FACING], texture))
    assert int((picture[20, 1:40, 0] > 127).sum()) + 1 == pytest.approx(30, abs=1)
