"""Scenes: what does not fit is refused, normals are smooth."""

from __future__ import annotations

import numpy as np
import pytest

from lipmotion.errors import ExportError, InputError
from lipmotion.meshes.model.scene import HeadTurn, Scene, compute_shading_normals
from lipmotion.types import WEIGHT, Channel, Motion
from meshes.heads import head, shaped


def weights(name: str = "jawOpen") -> Motion:
    return Motion(np.linspace(0, 1, 4)[:, None], 25.0, (Channel(name, WEIGHT),))


def test_weights_are_in_the_order_of_the_mesh() -> None:
    table = Scene(head(), weights()).table()
    column = head().shape_names.index("jawOpen")
    assert table[:, column] == pytest.approx(np.linspace(0, 1, 4))
    assert np.delete(table, column, axis=1) == pytest.approx(np.zeros((4, table.shape[1] - 1)))


def test_a_channel_that_is_no_shape_is_refused() -> None:
    with pytest.raises(ExportError, match="no blendshape 'opening'"):
        Scene(head(), weights("opening"))


@pytest.mark.parametrize(("vertices", "frames"), [(3, 4), (None, 5)])
def test_a_turn_that_does_not_fit_is_refused(vertices: int | None, frames: int) -> None:
    share = np.ones(len(head().vertices) if vertices is None else vertices)
    turn = HeadTurn(np.zeros(3), share, np.tile([0.0, 0, 0, 1], (frames, 1)))
    with pytest.raises(InputError, match=f"and \\({frames}, 4\\) frames, required"):
        Scene(head(), weights(), turn)


def test_normals_are_of_length_one_and_turn_with_the_shape() -> None:
    mesh = head()
    normals = compute_shading_normals(mesh)
    assert np.linalg.norm(normals.rest, axis=1) == pytest.approx(np.ones(len(mesh.vertices)))
    number = mesh.shape_names.index("jawOpen")
    rows, change = normals.turned[number]
    moved = type(mesh)(shaped(mesh, {"jawOpen": 1.0}), mesh.triangles, mesh.parts)
    after = compute_shading_normals(moved, split=False).rest
    assert len(rows) > 10
    inner = np.isin(rows, mesh.shapes[number].rows)
    assert (normals.rest[rows] + change)[inner] == pytest.approx(after[rows][inner], abs=0.35)
    assert set(rows.tolist()) != set(range(len(mesh.vertices)))
