from __future__ import annotations

import numpy as np
import pytest

from lipmotion_faces.appearance.poisson import CLEARANCE, GridFiller, nested_grids


def disc(height: int, width: int) -> np.ndarray:
    y, x = np.mgrid[:height, :width]
    region = ((x + 0.5) / width - 0.5) ** 2 + ((y + 0.5) / height - 0.5) ** 2 < 0.24
    region[[0, -1]] = region[:, [0, -1]] = False
    return region


@pytest.mark.parametrize("shape", [(57, 71), (130, 101), (5, 40), (3, 3)])
def test_filling_is_the_matrix(shape: tuple[int, int]) -> None:
    grids = nested_grids(disc(*shape))
    matrix = grids.matrix()
    for colours in (1, 3):
        filler = GridFiller(grids, 2, colours)
        for count in (2, 1):  # memory that was used before changes nothing
            values = np.random.default_rng(count).normal(size=(count, matrix.shape[1], colours)).astype(np.float32)
            filled = filler.fill(values)
            for t in range(count):
                expected = (matrix @ values[t]).reshape(*shape, colours)
                assert np.abs(filled[t] - expected)[grids.region].max() < 1e-5


def test_cubic_functions_are_exact() -> None:
    grids = nested_grids(disc(130, 150))
    y, x = np.mgrid[:130, :150] / 150 - 0.5
    cubic = (x**3 - 3 * x * y**2 + y**2 - x).ravel()
    filled = grids.matrix() @ cubic[np.concatenate(grids.nodes)]
    inside = grids.region.ravel()
    assert filled[inside] == pytest.approx(cubic[inside], abs=1e-12)


def test_all_pixels_near_the_edge_are_nodes_and_few_inside() -> None:
    region = np.zeros((200, 200), bool)
    region[1:-1, 1:-1] = True
    grids = nested_grids(region)
    nodes = np.zeros(region.size, bool)
    nodes[np.concatenate(grids.nodes)] = True
    nodes = nodes.reshape(region.shape)
    assert nodes[1 : 1 + CLEARANCE, 1:-1].all()
    assert nodes[80:120, 80:120].mean() < 0.01
