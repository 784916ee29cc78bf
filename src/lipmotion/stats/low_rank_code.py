"""Tables of numbers over time stored in few bytes: principal components whose curves are coded in blocks."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.stats.block_code import (
    BLOCK_CODE,
    BlockCode,
    BlockLayout,
    block_code_arrays,
    block_code_from_arrays,
    quantise_blocks,
)
from lipmotion.stats.pca import EXACT, evenly_spaced, fit_pca
from lipmotion.storage.schema import POSITIVE, Arrays, ArraySpec, checked_arrays

Array = NDArray[np.float64]
Values = NDArray[np.floating[Any]] | NDArray[np.uint8]
Excess = Callable[[Array, Array], Array]
"""Of restored and true rows [each shape=(N, P)] the error that counts, as a multiple of what is allowed: at most 1."""

LENGTHS = (16, 24, 32, 48, 64)
"""Lengths of blocks that are tried."""
FIRST_COMPONENTS = 64
"""Components of a large table at first; twice as many where they do not suffice."""
SAMPLE = 2048
"""Frames by which the step is chosen; afterwards all frames are restored and verified."""
ROUNDS = 10
"""Steps that are tried on the sample."""
NEAR, NEARLY = 0.97, 0.985
"""A step is good enough where the error is at least the first part of what is allowed; it aims at the second."""
SMALLER = 0.97
"""Factor of the step where the promise is not kept on all frames."""
MOST_STEPS = 200
"""Smaller steps that are tried before the tolerance is refused."""
PERCENTILE = 99
"""The promise holds for so many per cent of the frames."""
BASIS_SHARE = 0.25
"""Rounding of the basis changes values by about this share of the step."""
FINEST = 1 / 32000
"""Smallest step of the basis, so that levels are 16-bit numbers."""
MOST_ROWS = 20_000
"""Frames that the components are computed of; of tables with more than ``EXACT`` columns, ``EXACT``."""
CHUNK = 1 << 24
"""Numbers that are restored at a time."""


@dataclass(frozen=True, eq=False)
class LowRankCode:
    """A table of numbers over time.

    mean  : of each column [shape=(P,)]
    scale : unit of each column's error [shape=(P,)]
    basis : levels of the components [shape=(K, P)]
    steps : of each component's levels [shape=(K,)]
    code  : the curves of the components
    """

    mean: Array
    scale: Array
    basis: NDArray[np.int16]
    steps: Array
    code: BlockCode

    def __len__(self) -> int:
        return len(self.code)

    def rows(self, frames: NDArray[np.intp]) -> Array:
        """Return the values in some frames [shape=(N, P)]. Raises as ``BlockCode.rows``."""
        restored: Array = self.code.rows(frames) @ self.directions
        restored += self.mean
        return restored

    @property
    def directions(self) -> Array:
        """The components in the units of the values [shape=(K, P)]."""
        return self.basis * self.steps[:, None] * self.scale

    @property
    def kept_frames(self) -> NDArray[np.intp]:
        """The numbers of all frames that are stored."""
        ranges = [np.arange(first, stop) for first, stop in self.code.layout.kept]
        return np.concatenate(ranges) if ranges else np.zeros(0, np.intp)

    @property
    def nbytes(self) -> int:
        """The bytes that its arrays take in memory."""
        return sum(array.nbytes for array in low_rank_arrays(self).values())


def compress_table(
    values: Values,
    kept: NDArray[np.intp],
    *,
    scale: Array,
    spacings: Sequence[float],
    excess: Excess,
    lengths: Sequence[int] = LENGTHS,
) -> tuple[LowRankCode, float]:
    """Return the smallest code of a table that is found whose errors are allowed, and its error.

    values   : [shape=(T, P)]
    kept     : of ``checked_ranges``; other frames are left out
    scale    : unit of each column's error [shape=(P,), > 0]
    spacings : frames between knots of the spline that are tried; 1 is no spline
    excess   : the errors of some rows [shape=(N, G)]; of each of the G the 99th percentile of all rows must be at
               most 1. The largest of them is returned.
    Raises InputError: no step of quantisation is small enough.
    """
    frames = np.concatenate([np.arange(first, stop) for first, stop in kept]) if len(kept) else np.zeros(0, np.intp)
    if not len(frames):
        return _empty(BlockLayout(len(values), kept, 1.0, lengths[0]), scale), 0.0
    count = values.shape[1] if values.shape[1] <= EXACT else FIRST_COMPONENTS
    while True:
        table = _Table(values, kept, frames, scale, excess, *_components(values, kept, frames, scale, count))
        found = [each for spacing in spacings for length in lengths if (each := table.candidate(spacing, length))]
        most = len(table.basis)
        enough = most < count or count >= values.shape[1]
        if found:
            code = min(found, key=lambda each: each[0])[1]
            if enough or code.code.used[:, 1].max(initial=0) < most - 1:
                return table.verified(code)
        elif enough:
            raise InputError(
                f"an error of {float(scale.min()):g} at most cannot be kept for values of up to "
                f"{float(np.abs(values[frames[:SAMPLE]]).max()):g}; allow a larger error"
            )
        count *= 2


@dataclass(frozen=True, eq=False)
class _Table:
    """What is compressed: see ``compress_table``.

    frames : numbers of the kept frames
    mean, basis, curves : of the components; ``curves`` in all frames [shape=(T, K)]
    """

    values: Values
    kept: NDArray[np.intp]
    frames: NDArray[np.intp]
    scale: Array
    excess: Excess
    mean: Array
    basis: Array
    curves: NDArray[np.float32]

    def candidate(self, spacing: float, length: int) -> tuple[int, LowRankCode] | None:
        """Return size and code for one layout with the largest step that a sample allows; None: no step does."""
        layout = BlockLayout(len(self.values), self.kept, spacing, length)
        coefficients = layout.forward(self.curves)
        some = self.frames[evenly_spaced(SAMPLE, len(self.frames))]
        best, step = None, 2.0
        for _ in range(ROUNDS):
            code = self.coded(layout, coefficients, step)
            error = self.error(code, some)
            if error <= 1:
                best = code
            if NEAR <= error <= 1 or (error <= 1 and not len(code.code.used)):
                break
            step *= float(np.clip(NEARLY / max(error, 1e-9), 0.1, 4))
        return None if best is None else (packed_size(best), best)

    def coded(self, layout: BlockLayout, coefficients: NDArray[np.float32], step: float) -> LowRankCode:
        """Return the code for one step."""
        code = quantise_blocks(layout, coefficients, step)
        used, numbers = np.unique(code.used[:, 1], return_inverse=True)
        code = replace(code, count=len(used), used=np.stack([code.used[:, 0], numbers.ravel()], axis=1))
        size = np.sqrt(np.square(self.curves[:, used]).mean(axis=0, dtype=np.float64))
        steps = np.clip(BASIS_SHARE * step / np.sqrt(max(len(used), 1)) / np.maximum(size, step), FINEST, 0.5)
        levels = np.rint(self.basis[used] / steps[:, None]).astype(np.int16)
        return LowRankCode(self.mean, self.scale, levels, steps, code)

    def error(self, code: LowRankCode, frames: NDArray[np.intp]) -> float:
        """Return the largest of the 99th percentiles of the errors in some frames."""
        chunk = CHUNK // self.values.shape[1] + 1
        parts = (frames[start : start + chunk] for start in range(0, len(frames), chunk))
        errors = [self.excess(code.rows(part), self.values[part]).astype(np.float32) for part in parts]
        return float(np.percentile(np.concatenate(errors), PERCENTILE, axis=0).max())

    def verified(self, code: LowRankCode) -> tuple[LowRankCode, float]:
        """Return a code whose errors are allowed in all frames, and its error."""
        layout, step = code.code.layout, code.code.step
        coefficients = layout.forward(self.curves)
        for _ in range(MOST_STEPS):
            error = self.error(code, self.frames)
            if error <= 1:
                return code, error
            step *= SMALLER
            code = self.coded(layout, coefficients, step)
        raise InputError(f"an error of {error:g} times what is allowed; allow a larger one")


def _components(
    values: Values, kept: NDArray[np.intp], frames: NDArray[np.intp], scale: Array, count: int
) -> tuple[Array, Array, NDArray[np.float32]]:
    """Return the mean, the first components in units of the error, and their curves, as in ``_Table``."""
    width = values.shape[1]
    some = frames[evenly_spaced(EXACT if width > EXACT else MOST_ROWS, len(frames))]
    space = fit_pca(values[some] / scale, count)
    curves = np.zeros((len(values), len(space.basis)), np.float32)
    for first, stop in kept:
        for start in range(first, stop, CHUNK // width + 1):
            rows = slice(start, min(start + CHUNK // width + 1, stop))
            curves[rows] = space.project(values[rows] / scale)
    return space.mean * scale, space.basis, curves


def packed_size(code: LowRankCode) -> int:
    """Return how many bytes the arrays of a code take in an archive, about."""
    return sum(len(zlib.compress(np.ascontiguousarray(array).tobytes(), 6)) for array in low_rank_arrays(code).values())


def low_rank_arrays(code: LowRankCode) -> dict[str, NDArray[Any]]:
    """Serialise a code."""
    own = {"mean": code.mean, "scale": code.scale, "basis": code.basis, "steps": code.steps}
    if not code.basis.size or np.abs(code.basis).max() <= np.iinfo(np.int8).max:
        own["basis"] = code.basis.astype(np.int8)
    return own | block_code_arrays(code.code)


def low_rank_from_arrays(arrays: Arrays) -> LowRankCode:
    """Deserialise a code; other arrays are ignored. Raises as ``block_code_from_arrays``."""
    stored = checked_arrays(arrays, LOW_RANK)
    return LowRankCode(
        stored["mean"], stored["scale"], stored["basis"], stored["steps"],
        block_code_from_arrays(arrays, stored.sizes["k"]),
    )  # fmt: skip


LOW_RANK = {
    "mean": ArraySpec(np.float64, "P"),
    "scale": ArraySpec(np.float64, "P", POSITIVE),
    "basis": ArraySpec(np.int16, "k P", -32767, 32767),
    "steps": ArraySpec(np.float64, "k", POSITIVE, 1),
}
"""The arrays of a code of P columns and k components, beside those of ``BLOCK_CODE``."""
LOW_RANK_ARRAYS = (*LOW_RANK, *BLOCK_CODE)
"""Names of the arrays of ``low_rank_arrays``."""


def _empty(layout: BlockLayout, scale: Array) -> LowRankCode:
    """Return the code of no frame at all."""
    nothing = quantise_blocks(layout, np.zeros((0, layout.length, 0), np.float32), 1.0)
    return LowRankCode(np.zeros(len(scale)), scale, np.zeros((0, len(scale)), np.int16), np.zeros(0), nothing)
