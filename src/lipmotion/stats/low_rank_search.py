"""The smallest low-rank code of a table whose errors are small enough."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.stats.block_code import BlockLayout, quantise_blocks
from lipmotion.stats.low_rank_code import LowRankCode, packed_size
from lipmotion.stats.pca import EXACT_ROWS, evenly_spaced, fit_pca

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Values = NDArray[np.floating[Any]] | NDArray[np.integer[Any]]
Excess = Callable[[Array, Values], Array]
"""Restored and true rows [each shape=(N, P)] to the errors that count [shape=(N, G)], as multiples of what is
allowed."""

LENGTHS = (16, 24, 40, 64)
"""Lengths of blocks that are tried."""
PERCENTILE = 99
"""The promise holds for so many per cent of the frames."""
FIRST_COMPONENTS = 64
"""Components of a large table at first; twice as many where they do not suffice."""
MOST_ROWS = 20_000
"""Frames that the components are computed of; of tables with more than ``EXACT_ROWS`` columns, ``EXACT_ROWS``."""
SAMPLE_FRAMES, MOST_SAMPLED_NUMBERS = 2048, 1 << 25
"""Frames by which a step is chosen, at last as many as hold the second count of numbers; all are verified."""
PART_FRAMES, PIECE_FRAMES = 8192, 512
"""Layout and weights are chosen on pieces of at most so many frames, as many together as the first number says."""
FIRST_STEP = 2.0
ROUNDS, MOST_ROUNDS = 8, 24
"""Steps that are tried on the sample; more where none of the first will do."""
LEAST_STEP = 1e-3
"""No smaller step is tried, in units of the tolerance: where it will not do, the errors come from elsewhere."""
LEAST_ERROR_SHARE, AIMED_ERROR_SHARE = 0.975, 0.99
"""A step is good enough where the error is at least the first part of what is allowed; it aims at the second."""
STEP_FACTOR, MOST_STEPS = 0.97, 100
"""Factor of the step where the promise is not kept on all frames, and how often it is tried."""
BASIS_SHARE = 1.0
"""Rounding of an entry of the basis changes all values together by so many times as much as rounding of a coefficient:
with 1, a bit more in either of them helps as much."""
FINEST_STEP = 1e-9
"""Smallest step of the basis, so that its levels are 32-bit numbers."""
EQUAL_ROUNDS, EQUAL_POWER = 4, 0.7
"""How often, and by which power of its error, the weight of each group is changed until all have the same error."""
FULL_ROUNDS = 2
"""How often weights are changed once more by the errors in all frames; the smallest code is taken."""
CHUNK = 1 << 23
"""Numbers that are computed at a time."""


@dataclass(frozen=True, eq=False)
class CodedTable:
    """A code and its error: of each group's errors the 99th percentile of all frames, the largest of all groups."""

    code: LowRankCode
    error: float


def compress_table(
    values: Values,
    kept: Indices,
    tolerance: Array,
    groups: Indices,
    excess: Excess,
    *,
    spacings: Sequence[float] = (1.0,),
    lengths: Sequence[int] = LENGTHS,
) -> CodedTable:
    """Return the smallest code of a table that is found whose errors are allowed.

    values    : [shape=(T, P)]
    kept      : ranges of frames, of ``checked_ranges``; other frames are left out
    tolerance : the unit of each column's error [shape=(P,), > 0]
    groups    : which of the G errors each column contributes to [shape=(P,)]
    excess    : the errors of some rows; the 99th percentile over all kept frames of each must be at most 1
    spacings  : frames between the knots of a spline, of which the best is chosen; 1 is no spline
    Columns are weighted such that all errors are about equal: otherwise the worst would set the step of all.
    Raises InputError: no step of quantisation is small enough.
    """
    table = _Table(values, kept, tolerance, groups, excess)
    if not len(table.frames):
        layout = BlockLayout(len(values), kept, 1.0, lengths[0])
        return CodedTable(_coded(layout, np.zeros((0, lengths[0], 0), np.float32), 1.0, _no_space(tolerance)), 0.0)
    part = table.part()
    scale, count = _equalised(part, lengths[0])
    sample = part.projected(scale, count)
    found = [
        trial
        for spacing in spacings
        for length in lengths
        if (trial := sample.searched(BlockLayout(len(values), part.kept, spacing, length)))
    ]
    if not found:
        raise _refusal(table)
    layout = replace(min(found, key=packed_size).code.layout, kept=kept)
    coded, scale = table.verified(layout, scale, count)
    for _ in range(FULL_ROUNDS if groups.max() else 0):
        try:
            other, scale = table.verified(layout, scale, count)
        except InputError:  # the weights before were better
            break
        coded = min(coded, other, key=lambda each: packed_size(each.code))
    return coded


@dataclass(frozen=True, eq=False)
class _Space:
    """Principal components of scaled values: mean [shape=(P,)] in the values' unit, scale [shape=(P,)], basis
    [shape=(K, P)]; norms of the curves [shape=(K,)].
    """

    mean: Array
    scale: Array
    basis: Array
    norms: Array


@dataclass(frozen=True, eq=False)
class _Table:
    """What is compressed, as in ``compress_table``."""

    values: Values
    kept: Indices
    tolerance: Array
    groups: Indices
    excess: Excess

    @property
    def frames(self) -> Indices:
        """The numbers of the kept frames."""
        return _numbers(self.kept)

    @property
    def chunk(self) -> int:
        """Rows of values that are computed at a time."""
        return CHUNK // self.values.shape[1] + 1

    def part(self) -> _Table:
        """Return the same table with evenly spaced pieces of the frames only."""
        pieces = [
            (start, min(start + PIECE_FRAMES, stop))
            for first, stop in self.kept
            for start in range(first, stop, PIECE_FRAMES)
        ]
        usual = sum(stop - first for first, stop in pieces) / len(pieces)
        chosen = evenly_spaced(int(PART_FRAMES / usual) + 1, len(pieces))
        return replace(self, kept=np.array(pieces, np.intp)[chosen])

    def projected(self, scale: Array, count: int) -> _Projection:
        """Return the curves of the first components of the values divided by ``scale``."""
        width = self.values.shape[1]
        some = self.frames[evenly_spaced(EXACT_ROWS if width > EXACT_ROWS else MOST_ROWS, len(self.frames))]
        space = fit_pca(self.values[some] / scale, count)
        curves = np.zeros((len(self.values), len(space.basis)), np.float32)
        for first, stop in self.kept:
            for start in range(first, stop, self.chunk):
                rows = slice(start, min(start + self.chunk, stop))
                curves[rows] = space.project(self.values[rows] / scale)
        norms = np.sqrt(np.square(curves).sum(axis=0, dtype=np.float64))
        return _Projection(self, _Space(space.mean * scale, scale, space.basis, norms), curves)

    def errors(self, code: LowRankCode, frames: Indices) -> Array:
        """Return the 99th percentile of each group's error in some frames [shape=(G,)]."""
        parts = (frames[start : start + self.chunk] for start in range(0, len(frames), self.chunk))
        errors = [self.excess(code.rows(part), self.values[part]).astype(np.float32) for part in parts]
        return np.percentile(np.concatenate(errors), PERCENTILE, axis=0, overwrite_input=True).astype(np.float64)

    def verified(self, layout: BlockLayout, scale: Array, count: int) -> tuple[CodedTable, Array]:
        """Return the code of one layout whose errors are allowed in all frames, and a scale that may be better.

        Raises InputError: there is none.
        """
        projection = self.projected(scale, count)
        code = projection.searched(layout, max(SAMPLE_FRAMES, MOST_SAMPLED_NUMBERS // self.values.shape[1]))
        coefficients = layout.forward(projection.curves)
        for _ in range(MOST_STEPS):
            if code is None:
                break
            errors = self.errors(code, self.frames)
            if errors.max() <= 1:
                return CodedTable(code, float(errors.max())), self.reweighted(scale, errors)
            code = _coded(layout, coefficients, STEP_FACTOR * code.code.step, projection.space)
        raise _refusal(self)

    def reweighted(self, scale: Array, errors: Array) -> Array:
        """Return scales of the columns with which the errors of all groups are closer to each other."""
        if not errors.max() > 0:
            return scale
        weights = np.maximum(errors / errors.max(), 0.05) ** EQUAL_POWER
        changed = scale / weights[self.groups]
        return changed * np.exp(np.log(self.tolerance / changed).mean())


@dataclass(frozen=True, eq=False)
class _Projection:
    """A table, its components, and their curves in all its frames [shape=(T, K)]."""

    table: _Table
    space: _Space
    curves: NDArray[np.float32]

    def searched(self, layout: BlockLayout, most: int = SAMPLE_FRAMES) -> LowRankCode | None:
        """Return the code of one layout with about the largest step that a sample of frames allows, or None."""
        coefficients = layout.forward(self.curves)
        some = self.table.frames[evenly_spaced(most, len(self.table.frames))]
        best, step, last = None, FIRST_STEP, np.inf
        small, large = 0.0, np.inf  # a step that will do, and one that will not
        for tried in range(MOST_ROUNDS):
            if step < LEAST_STEP or (best is not None and tried >= ROUNDS):
                break
            try:
                code = _coded(layout, coefficients, step, self.space)
            except InputError:  # levels are too large: no step will do
                break
            error = float(self.table.errors(code, some).max())
            if error <= 1:
                best, small = code, step
            elif error > LEAST_ERROR_SHARE * last and step < large / 2:  # what is left is not from quantisation
                break
            else:
                large, last = step, error
            if LEAST_ERROR_SHARE <= error <= 1 or (error <= 1 and not len(code.code.used)):
                break
            step *= float(np.clip(AIMED_ERROR_SHARE / max(error, 1e-9), 0.1, 4))
            if not small < step < large:
                step = float(np.sqrt(small * large)) if small > 0 else large / 2
        return best


def _equalised(table: _Table, length: int) -> tuple[Array, int]:
    """Return scales of the columns with which all groups have about the same error, and the number of components."""
    width = table.values.shape[1]
    scale, count = table.tolerance.copy(), width if width <= EXACT_ROWS else FIRST_COMPONENTS
    layout = BlockLayout(len(table.values), table.kept, 1.0, length)
    for _ in range(EQUAL_ROUNDS):
        code = None
        while code is None:
            projection = table.projected(scale, count)
            code = projection.searched(layout)
            is_all = len(projection.curves.T) < count or count >= width
            if not is_all and (code is None or _uses_last(code, projection)):
                code, count = None, 2 * count
            elif code is None:
                raise _refusal(table)
        errors = table.errors(code, table.frames)
        if len(errors) == 1:
            break
        scale = table.reweighted(scale, errors)
    return scale, count


def _uses_last(code: LowRankCode, projection: _Projection) -> bool:
    """Return whether a code has nearly as many components as there are, so that more of them may be needed."""
    return len(code.basis) > 0.9 * len(projection.space.basis)


def _coded(layout: BlockLayout, coefficients: NDArray[np.float32], step: float, space: _Space) -> LowRankCode:
    """Return the code of coefficients [shape=(B, L, K)] for one step; components without any are left out."""
    code = quantise_blocks(layout, coefficients, step)
    used, numbers = np.unique(code.used[:, 1], return_inverse=True)
    code = replace(code, count=len(used), used=np.stack([code.used[:, 0], numbers.ravel()], axis=1))
    steps = np.clip(BASIS_SHARE * step / np.maximum(space.norms[used], LEAST_STEP), FINEST_STEP, 0.5)
    levels = np.rint(space.basis[used] / steps[:, None]).astype(np.int32)
    return LowRankCode(space.mean, space.scale, levels, steps, code)


def _numbers(kept: Indices) -> Indices:
    """Return the numbers of all frames of some ranges."""
    return np.concatenate([np.zeros(0, np.intp), *(np.arange(first, stop) for first, stop in kept)])


def _no_space(scale: Array) -> _Space:
    return _Space(np.zeros(len(scale)), scale, np.zeros((0, len(scale))), np.zeros(0))


def _refusal(table: _Table) -> InputError:
    some = table.values[table.frames[evenly_spaced(SAMPLE_FRAMES, len(table.frames))]]
    return InputError(
        f"errors of at most {float(table.tolerance.min()):g} cannot be promised for values from {float(some.min()):g} "
        f"to {float(some.max()):g}; allow larger ones"
    )
