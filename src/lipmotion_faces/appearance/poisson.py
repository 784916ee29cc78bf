"""Poisson cloning: a region of one picture in another one, with the gradient of the first and the edge of the second.

Inside the region the result u has the Laplacian of the source s; on the edge it is the background b. So u = s + e, and
e is the solution of the Laplace equation whose values on the edge are b − s: a membrane. It depends only on the edge.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.kernels.compiler import limit_threads

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Index = NDArray[np.intp]
Floats = NDArray[np.float32]

CLEARANCE = 4
"""A pixel is interpolated from neighbours at distance s only where the edge of the region is further away than this
times s. At least 3, the reach of the interpolation. With 4 the error for noise of grey levels is below 1 grey level;
with 5 it is a third of that, at a quarter more time (docs/results/video.md)."""
LEVELS = 4  # the pixels of the widest grid are 2 to this power apart, px
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
    """

    region: NDArray[np.bool_]  # bool array [shape=(H, W)]
    nodes: tuple[Index, ...]  # of each grid, finest first: numbers of the pixels of the picture, counted row by row

    def shape(self, level: int) -> tuple[int, int]:
        """Return the number of rows and columns of a grid."""
        height, width = self.region.shape
        return -(-height >> level), -(-width >> level)

    def build_matrix(self) -> csr_array:
        """Return the interpolation as a matrix [shape=(H · W, number of nodes)], with empty rows outside the region."""
        from scipy.sparse import csr_array

        count, width = self.region.size, self.region.shape[1]
        nodes = np.concatenate(self.nodes)
        basis = csr_array((np.ones(len(nodes)), (nodes, np.arange(len(nodes)))), shape=(count, len(nodes)))
        between = np.setdiff1d(np.flatnonzero(self.region), nodes)
        spacing = 1 << _find_levels(self.region.shape, len(self.nodes) - 1).ravel()[between]
        odd_row, odd_column = (between // width // spacing) % 2, (between % width // spacing) % 2
        weights = csr_array((count, count))
        for row, row_weight in TAPS:
            for column, column_weight in TAPS:  # without an odd row or column the four taps fall on one pixel
                weight = np.where(odd_row, row_weight, 1 / 4) * np.where(odd_column, column_weight, 1 / 4)
                neighbour = between + (row * odd_row * width + column * odd_column) * spacing
                weights += csr_array((weight, (between, neighbour)), shape=(count, count))
        matrix = basis
        for _ in range(len(self.nodes) - 1):  # a pixel depends on wider grids, and these on still wider ones
            matrix = basis + weights @ matrix
        return matrix


class GridFiller:
    """Interpolates from the nodes to all pixels of some pictures, without new memory for each."""

    def __init__(self, grids: NestedGrids, count: int, colours: int) -> None:
        """Take memory for ``count`` pictures at once, each of the given number of colours."""
        self._grids, width = grids, grids.region.shape[1]
        self._positions = [  # of the nodes among the pixels of their grid
            (pixels // width >> level) * grids.shape(level)[1] + (pixels % width >> level)
            for level, pixels in enumerate(grids.nodes)
        ]
        shapes = [grids.shape(level) for level in range(len(grids.nodes))]
        self._filled = [np.zeros((count, *shape, colours), np.float32) for shape in shapes]
        halves = [(coarse[0], fine[1]) for fine, coarse in pairwise(shapes)]
        self._half = [np.zeros((count, *shape, colours), np.float32) for shape in halves]
        self._scratch = np.empty((2, max((count * prod(shape) * colours for shape in halves), default=0)), np.float32)

    def fill(self, values: Floats) -> Floats:
        """Return the function at all pixels [shape=(t, H, W, C)], until the next call, from nodes [shape=(t, K, C)]."""
        count, stop = values.shape[:2]
        for level in reversed(range(len(self._filled))):
            fine = self._filled[level][:count]
            if level + 1 < len(self._filled):  # from every second row and column; near the sides it is not valid
                coarse, half = self._filled[level + 1][:count], self._half[level][:count]
                half[:, :, ::2] = coarse
                self._fill_between(coarse, half[:, :, 1::2], 2)
                fine[:, ::2] = half
                self._fill_between(half, fine[:, 1::2], 1)
            start = stop - len(self._grids.nodes[level])
            fine.reshape(count, -1, fine.shape[-1])[:, self._positions[level]] = values[:, start:stop]
            stop = start
        return self._filled[0][:count]

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
        np.add(_cut_part(values, axis, 0, count), _cut_part(values, axis, 1, count + 1), out=pairs)
        np.add(_cut_part(pairs, axis, 0, count - 2), _cut_part(pairs, axis, 2, count), out=outer)
        outer *= np.float32(-1 / 16)  # both together have the weights of TAPS
        pairs *= np.float32(10 / 16)
        np.add(outer, _cut_part(pairs, axis, 1, count - 1), out=_cut_part(out, axis, 1, count - 1))


def nest_grids(region: NDArray[np.bool_]) -> NestedGrids:
    """Return the nodes of a region: bool array [shape=(H, W)] that is False on its outermost pixels."""
    from scipy.ndimage import distance_transform_cdt

    clearance = distance_transform_cdt(region, "chessboard")
    widest = max((level for level in range(1, LEVELS + 1) if clearance.max() > CLEARANCE << (level - 1)), default=0)
    levels = _find_levels(region.shape, widest)
    node = region & ((levels == widest) | (clearance <= CLEARANCE << levels))
    return NestedGrids(region, tuple(np.flatnonzero(node & (levels == level)) for level in range(widest + 1)))


def _find_levels(shape: tuple[int, ...], widest: int) -> Index:
    """Return the widest grid that each pixel lies on, up to grid ``widest`` [shape=(H, W)]."""
    levels = np.zeros(shape, np.intp)
    for level in range(1, widest + 1):
        levels[:: 1 << level, :: 1 << level] = level
    return levels


def _cut_part(values: Floats, axis: int, start: int, stop: int) -> Floats:
    return values[(slice(None),) * axis + (slice(start, stop),)]


Mask = NDArray[np.bool_]
Pictures = NDArray[np.uint8] | NDArray[np.floating[Any]]

COLOURS = 3
LARGEST_EDGE = 2048  # largest number of pixels on the edge of a region; the matrix grows with its square, to 100 MB
CHUNK = 1 << 17  # about the number of pixels that are interpolated at once: what fits into the cache of a processor
BATCH = 64


@dataclass(frozen=True, eq=False)
class CloningSystem:
    """The Poisson equation of one region, solved for any pictures by one matrix product (``build_cloning_system``).

    mask     : bool array [shape=(h, w)], the pixels that cloning replaces
    box      : the rows and the columns of the region and its edge
    edge     : pixels of the box outside the region with a neighbour in it [shape=(B,)], counted row by row
    outside  : pixels of the box outside the region [shape=(O,)], the edge among them
    grids    : nodes at which the equation is solved, in the box
    response : float32 array [shape=(K, B)], the membrane at every node for a difference of 1 at each pixel of the edge
    """

    mask: Mask
    box: tuple[slice, slice]
    edge: Index
    outside: Index
    grids: NestedGrids
    response: NDArray[np.float32]

    def clone(self, source: Pictures, background: Pictures, largest_difference: float = np.inf) -> NDArray[np.uint8]:
        """Return the background with the region cloned from the source: uint8 array [shape=(T, h, w, 3)].

        source, background : pictures [shape=(T, h, w, 3)], grey levels (0 to 255), uint8 or float
        largest_difference : differences on the edge of the region are cut off at this, grey levels: those of light are
                             smaller, and where pictures show other things there (skin and a collar), the membrane would
                             carry the difference far into the region
        Inside the region the gradient of the result is that of the source; outside it the result is the background.
        At the end values are rounded and cut to 0 to 255.
        Raises InputError: pictures of another shape, number or type than required, or values that are not finite.
        Source: Pérez et al. 2003, Eq. 7 (the technique of Xie & Liu 2007, §6), with the gradient of the source alone.
        Deviation: the membrane is solved at the nodes of nested grids and interpolated (error: docs/results/video.md).
        Cost: a product of K · B · 3 multiplications a picture, and about ten passes over the box.
        """
        self._check(source, background)
        in_bytes = background.dtype == np.uint8
        result = background.astype(np.uint8) if in_bytes else round_levels(background.astype(np.float32))
        new, old = (pictures[(slice(None), *self.box)] for pictures in (source, result))
        for frames, membrane in self._solve_membranes(source, background, largest_difference):
            np.add(membrane, new[frames], out=membrane, casting="same_kind")
            cloned = round_levels(membrane)
            flat = cloned.reshape(len(cloned), -1, COLOURS)
            flat[:, self.outside] = old[frames].reshape(flat.shape)[:, self.outside]
            old[frames] = cloned
        return result

    def _solve_membranes(
        self, source: Pictures, background: Pictures, limit: float = np.inf
    ) -> Iterator[tuple[slice, NDArray[np.float32]]]:
        """Yield slices of the pictures and their membranes in the box [shape=(t, H, W, 3)], valid in the region."""
        height, width = self.grids.region.shape
        step = max(1, min(CHUNK // (height * width), len(source)))
        filler = GridFiller(self.grids, step, COLOURS)
        for first in range(0, len(source), BATCH):
            values = self._solve_nodes(source[first : first + BATCH], background[first : first + BATCH], limit)
            for start in range(0, len(values), step):
                part = values[start : start + step]
                yield slice(first + start, first + start + len(part)), filler.fill(part)

    @limit_threads()
    def _solve_nodes(self, source: Pictures, background: Pictures, limit: float) -> NDArray[np.float32]:
        """Return the membranes of some pictures at the nodes [shape=(t, K, 3)]."""
        rows, columns = self.edge // self.grids.region.shape[1], self.edge % self.grids.region.shape[1]
        at = slice(None), rows + self.box[0].start, columns + self.box[1].start
        difference = np.subtract(background[at], source[at], dtype=np.float32).swapaxes(0, 1)
        if np.isfinite(limit):
            difference = np.clip(difference, -limit, limit)
        product = self.response @ difference.reshape(len(self.edge), -1)
        return np.ascontiguousarray(product.reshape(len(product), -1, COLOURS).swapaxes(0, 1))

    def _check(self, source: Pictures, background: Pictures) -> None:
        for name, pictures in (("source", source), ("background", background)):
            if pictures.ndim != 4 or pictures.shape[1:] != (*self.mask.shape, COLOURS):
                raise InputError(
                    f"{name} of shape {pictures.shape}, required (T, {self.mask.shape[0]}, {self.mask.shape[1]}, "
                    f"{COLOURS}); make a system from a mask of the pictures' size"
                )
            if pictures.dtype != np.uint8 and pictures.dtype.kind != "f":
                raise InputError(f"{name} of type {pictures.dtype}, required uint8 or float, grey levels from 0 to 255")
            if pictures.dtype != np.uint8 and not np.isfinite(pictures).all():
                raise InputError(f"{name} with values that are not finite; required: grey levels from 0 to 255")
        if len(source) != len(background):
            raise InputError(f"{len(source)} source and {len(background)} background pictures; give as many of each")


def build_cloning_system(mask: Mask) -> CloningSystem:
    """Return the equation of a region, solved once for all pictures.

    mask : bool array [shape=(h, w)], True in the region; any shape, in several parts, with holes
    The outermost pixels of the picture never belong to the region: they have no neighbours that could hold it.
    Raises InputError: not such an array, no pixel in the region, or an edge of more than ``LARGEST_EDGE`` pixels.
    Cost: a sparse factorisation, and one solution for each pixel of the edge (seconds: docs/results/video.md).
    """
    if mask.ndim != 2 or mask.dtype != np.bool_:
        raise InputError(f"mask of shape {mask.shape} and type {mask.dtype}, required (h, w) and bool")
    inner = np.zeros_like(mask)
    inner[1:-1, 1:-1] = mask[1:-1, 1:-1]
    if not inner.any():
        raise InputError(
            f"mask of {mask.shape[0]} × {mask.shape[1]} pixels, {int(mask.sum())} of them True, none of these inside; "
            "required: a True pixel that is not an outermost pixel of the picture"
        )
    rows, columns = (np.flatnonzero(inner.any(axis=axis)) for axis in (1, 0))
    box = slice(int(rows[0]) - 1, int(rows[-1]) + 2), slice(int(columns[0]) - 1, int(columns[-1]) + 2)
    region = inner[box]
    neighbours = np.zeros_like(region)
    for axis in (0, 1):
        neighbours |= np.roll(region, 1, axis) | np.roll(region, -1, axis)
    edge = np.flatnonzero(neighbours & ~region)
    if len(edge) > LARGEST_EDGE:
        raise InputError(
            f"region with {len(edge)} pixels on its edge, at most {LARGEST_EDGE} are possible; "
            "use a smaller or smoother mask"
        )
    grids = nest_grids(region)
    from scipy.sparse import eye_array
    from scipy.sparse.linalg import splu

    count, width = grids.region.size, grids.region.shape[1]
    laplacian = sum(
        (-eye_array(count, k=offset, format="csr") for offset in (-width, -1, 1, width)),
        4 * eye_array(count, format="csr"),
    )
    interpolation = grids.build_matrix()
    tested = interpolation.T @ laplacian
    factors = splu((tested @ interpolation).tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    right = -tested.tocsc()[:, edge]
    response = np.empty(right.shape, np.float32)
    for start in range(0, len(edge), BATCH):
        response[:, start : start + BATCH] = factors.solve(right[:, start : start + BATCH].toarray())
    return CloningSystem(inner, box, edge, np.flatnonzero(~region), grids, response)


def round_levels(pictures: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return pictures as grey levels, rounded and cut to 0 to 255 [same shape]; the pictures are changed."""
    np.rint(pictures, out=pictures)
    return np.clip(pictures, 0, 255, out=pictures).astype(np.uint8)
