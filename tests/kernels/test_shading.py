import numpy as np
import pytest

from lipmotion_faces.kernels import shading


@pytest.mark.usefixtures("form")
def test_normals_are_those_of_the_triangles_around_a_vertex():
    places = np.array([[0, 0, 0], [2, 0, 0], [0, 3, 0], [0, 0, 5], [9, 9, 9]], float)
    sums = shading.sum_normals(places, np.array([[0, 1, 2], [0, 2, 3]], np.int32))
    assert sums == pytest.approx(np.array([[15, 0, 6], [0, 0, 6], [15, 0, 6], [15, 0, 0], [0, 0, 0]], float))


def light_of(normal, *, reaches=(1.0, 1.0), lamp=0) -> np.ndarray:
    lamps = np.zeros((6, 6))
    lamps[lamp] = [0, 0, 1, 1, 1, 1]
    lamps[4:, :3] = 0.1
    finish = np.array([[0.2, 0.2, 0.2, 0.0, 4, 0.0, 0.0]])
    return shading.shade(
        np.array([normal], float), np.zeros((1, 3)), np.array([0, 0, 9.0]), np.full((1, 3), 0.5),
        np.array([reaches]), np.zeros((1, 3)), np.zeros(1, int), finish, lamps,
    )[0]  # fmt: skip


def test_a_surface_that_faces_the_lamp_is_brightest_and_what_is_hidden_is_dark():
    facing, turned, away = (float(light_of(n)[0]) for n in ([0, 0, 1], [0.8, 0, 0.6], [0.99, 0, -0.14]))
    assert facing > turned > away > 0
    open_, shaded, hidden = (float(light_of([0, 0, 1], reaches=r)[0]) for r in ((1, 1), (1, 0), (0, 0)))
    assert open_ > shaded > hidden
    assert hidden == pytest.approx(0)
    assert float(light_of([0, 0, 1], reaches=(1, 0), lamp=1)[0]) > shaded + 0.1  # light from the side passes
