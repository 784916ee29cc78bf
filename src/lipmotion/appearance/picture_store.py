"""The store of mouth pictures: hours of them in few bytes, of which any can be read alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.stats.block_code import checked_ranges
from lipmotion.stats.low_rank_code import LOW_RANK_ARRAYS, LowRankCode, low_rank_arrays, low_rank_from_arrays
from lipmotion.stats.low_rank_search import compress_table
from lipmotion.storage.schema import Arrays, ArraySpec, checked_arrays, format_errors, refuse_undeclared

Pictures = NDArray[np.uint8]

WHITE = 255
"""The largest level of a colour."""
USUAL_PSNR_DB = 36.0
"""Differences of pictures stored so are hard to see beside the noise of a camera."""
LEAST_PSNR_DB, MOST_PSNR_DB = 10.0, 50.0
"""Range of what may be promised; rounding to whole levels alone leaves 59 dB."""
EQUAL_DB = 100.0
"""Stated for equal pictures."""
BLOCK = 16
"""Pictures in a block: longer ones were never smaller on GRID."""


@dataclass(frozen=True, eq=False)
class PictureStore:
    """T pictures, compressed.

    table    : the compressed levels of all pixels and colours
    size     : height and width of a picture, px
    psnr_db  : the peak signal-to-noise ratio that 99 of 100 pictures have at least, as measured
    """

    table: LowRankCode
    size: tuple[int, int]
    psnr_db: float

    def __len__(self) -> int:
        return len(self.table)

    @property
    def kept(self) -> NDArray[np.intp]:
        """First picture and the one after the last of each range that is stored [shape=(R, 2)]."""
        return self.table.code.layout.kept

    @property
    def nbytes(self) -> int:
        """Bytes in memory; archives (``storage.archive``) compress them further."""
        return self.table.nbytes

    def rows(self, frames: slice | Sequence[int] | NDArray[np.integer[Any]]) -> Pictures:
        """Return some pictures [shape=(N, H, W, 3)].

        frames : a slice, or their numbers in any order; negative ones count from the end in slices only
        Only the blocks that hold them are decoded.
        Raises InputError: a picture that was not recorded, or that was left out.
        """
        return _as_pictures(self.table.rows(self.table.code.layout.numbers(frames))).reshape(-1, *self.size, 3)


def compress_pictures(
    pictures: Pictures,
    psnr_db: float = USUAL_PSNR_DB,
    *,
    kept: Sequence[tuple[int, int]] | NDArray[np.integer[Any]] | None = None,
) -> PictureStore:
    """Return pictures, compressed such that 99 of 100 have at least the peak signal-to-noise ratio ``psnr_db``.

    pictures : of one person, at a constant rate [shape=(T, H, W, 3)]; also a memory map
    psnr_db  : 20·log10(255 / root mean square of the differences of all pixels and colours)
    kept     : ranges of pictures that are stored, as in ``motion.store.compress``
    Raises InputError: not pictures, or a ratio outside ``LEAST_PSNR_DB`` to ``MOST_PSNR_DB``.
    Cost: as many passes over the pictures as it tries numbers of components; a block of them in memory.
    """
    if pictures.ndim != 4 or pictures.shape[3] != 3 or pictures.dtype != np.uint8:
        raise InputError(
            f"mouth pictures of shape {pictures.shape} and type {pictures.dtype}, required (T, H, W, 3), uint8"
        )
    height, width = pictures.shape[1:3]
    if not height or not width:
        raise InputError(f"mouth pictures of {height} × {width} px, required at least one pixel")
    if not LEAST_PSNR_DB <= psnr_db <= MOST_PSNR_DB:
        raise InputError(f"a PSNR of {psnr_db:g} dB, required {LEAST_PSNR_DB:g} to {MOST_PSNR_DB:g}")
    allowed = WHITE * 10 ** (-psnr_db / 20)

    def excess(restored: NDArray[np.float64], true: NDArray[Any]) -> NDArray[np.float64]:
        difference = _as_pictures(restored).astype(np.float32) - true
        return np.sqrt(np.mean(np.square(difference), axis=1, keepdims=True, dtype=np.float64)) / allowed

    flat = pictures.reshape(len(pictures), height * width * 3)
    tolerance, groups = np.full(flat.shape[1], allowed), np.zeros(flat.shape[1], np.intp)
    coded = compress_table(flat, checked_ranges(kept, len(flat)), tolerance, groups, excess, lengths=(BLOCK,))
    return PictureStore(coded.code, (height, width), _psnr_db(coded.error * allowed))


def picture_store_arrays(store: PictureStore) -> dict[str, NDArray[Any]]:
    """Serialise a store."""
    return {"size": np.array(store.size), "psnr_db": np.array(store.psnr_db)} | low_rank_arrays(store.table)


def picture_store_from_arrays(arrays: Arrays) -> PictureStore:
    """Deserialise a store. Raises ModelFormatError: an array is missing, unknown, or has a wrong shape or range."""
    with format_errors("the store of pictures"):
        refuse_undeclared(arrays, PICTURE_STORE, LOW_RANK_ARRAYS)
        stored, table = checked_arrays(arrays, PICTURE_STORE), low_rank_from_arrays(arrays)
        height, width = stored["size"].tolist()
        if len(table.mean) != height * width * 3:
            raise ValueError(f"{len(table.mean)} levels a picture, required {height} × {width} × 3")
        return PictureStore(table, (height, width), float(stored["psnr_db"]))


PICTURE_STORE = {
    "size": ArraySpec(np.intp, "2", 1, 10_000),
    "psnr_db": ArraySpec(np.float64, "", 0, EQUAL_DB),
}
"""The arrays of a store of pictures, beside those of its table."""


def _as_pictures(levels: NDArray[np.float64]) -> Pictures:
    return np.clip(np.rint(levels), 0, WHITE).astype(np.uint8)


def _psnr_db(error: float) -> float:
    """Return the peak signal-to-noise ratio of a root mean square difference, at most ``EQUAL_DB``."""
    return min(20 * float(np.log10(WHITE / max(error, 1e-9))), EQUAL_DB)
