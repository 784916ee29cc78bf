"""Smooth functions on a region of a picture, given at few pixels: all near the edge, fewer and fewer further inside."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import prod
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Index = NDArray[np.intp]
Floats = NDArray[np.float32]

CLEARANCE = 4
"""A pixel is interpolated from neighbours at distance s only where the edge of the region is further away than this
times s. At least 3, the reach of the interpolation. With 4 the error for noise of grey levels is below 1 grey level;
with 5 it is a third of that, at a quarter more time (docs/results/video.md)."""
LEVELS = 4
"""The pixels of the widest grid are 2 to this power apart, px."""
TAPS = ((-3, -1 / 16), (-1, 9 / 16), (1, 9 / 16), (3, -1 / 16))
"""Offset, in spacings of the grid that is filled, and weight of the four neighbours of cubic interpolation."""


@dataclass(frozen=True, eq=False)
class NestedGrids:
    """The pixels of a region at which a smooth function must be given, the nodes, and the way to all its pixels.

    Grid n has every 2ⁿ-th row and column of the picture. A pixel that lies on grid n and on no wider one is a node
    where the edge is no further than ``CLEARANCE`` · 2ⁿ; otherwise it is interpolated from grid n + 1. On the widest
    grid every pixel of the region is a node. For a function that satisfies the Laplace equation this loses little: the
    further from the edge, the smoother it is.
    Source: the adaptive grid of Agarwala 2007, with cubic instead of linear interpolation.

    region : bool array [shape=(H, W)]
    nodes  : of each grid, finest first: numbers of the pixels of the picture, counted row by row
    """

    region: NDArray[np.bool_]
    nodes: tuple[Index, ...]

    @cached_property
    def positions(self) -> list[Index]:
        """The nodes of each grid, as numbers of the pixels of that grid, counted row by row."""
        width = self.region.shape[1]
        return [
            (pixels // width >> level) * self.shape(level)[1] + (pixels % width >> level)
            for level, pixels in enumerate(self.nodes)
        ]

    def shape(self, level: int) -> tuple[int, int]:
        """Return the number of rows and columns of a grid."""
        height, width = self.region.shape
        return -(-height >> level), -(-width >> level)

    def matrix(self) -> csr_array:
        """Return the interpolation as a matrix [shape=(H · W, number of nodes)], with empty rows outside the region."""
        from scipy.sparse import csr_array

        count, width = self.region.size, self.region.shape[1]
        nodes = np.concatenate(self.nodes)
        basis = csr_array((np.ones(len(nodes)), (nodes, np.arange(len(nodes)))), shape=(count, len(nodes)))
        between = np.setdiff1d(np.flatnonzero(self.region), nodes)
        spacing = 1 << _levels(self.region.shape, len(self.nodes) - 1).ravel()[between]
        odd_row, odd_column = (between // width // spacing) % 2, (between % width // spacing) % 2
        weights = csr_array((count, count))
        for row, row_weight in TAPS:
            for column, column_weight in TAPS:  # without an odd row or column the four taps fall on one pixel
                weight = np.where(odd_row, row_weight, 1 / 4) * np.where(odd_column, column_weight, 1 / 4)
                neighbour = between + (row * odd_row * width + column * odd_column) * spacing
                weights += csr_array((weight, (between, neighbour)), shape=(count, count))
        whole = basis
        for _ in range(len(self.nodes) - 1):  # a pixel depends on wider grids, and these on still wider ones
            whole = basis + weights @ whole
        return whole


class GridFiller:
    """Interpolates from the nodes to all pixels of some pictures, without new memory for each."""

    def __init__(self, grids: NestedGrids, count: int, colours: int) -> None:
        """Take memory for ``count`` pictures of so many colours at once."""
        self._grids = grids
        shapes = [grids.shape(level) for level in range(len(grids.nodes))]
        self._filled = [np.zeros((count, *shape, colours), np.float32) for shape in shapes]
        halves = [(coarse[0], fine[1]) for fine, coarse in pairwise(shapes)]
        self._half = [np.zeros((count, *shape, colours), np.float32) for shape in halves]
        self._scratch = np.empty((2, max((count * prod(shape) * colours for shape in halves), default=0)), np.float32)

    def fill(self, values: Floats) -> Floats:
        """Return the function at all pixels [shape=(t, H, W, C)], valid in the region, until the next call.

        values : at the nodes of up to ``count`` pictures [shape=(t, number of nodes, C)], finest grid first
        """
        count, stop = values.shape[:2]
        for level in reversed(range(len(self._filled))):
            fine = self._filled[level][:count]
            if level + 1 < len(self._filled):
                self._widen(self._filled[level + 1][:count], self._half[level][:count], fine)
            start = stop - len(self._grids.nodes[level])
            fine.reshape(count, -1, fine.shape[-1])[:, self._grids.positions[level]] = values[:, start:stop]
            stop = start
        return self._filled[0][:count]

    def _widen(self, coarse: Floats, half: Floats, fine: Floats) -> None:
        """Fill a grid [shape=(t, h, w, C)] from every second row and column of it.

        Rows and columns nearer than three to the sides of the grid, where a neighbour is missing, are not valid.
        """
        half[:, :, ::2] = coarse
        self._fill_between(coarse, half[:, :, 1::2], 2)
        fine[:, ::2] = half
        self._fill_between(half, fine[:, 1::2], 1)

    def _fill_between(self, values: Floats, out: Floats, axis: int) -> None:
        """Write the values in the middle between neighbours along an axis, except the first and the last."""
        count = values.shape[axis] - 1
        if count < 3:
            return
        length = list(values.shape)
        length[axis] = count
        pairs = self._scratch[0, : prod(length)].reshape(length)
        length[axis] = count - 2
        outer = self._scratch[1, : prod(length)].reshape(length)
        np.add(_part(values, axis, 0, count), _part(values, axis, 1, count + 1), out=pairs)
        np.add(_part(pairs, axis, 0, count - 2), _part(pairs, axis, 2, count), out=outer)
        outer *= np.float32(-1 / 16)  # both together have the weights of TAPS
        pairs *= np.float32(10 / 16)
        np.add(outer, _part(pairs, axis, 1, count - 1), out=_part(out, axis, 1, count - 1))


def nested_grids(region: NDArray[np.bool_]) -> NestedGrids:
    """Return the nodes of a region: bool array [shape=(H, W)] that is False on its outermost pixels."""
    from scipy.ndimage import distance_transform_cdt

    clearance = distance_transform_cdt(region, "chessboard")
    widest = max((level for level in range(1, LEVELS + 1) if clearance.max() > CLEARANCE << (level - 1)), default=0)
    levels = _levels(region.shape, widest)
    node = region & ((levels == widest) | (clearance <= CLEARANCE << levels))
    return NestedGrids(region, tuple(np.flatnonzero(node & (levels == level)) for level in range(widest + 1)))


def _levels(shape: tuple[int, ...], widest: int) -> Index:
    """Return the widest grid that each pixel lies on, up to grid ``widest`` [shape=(H, W)]."""
    levels = np.zeros(shape, np.intp)
    for level in range(1, widest + 1):
        levels[:: 1 << level, :: 1 << level] = level
    return levels


def _part(values: Floats, axis: int, start: int, stop: int) -> Floats:
    return values[(slice(None),) * axis + (slice(start, stop),)]
