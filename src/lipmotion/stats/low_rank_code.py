"""Tables of numbers over time stored in few bytes: principal components whose curves are coded in blocks."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.stats.block_code import BLOCK_CODE, BlockCode, block_code_arrays, block_code_from_arrays
from lipmotion.storage.schema import POSITIVE, Arrays, ArraySpec, checked_arrays

Array = NDArray[np.float64]

KINDS = (np.int8, np.int16, np.int32)
"""Types of the stored levels; the first that holds them is taken."""


@dataclass(frozen=True, eq=False)
class LowRankCode:
    """A table of numbers over time.

    mean  : of each column [shape=(P,)]
    scale : of each column, by which it was divided before the components were computed [shape=(P,)]
    basis : levels of the components [shape=(K, P)]
    steps : of each component's levels [shape=(K,)]
    code  : the curves of the components
    """

    mean: Array
    scale: Array
    basis: NDArray[np.int32]
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
    def nbytes(self) -> int:
        """The bytes that its arrays take in memory."""
        return sum(array.nbytes for array in low_rank_arrays(self).values())


def packed_size(code: LowRankCode) -> int:
    """Return how many bytes the arrays of a code take in an archive, about."""
    return sum(len(zlib.compress(np.ascontiguousarray(array).tobytes(), 6)) for array in low_rank_arrays(code).values())


def low_rank_arrays(code: LowRankCode) -> dict[str, NDArray[Any]]:
    """Serialise a code."""
    own: dict[str, NDArray[Any]] = {"mean": code.mean, "scale": code.scale, "basis": code.basis, "steps": code.steps}
    largest = np.abs(code.basis).max(initial=0)
    own["basis"] = code.basis.astype(next(kind for kind in KINDS if largest <= np.iinfo(kind).max))
    return own | block_code_arrays(code.code)


def low_rank_from_arrays(arrays: Arrays) -> LowRankCode:
    """Deserialise a code; other arrays are ignored. Raises as ``block_code_from_arrays``."""
    stored = checked_arrays(arrays, LOW_RANK)
    if stored.sizes["k"] > stored.sizes["P"]:
        raise ValueError(f"{stored.sizes['k']} components of {stored.sizes['P']} columns, required at most as many")
    return LowRankCode(
        stored["mean"], stored["scale"], stored["basis"], stored["steps"],
        block_code_from_arrays(arrays, stored.sizes["k"]),
    )  # fmt: skip


LOW_RANK = {
    "mean": ArraySpec(np.float64, "P"),
    "scale": ArraySpec(np.float64, "P", POSITIVE),
    "basis": ArraySpec(np.int32, "k P", 1 - 2**31, 2**31 - 1),
    "steps": ArraySpec(np.float64, "k", POSITIVE, 1),
}
"""The arrays of a code of P columns and k components, beside those of ``BLOCK_CODE``."""
LOW_RANK_ARRAYS = (*LOW_RANK, *BLOCK_CODE)
"""Names of the arrays of ``low_rank_arrays``."""
