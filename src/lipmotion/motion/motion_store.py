"""The motion store: hours of motion in few bytes, of which any frames can be read alone.

It is the database of engines that reuse recorded motion (Minnis & Breen 2000, §6: "the efficient storage of the large
amount of motion data").
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.stats.block_code import WIDEST_KNOT_SPACING, checked_ranges
from lipmotion.stats.low_rank_code import LOW_RANK_ARRAYS, LowRankCode, low_rank_arrays, low_rank_from_arrays
from lipmotion.stats.low_rank_search import compress_table
from lipmotion.storage.schema import POSITIVE, Arrays, ArraySpec, checked_arrays, format_errors, refuse_undeclared
from lipmotion.types import Channel

Array = NDArray[np.float64]
Frames = slice | Sequence[int] | NDArray[np.integer[Any]]

LIP_WIDTH_SHARE = 0.005
"""Allowed error of a point, as a share of the width of the lips."""
CAMERA_RATES_HZ = (25.0, 30.0, 50.0, 60.0)
"""Motion at a higher rate may have been interpolated from these: a spline with as many knots is tried."""
"""Beginnings of the names of a point's channels."""


@dataclass(frozen=True, eq=False)
class MotionStore:
    """Motion of P channels in T frames, compressed.

    table     : the compressed values
    rate_hz   : frames per second
    tolerance : the allowed error of the point of each channel, in the channel's unit [shape=(P,)]
    groups    : the number of the point that each channel belongs to [shape=(P,)]
    error     : of each point the 99th percentile of its distance from where it was, over all frames, as a share of the
                  tolerance: the largest of all points; at most 1

    >>> import numpy as np
    >>> motion = np.sin(np.arange(500)[:, None] / 20 + np.arange(6))
    >>> store = compress(motion, 100.0, 0.01, kept=[(0, 200), (300, 500)])
    >>> store.rows(slice(50, 53)).shape, len(store), store.error <= 1
    ((3, 6), 500, True)
    """

    table: LowRankCode
    rate_hz: float
    tolerance: Array
    groups: NDArray[np.intp]
    error: float

    def __len__(self) -> int:
        return len(self.table)

    @property
    def kept(self) -> NDArray[np.intp]:
        """First frame and the one after the last of each range that is stored [shape=(R, 2)]."""
        return self.table.code.layout.kept

    @property
    def nbytes(self) -> int:
        """Bytes in memory; archives (``storage.archive``) compress them further."""
        return self.table.nbytes

    def rows(self, frames: Frames) -> Array:
        """Return the motion in some frames [shape=(N, P)].

        frames : a slice, or the numbers of the frames in any order; negative ones count from the end in slices only
        Only the blocks that hold them are decoded.
        Raises InputError: a frame that was not recorded, or that was left out.
        """
        return self.table.rows(self.table.code.layout.numbers(frames))


def compress(
    values: NDArray[np.floating[Any]],
    rate_hz: float,
    tolerance: float | Array,
    *,
    groups: Sequence[int] | NDArray[np.integer[Any]] | None = None,
    kept: Sequence[tuple[int, int]] | NDArray[np.integer[Any]] | None = None,
) -> MotionStore:
    """Return motion, compressed such that 99 % of the frames of each point are closer than ``tolerance``.

    values    : motion [shape=(T, P)]
    rate_hz   : frames per second
    tolerance : largest distance of a point from where it was, in the unit of the values; one for all channels, or of
                the point of each channel [shape=(P,)]. ``lip_tolerance`` gives the usual one.
    groups    : the number of the point that each channel belongs to [shape=(P,)]; channels of
                one number are coordinates of one point. None: each channel is a point of its own.
    kept      : ranges of frames that are stored, in order: first frame and the one after the last of each
                [shape=(R, 2)]. None: one range of all frames. Motion of several utterances is smallest with one range
                or more for each utterance: a range is coded without its neighbours. Frames of silence that are outside
                all ranges take no space, and the numbers of the others stay as they were.
    Raises InputError: values that are not finite, shapes that do not fit, or a tolerance that is not positive or too
    small.
    Source: principal components (Alexa & Müller 2000, for motion of meshes), a cosine transform over time, and one
    step of quantisation for all coefficients.
    """
    values = np.asarray(values)
    if values.ndim != 2 or not values.shape[1] or values.dtype.kind not in "fiu":
        raise InputError(f"motion of shape {values.shape} and type {values.dtype}, required numbers of shape (T, P)")
    if not 0 < rate_hz < float("inf"):
        raise InputError(f"motion rate is {rate_hz} Hz, required more than 0 and finite")
    ranges = checked_ranges(kept, len(values))
    if not all(np.isfinite(values[first:stop]).all() for first, stop in ranges):
        raise InputError("motion with values that are not finite; give ranges of frames (kept) without them")
    numbers = _checked_groups(groups, values.shape[1])
    allowed = _checked_tolerance(tolerance, numbers)
    spacings = [
        1.0,
        *(rate_hz / camera for camera in CAMERA_RATES_HZ if camera < rate_hz <= WIDEST_KNOT_SPACING * camera),
    ]

    def excess(restored: Array, true: NDArray[Any]) -> Array:
        return point_distances((restored - true) / allowed, numbers)

    coded = compress_table(values, ranges, allowed, numbers, excess, spacings=spacings)
    return MotionStore(coded.code, float(rate_hz), allowed, numbers, coded.error)


def lip_tolerance(values: NDArray[np.floating[Any]], channels: Sequence[Channel]) -> float:
    """Return ``LIP_WIDTH_SHARE`` of the median width of the lips in some motion [shape=(T, P)].

    Raises InputError: there is no channel ``width``, or no frame.
    """
    names = [channel.name for channel in channels]
    if "width" not in names or not len(values):
        raise InputError(
            f"no width of lips in {len(values)} frames of {len(names)} channels; give the tolerance in their unit"
        )
    return LIP_WIDTH_SHARE * float(np.median(values[:, names.index("width")]))


def point_distances(differences: Array, groups: NDArray[np.intp]) -> Array:
    """Return the distances of points [shape=(T, G)] from differences of their channels [shape=(T, P)].

    groups : the number of each channel's point, from 0 to G - 1 [shape=(P,)]
    """
    order = np.argsort(groups, kind="stable")
    starts = np.searchsorted(groups[order], np.arange(groups.max() + 1))
    return np.sqrt(np.add.reduceat(np.square(differences[:, order]), starts, axis=1))


def motion_store_arrays(store: MotionStore) -> dict[str, NDArray[Any]]:
    """Serialise a store."""
    own = {"rate_hz": np.array(store.rate_hz), "tolerance": store.tolerance, "groups": store.groups}
    return own | {"error": np.array(store.error)} | low_rank_arrays(store.table)


def motion_store_from_arrays(arrays: Arrays) -> MotionStore:
    """Deserialise a store. Raises ModelFormatError: an array is missing, unknown, or has a wrong shape or range."""
    with format_errors("the motion store"):
        refuse_undeclared(arrays, MOTION_STORE_ARRAYS)
        table = low_rank_from_arrays(arrays)
        stored = checked_arrays(arrays, MOTION_STORE, P=len(table.mean))
        groups = stored["groups"]
        if len(np.unique(groups)) != groups.max() + 1:
            raise ValueError(f"groups up to {groups.max()} with gaps, required every number")
        return MotionStore(table, float(stored["rate_hz"]), stored["tolerance"], groups, float(stored["error"]))


MOTION_STORE = {
    "rate_hz": ArraySpec(np.float64, "", POSITIVE, 1e9),
    "tolerance": ArraySpec(np.float64, "P", POSITIVE),
    "groups": ArraySpec(np.intp, "P", 0, 1e9),
    "error": ArraySpec(np.float64, "", 0, 1),
}
"""The arrays of a store of P channels, beside those of its table."""
MOTION_STORE_ARRAYS = (*MOTION_STORE, *LOW_RANK_ARRAYS)
"""Names of the arrays of ``motion_store_arrays``."""


def _checked_groups(groups: Any, channels: int) -> NDArray[np.intp]:
    """Return groups numbered from 0. Raises InputError: not one whole number for each channel."""
    if groups is None:
        return np.arange(channels)
    numbers = np.asarray(groups)
    if numbers.shape != (channels,) or numbers.dtype.kind not in "iu":
        raise InputError(
            f"groups of shape {numbers.shape} and type {numbers.dtype}, required ({channels},), whole numbers: the "
            "point of each channel"
        )
    return np.unique(numbers, return_inverse=True)[1].reshape(channels).astype(np.intp)


def _checked_tolerance(tolerance: float | Array, groups: NDArray[np.intp]) -> Array:
    """Return the tolerance of each channel. Raises InputError: not positive, or different within a point."""
    scale = np.asarray(tolerance, float)
    if scale.shape not in ((), groups.shape) or not (np.isfinite(scale) & (scale > 0)).all():
        raise InputError(
            f"a tolerance of shape {scale.shape} that is not positive everywhere, required one number over 0, or one "
            f"for each of {len(groups)} channels"
        )
    scale = np.broadcast_to(scale, groups.shape).copy()
    first = np.unique(groups, return_index=True)[1]
    if (np.abs(scale - scale[first][groups]) > 0).any():
        raise InputError("channels of one point with different tolerances; give them one")
    return scale
