"""Frames of a video in any order, forwards and backwards, with few of them in memory."""

from __future__ import annotations

from bisect import bisect_right
from collections import OrderedDict
from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

Frame = NDArray[np.uint8]
ReadFrames = Callable[[int, int], Iterable[Frame]]

MAX_DECODED_BYTES = 160 * 2**20
"""Decoded frames that are kept, bytes; those of two groups are kept however large they are."""


class FrameGroups:
    """Any frame of a video that is decoded group by group; the groups used last are kept.

    read   : returns the frames of a group, from the first (included) to the last (excluded), in order
    starts : first frame of each group, rising from 0, and the number of all frames at the end
    most_bytes : decoded frames that are kept, beside those of the last two groups
    Not for several threads.
    """

    def __init__(self, read: ReadFrames, starts: Sequence[int], most_bytes: int = MAX_DECODED_BYTES) -> None:
        self._read = read
        self._starts = list(starts)
        self._most_bytes = most_bytes
        self._groups: OrderedDict[int, list[Frame]] = OrderedDict()

    def __len__(self) -> int:
        return self._starts[-1]

    @property
    def nbytes(self) -> int:
        """Bytes of the decoded frames that are kept."""
        return sum(frame.nbytes for group in self._groups.values() for frame in group)

    def frame(self, index: int) -> Frame:
        """Return a frame: uint8 array [shape=(H, W, 3)], which is not to be changed.

        Raises IndexError: there is no such frame. Raises the errors of reading.
        """
        if not 0 <= index < len(self):
            raise IndexError(f"frame {index} of {len(self)}")
        group = bisect_right(self._starts, index) - 1
        if group in self._groups:
            self._groups.move_to_end(group)
        else:
            self._decode(group)
        return self._groups[group][index - self._starts[group]]

    def _decode(self, group: int) -> None:
        while len(self._groups) > 1 and (len(self._groups) + 1) * self._largest() > self._most_bytes:
            self._groups.popitem(last=False)
        self._groups[group] = list(self._read(self._starts[group], self._starts[group + 1]))

    def _largest(self) -> int:
        """Return the bytes of the largest group that is kept."""
        return max(sum(frame.nbytes for frame in group) for group in self._groups.values())
