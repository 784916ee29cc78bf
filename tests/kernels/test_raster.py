import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion_faces.kernels import raster
from oracles import drawing as oracle

TONE = np.arange(256).astype(np.uint8)
HEIGHT, WIDTH = 40, 56


def drawn(points, colours, triangles, *, area=(0, 0, WIDTH, HEIGHT), background=0.0, draw=raster.draw) -> np.ndarray:
    picture = np.full((HEIGHT, WIDTH, 3), 7, np.uint8)
    behind = np.full((HEIGHT, WIDTH, 3), background, np.float32)
    light, corners = np.asarray(colours, np.float32), np.asarray(triangles, np.int32)
    draw(np.asarray(points, float), light, corners, area, behind, TONE, picture)
    return picture


def square(x0: float, y0: float, x1: float, y1: float, depth: float = 0.0) -> list[list[float]]:
    return [[x0, y0, depth], [x0, y1, depth], [x1, y1, depth], [x1, y0, depth]]


FACING = [[0, 1, 2], [0, 2, 3]]


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=15)
def test_every_bit_is_that_of_the_definition(seed):
    draw = np.random.default_rng(seed)
    points = draw.uniform([-9, -9, 0], [WIDTH + 9, HEIGHT + 9, 1], (40, 3))
    points[::3] = np.rint(points[::3])  # edges through the middles of samples
    colours, triangles = draw.uniform(0, 1.1, (40, 3)), draw.integers(0, 40, (60, 3))
    first, second = (
        drawn(points, colours, triangles, area=(3, 5, 50, 31), background=0.3, draw=form)
        for form in (raster.draw, oracle.draw)
    )
    assert np.array_equal(first, second)


def test_a_square_covers_its_pixels_and_no_others_and_half_a_pixel_is_half_the_light():
    picture = drawn(square(8, 10, 20, 15), np.ones((4, 3)), FACING)
    assert (picture[10:15, 8:20] == 255).all()
    assert picture.astype(int).sum() == 255 * 3 * 5 * 12
    picture = drawn(square(8.5, 10, 20, 15), np.ones((4, 3)), FACING)
    assert (picture[10:15, 8] == 127).all()


def test_triangles_that_share_edges_leave_no_gap_and_draw_nothing_twice():
    """A fan of triangles about an odd place: every sample is covered, by one triangle."""
    ring = [[5 + 40 * i / 9, 4] for i in range(10)] + [[45, 4 + 30 * i / 7] for i in range(1, 8)]
    ring += [[45 - 40 * i / 9, 34] for i in range(1, 10)] + [[5, 34 - 30 * i / 7] for i in range(1, 7)]
    points = np.array([[21.37, 18.91, 0.5], *([x, y, 0.5] for x, y in ring)])
    count = len(ring)
    fan = [[0, 1 + (n + 1) % count, 1 + n] for n in range(count)]
    whole = drawn(points, np.ones((len(points), 3)), fan)
    assert (whole[4:34, 5:45] == 255).all()
    alone = sum(drawn(points, np.ones((len(points), 3)), [each]).astype(int) // 51 for each in fan)
    assert (alone[5:33, 6:44] <= 5).all()


def test_the_nearer_triangle_is_seen_whatever_the_order():
    points = [*square(5, 5, 30, 30, 0.2), *square(10, 10, 40, 35, 0.1)]
    colours = [[1, 0, 0]] * 4 + [[0, 1, 0]] * 4
    near, far = [[4, 5, 6], [4, 6, 7]], FACING
    for triangles in (near + far, far + near):
        picture = drawn(points, colours, triangles)
        assert picture[20, 20].tolist() == [0, 255, 0]
        assert picture[7, 7].tolist() == [255, 0, 0]
