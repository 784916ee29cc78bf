"""Curves stored in few bytes: blocks of time, transformed and quantised, of which any frame can be read alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.storage.schema import POSITIVE, Arrays, ArraySpec, check_index, checked_arrays

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

DEAD_ZONE = 0.1
"""Quantisation rounds towards 0 up to this share of a step beyond the half: zeros cost least."""
LARGEST_LEVEL = 2**31 - 1
"""No quantised coefficient is larger."""
MOST_FRAMES = 10**9
"""No store has more frames."""
LONGEST_BLOCK, WIDEST_KNOT_SPACING = 256, 100.0
"""No block is longer, and no knots are further apart, so that a damaged file cannot fill the memory."""
FLATNESS = 3e-4
"""Weight of the second differences of spline coefficients beside the fit: they decide only where no frame does; as
much less again the first ones, which decide where a range is a single frame."""


@dataclass(frozen=True, eq=False)
class BlockLayout:
    """How frames are divided into blocks.

    frames  : number of recorded frames, T
    kept    : first frame and the one after the last of each of R ranges that are stored, in order [shape=(R, 2)]
    spacing : frames between the knots of a cubic spline whose coefficients are stored; 1: the frames themselves are
    length  : stored values in a block, L. Each range begins a block of its own, and its last value fills its last one.
    """

    frames: int
    kept: Indices
    spacing: float
    length: int

    @property
    def values(self) -> Indices:
        """The number of stored values of each range, without those that fill its last block [shape=(R,)]."""
        lengths = self.kept[:, 1] - self.kept[:, 0]
        if self.is_plain:
            return lengths
        return np.floor((lengths - 1) / self.spacing).astype(np.intp) + 4

    @property
    def is_plain(self) -> bool:
        """Whether the frames themselves are stored, and no spline."""
        return self.spacing <= 1

    @property
    def first_blocks(self) -> Indices:
        """The first block of each range, and at the end the number of all blocks [shape=(R + 1,)]."""
        return np.concatenate([[0], np.cumsum(-(-self.values // self.length))]).astype(np.intp)

    def forward(self, curves: NDArray[np.floating[Any]]) -> NDArray[np.float32]:
        """Return the coefficients of the blocks of some curves [shape=(B, L, K)].

        curves : all recorded frames [shape=(T, K)]; those outside the ranges are not read
        Each block is transformed by a cosine transform over time, whose squares sum up to those of the block.
        """
        from scipy.fft import dct

        starts, width = self.first_blocks, curves.shape[1]
        flat = np.empty((starts[-1] * self.length, width), np.float32)
        for (first, stop), count, start, end in zip(self.kept, self.values, starts[:-1], starts[1:], strict=True):
            part = flat[start * self.length : end * self.length]
            part[:count] = curves[first:stop] if self.is_plain else _spline(curves[first:stop], self.spacing, count)
            part[count:] = part[count - 1]
        blocks = flat.reshape(starts[-1], self.length, width)
        if not blocks.size:
            return blocks
        coefficients: NDArray[np.float32] = dct(blocks, axis=1, norm="ortho", overwrite_x=True)
        coefficients *= self.gains.astype(np.float32)[:, None]
        return coefficients

    @property
    def gains(self) -> Array:
        """The weight of each frequency of a block [shape=(L,)].

        A spline damps the high frequencies of its coefficients; what is quantised is as large as in the curve itself.
        """
        if self.is_plain:
            return np.ones(self.length)
        return (2 + np.cos(np.pi * np.arange(self.length) / self.length)) / 3

    def places(self, frames: Indices) -> tuple[Indices, Array]:
        """Return which stored values, counted over all blocks, each frame is a weighted sum of, and the weights.

        Returns two arrays [each shape=(N, 4), or (N, 1) without a spline].
        Raises InputError: a frame that was not recorded, or that was left out.
        """
        ranges = self._range_of(frames)
        offsets = frames - self.kept[ranges, 0]
        firsts = self.first_blocks[ranges] * self.length
        if self.is_plain:
            return (firsts + offsets)[:, None], np.ones((len(frames), 1))
        knots, weights = _taps(offsets / self.spacing)
        return firsts[:, None] + knots, weights

    def numbers(self, frames: slice | Sequence[int] | NDArray[np.integer[Any]]) -> Indices:
        """Return the numbers of the frames of a slice or of a row of numbers [shape=(N,)].

        Raises InputError: not whole numbers, or not in a row.
        """
        if isinstance(frames, slice):
            return np.arange(*frames.indices(self.frames), dtype=np.intp)
        numbers = np.asarray(frames)
        if numbers.ndim != 1 or (numbers.size and numbers.dtype.kind not in "iu"):
            raise InputError(
                f"frames of shape {numbers.shape} and type {numbers.dtype}, required a slice or a row of whole numbers"
            )
        return numbers.astype(np.intp)

    def _range_of(self, frames: Indices) -> Indices:
        """Return the range of each frame [shape=(N,)]. Raises as ``places``."""
        if len(frames) and not 0 <= frames.min() <= frames.max() < self.frames:
            raise InputError(
                f"frames {frames.min()} to {frames.max()} asked for, required 0 to {self.frames - 1}; ask for frames "
                "that were recorded"
            )
        ranges: Indices = np.searchsorted(self.kept[:, 0], frames, side="right") - 1
        left_out = ranges < 0
        left_out[~left_out] = frames[~left_out] >= self.kept[ranges[~left_out], 1]
        if left_out.any():
            raise InputError(
                f"frame {frames[left_out][0]} was left out when this was stored; ask for frames of the ranges in kept"
            )
        return ranges


@dataclass(frozen=True, eq=False)
class BlockCode:
    """Curves as quantised coefficients of blocks.

    layout : how frames are divided into blocks
    count  : number of curves, K
    step   : difference of the values of two neighbouring levels
    used   : frequency and curve of every coefficient that is not 0 in all blocks [shape=(C, 2)]: first those of ``low``
    low    : levels of those that are never above 127 [shape=(C', B)]
    high   : levels of the others [shape=(C - C', B)]
    """

    layout: BlockLayout
    count: int
    step: float
    used: Indices
    low: NDArray[np.int8]
    high: NDArray[np.int32]

    def __len__(self) -> int:
        return self.layout.frames

    def rows(self, frames: Indices) -> Array:
        """Return the curves in some frames [shape=(N, K)]; only the blocks that these frames lie in are decoded.

        frames : their numbers, in any order, also more than once [shape=(N,)]
        Raises InputError: a frame that was not recorded, or that was left out.
        Cost: O(B'·L·(log L + K)) for B' blocks that are touched, and O(N·K).
        """
        from scipy.sparse import csr_array

        places, weights = self.layout.places(frames)
        blocks, position = np.unique(places // self.layout.length, return_inverse=True)
        values = self._blocks(blocks).reshape(len(blocks) * self.layout.length, self.count)
        columns = position.reshape(places.shape) * self.layout.length + places % self.layout.length
        if self.layout.is_plain:
            return values[columns[:, 0]]
        starts = np.arange(len(frames) + 1) * weights.shape[1]
        mixing = csr_array((weights.ravel(), columns.ravel(), starts), shape=(len(frames), len(values)))
        return mixing @ values

    def _blocks(self, blocks: Indices) -> Array:
        """Return the stored values of some blocks [shape=(B', L, K)]."""
        from scipy.fft import idct

        coefficients = np.zeros((len(blocks), self.layout.length, self.count))
        if not coefficients.size:
            return coefficients
        flat = coefficients.reshape(len(blocks), self.layout.length * self.count)
        place = self.used[:, 0] * self.count + self.used[:, 1]
        flat[:, place[: len(self.low)]] = self.low[:, blocks].T
        flat[:, place[len(self.low) :]] = self.high[:, blocks].T
        coefficients *= (self.step / self.layout.gains)[:, None]
        return idct(coefficients, axis=1, norm="ortho", overwrite_x=True)


def quantise_blocks(layout: BlockLayout, coefficients: NDArray[np.float32], step: float) -> BlockCode:
    """Return the code of coefficients of ``BlockLayout.forward`` [shape=(B, L, K)], for one step.

    One step for all coefficients of an orthonormal transform is the best for its mean square error (Gersho & Gray
    1992, §8.3: "reverse water-filling"); those below about half a step vanish.
    Raises InputError: a level above ``LARGEST_LEVEL``.
    """
    levels = coefficients / np.float32(step)
    np.copysign(np.floor(np.abs(levels) + (0.5 - DEAD_ZONE)), levels, out=levels)
    most = np.abs(levels).max(axis=0, initial=0)
    if most.size and not most.max() <= LARGEST_LEVEL:
        raise InputError(
            f"a tolerance of {most.max():.3g} steps below the largest value, required at most {LARGEST_LEVEL}; allow "
            "a larger error"
        )
    frequencies, curves = np.nonzero(most)
    is_high = most[frequencies, curves] > np.iinfo(np.int8).max
    size = np.abs(levels).sum(axis=0, dtype=np.float64)[frequencies, curves]
    order = np.lexsort((size, is_high))  # levels that are alike lie together: archives compress them by a tenth more
    used = np.stack([frequencies, curves], axis=1)[order]
    low = used[: len(used) - int(is_high.sum())]
    high = used[len(low) :]
    return BlockCode(
        layout,
        coefficients.shape[2],
        step,
        used,
        levels[:, low[:, 0], low[:, 1]].T.astype(np.int8),
        levels[:, high[:, 0], high[:, 1]].T.astype(np.int32),
    )


def checked_ranges(kept: Sequence[tuple[int, int]] | NDArray[np.integer[Any]] | None, frames: int) -> Indices:
    """Return ranges of frames [shape=(R, 2)]; None: all frames.

    Raises InputError: ranges that are empty, overlap, are not in order, or go beyond the frames.
    """
    if kept is None:
        return np.array([[0, frames]] if frames else [], np.intp).reshape(-1, 2)
    ranges = np.asarray(kept)
    if ranges.size and (ranges.ndim != 2 or ranges.shape[1] != 2 or ranges.dtype.kind not in "iu"):
        raise InputError(
            f"ranges of shape {ranges.shape} and type {ranges.dtype}, required (R, 2), whole numbers: the first frame "
            "of each and the one after its last"
        )
    ranges = ranges.reshape(-1, 2).astype(np.intp)
    edges = ranges.ravel()
    if len(edges) and (
        edges[0] < 0 or edges[-1] > frames or (np.diff(edges) < 0).any() or (ranges[:, 0] >= ranges[:, 1]).any()
    ):
        raise InputError(
            f"ranges of frames that are empty, overlap or leave 0 to {frames}; give them in order of time, each with "
            "its first frame and the one after its last"
        )
    return ranges


def block_code_arrays(code: BlockCode) -> dict[str, NDArray[Any]]:
    """Serialise a code."""
    layout = code.layout
    high = code.high
    if not high.size or np.abs(high).max() <= np.iinfo(np.int16).max:
        high = high.astype(np.int16)
    return {
        "frames": np.array(layout.frames),
        "kept": layout.kept,
        "spacing": np.array(layout.spacing),
        "length": np.array(layout.length),
        "step": np.array(code.step),
        "used": code.used.astype(np.int32),
        "low": code.low,
        "high": high,
    }


def block_code_from_arrays(arrays: Arrays, count: int) -> BlockCode:
    """Deserialise a code of some number of curves; other arrays are ignored.

    Raises KeyError, ValueError: an array is missing, or has a wrong shape, type or range, or they do not fit together.
    """
    stored = checked_arrays(arrays, BLOCK_CODE)
    used, low, high = stored["used"], stored["low"], stored["high"]
    layout = BlockLayout(
        int(stored["frames"]),
        _ordered(stored["kept"], int(stored["frames"])),
        float(stored["spacing"]),
        int(stored["length"]),
    )
    check_index("used (frequencies)", used[:, 0], layout.length)
    check_index("used (curves)", used[:, 1], count)
    if len(np.unique(used, axis=0)) < len(used) or len(used) != len(low) + len(high):
        raise ValueError(f"{len(used)} places, required {len(low) + len(high)} different ones")
    blocks = int(layout.first_blocks[-1])
    if low.shape[1] != blocks or high.shape[1] != blocks:
        raise ValueError(f"levels of {low.shape[1]} and {high.shape[1]} blocks, required {blocks}")
    return BlockCode(layout, count, float(stored["step"]), used, low, high)


BLOCK_CODE = {
    "frames": ArraySpec(np.intp, "", 0, MOST_FRAMES),
    "kept": ArraySpec(np.intp, "r 2", 0, MOST_FRAMES),
    "spacing": ArraySpec(np.float64, "", 1, WIDEST_KNOT_SPACING),
    "length": ArraySpec(np.intp, "", 1, LONGEST_BLOCK),
    "step": ArraySpec(np.float64, "", POSITIVE),
    "used": ArraySpec(np.intp, "c 2", 0, MOST_FRAMES),
    "low": ArraySpec(np.int8, "l b", -127, 127),
    "high": ArraySpec(np.int32, "h b", -LARGEST_LEVEL, LARGEST_LEVEL),
}
"""The arrays of a code of C = l + h coefficients in b blocks of r ranges."""


def _ordered(kept: Indices, frames: int) -> Indices:
    """Return ranges. Raises ValueError: they cannot be those of so many frames."""
    try:
        return checked_ranges(kept, frames)
    except InputError as error:
        raise ValueError(f"kept: {error}") from error


def _taps(times: Array) -> tuple[Indices, Array]:
    """Return the four coefficients of a cubic spline that each time depends on, and their weights.

    times : in knots since the first [shape=(N,)]
    Returns indices and weights [each shape=(N, 4)]. Source: de Boor 1978, uniform cubic B-splines.
    """
    first = np.floor(times).astype(np.intp)
    u = times - first
    weights = np.stack([(1 - u) ** 3, 3 * u**3 - 6 * u**2 + 4, -3 * u**3 + 3 * u**2 + 3 * u + 1, u**3], axis=1) / 6
    return first[:, None] + np.arange(4), weights


def _spline(curves: NDArray[np.floating[Any]], spacing: float, count: int) -> Array:
    """Return the coefficients [shape=(count, K)] of the cubic spline closest to some curves [shape=(n, K)]."""
    from scipy.linalg import solveh_banded
    from scipy.sparse import csr_array, diags

    knots, weights = _taps(np.arange(len(curves)) / spacing)
    starts = np.arange(len(curves) + 1) * weights.shape[1]
    spline = csr_array((weights.ravel(), knots.ravel(), starts), shape=(len(curves), count))
    slope = diags([-1.0, 1.0], [0, 1], shape=(count - 1, count))
    bend = diags([1.0, -2.0, 1.0], [0, 1, 2], shape=(count - 2, count))
    products = spline.T @ spline + FLATNESS * (bend.T @ bend + FLATNESS * slope.T @ slope)
    banded = np.zeros((4, count))
    for n in range(4):
        banded[n, : count - n] = products.diagonal(-n)
    return solveh_banded(banded, spline.T @ curves.astype(np.float64), lower=True)
