"""Refinement: generated eigenlips become pictures with the detail of recorded mouths, which does not flicker."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.motion.eigenlips import COLOURS, Eigenlips
from lipmotion_faces.appearance.candidates import BLOCK, Candidates, squared_distances

Values = NDArray[np.floating[Any]]
Costs = NDArray[np.float32]
Index = NDArray[np.intp]
Pictures = NDArray[np.uint8]


@dataclass(frozen=True)
class RefinementOptions:
    """How the detail of each frame is chosen.

    steadiness : weight of the change of detail between frames, beside the distance in the space of eigenlips; both
                 are squared grey levels. 0: the nearest candidate in every frame, as in the paper
    neighbours : number of nearest candidates of a frame that are considered, at most
    """

    together: bool = True
    steadiness: float = 1.0
    neighbours: int = 20

    def __post_init__(self) -> None:
        if not 0 <= self.steadiness < np.inf:
            raise InputError(f"steadiness {self.steadiness:g}, required a number from 0")
        if self.neighbours < 1:
            raise InputError(f"{self.neighbours} neighbours, required at least 1")


STEADY = RefinementOptions()
"""The default: one candidate for all colours, and steady detail."""
PAPER = RefinementOptions(together=False, steadiness=0.0, neighbours=1)
"""The refinement of the paper: the nearest candidate of every colour and frame."""


SHARPENING, RADIUS_PX = 0.5, 1.0
"""Share of the difference from a blurred picture that is added, and the blur, px of the face: what the regression and
resampling take away (docs/results/panel.md)."""
LIPS_SHARPENING, LIPS_AXES_PX, LIPS_EDGE_PX = 1.4, (28.0, 16.0), 6.0
"""How much more of it lips and teeth get, which mixing blurs most, in an ellipse in the middle of the mouth with these
half axes and this edge, px of the face."""


def sharpen(pictures: Pictures, share: float, scale: int) -> Pictures:
    """Return pictures [shape=(T, H, W, 3)] that are sharper in lightness; colours would have fringes.

    share : of the difference between the lightness and its blurred picture that is added to all colours, outside the
            lips
    scale : samples a pixel of the face
    """
    from scipy.ndimage import gaussian_filter

    if not share:
        return pictures
    lightness = pictures.mean(axis=3, dtype=np.float32)
    detail = lightness - gaussian_filter(lightness, (0, RADIUS_PX * scale, RADIUS_PX * scale))
    detail *= np.float32(share) * _more_at_the_lips(lightness.shape[1], lightness.shape[2], scale)
    levels = pictures + detail[..., None]
    np.rint(levels, out=levels)
    return np.clip(levels, 0, 255, out=levels).astype(np.uint8)


@cache
def _more_at_the_lips(height: int, width: int, scale: int) -> NDArray[np.float32]:
    """Return 1, and ``LIPS_SHARPENING`` at the lips [shape=(H, W)]."""
    rows, columns = np.mgrid[:height, :width]
    x, y = (columns + 0.5 - width / 2) / scale, (rows + 0.5 - height / 2) / scale
    inside = (1 - np.hypot(x / LIPS_AXES_PX[0], y / LIPS_AXES_PX[1])) * min(LIPS_AXES_PX) / LIPS_EDGE_PX
    share = np.clip(inside, 0, 1)
    return (1 + (LIPS_SHARPENING - 1) * share * share * (3 - 2 * share)).astype(np.float32)


def moving_average(coefficients: Values, frames: int = 3) -> NDArray[np.float64]:
    """Return curves [shape=(T, C)] smoothed by a moving average, narrower at the ends (Xie & Liu 2007, §6)."""
    count = len(coefficients)
    sums = np.concatenate([np.zeros((1, coefficients.shape[1])), np.cumsum(coefficients, axis=0, dtype=np.float64)])
    middle = np.arange(count)
    half = np.minimum(frames // 2, np.minimum(middle, count - 1 - middle))
    return (sums[middle + half + 1] - sums[middle - half]) / (2 * half + 1)[:, None]


@dataclass(frozen=True, eq=False)
class Refiner:
    """Turns eigenlips into pictures with the detail of candidates. Raises InputError: these are of other eigenlips."""

    eigenlips: Eigenlips
    candidates: Candidates
    options: RefinementOptions = STEADY

    def __post_init__(self) -> None:
        wanted, candidates = (len(self.eigenlips.channels), self.eigenlips.size), self.candidates
        if (candidates.coefficients.shape[1], candidates.size) != wanted:
            counts = f"{candidates.coefficients.shape[1]} coefficients and {candidates.size} px"
            raise InputError(
                f"candidates of {counts}, required {wanted[0]} and {wanted[1]} px; make them with the same eigenlips"
            )

    def refine(self, coefficients: Values) -> Pictures:
        """Return the pictures [shape=(T, H, W, 3)] at eigenlips [shape=(T, 3·K)] of a video. Raises InputError: as
        ``choose``.
        """
        return self.pictures(coefficients, self.choose(coefficients))

    def choose(self, coefficients: Values) -> Index:
        """Return for each frame and colour the candidate whose detail it gets [shape=(T, 3)].

        coefficients : eigenlips at the frame rate of the video [shape=(T, 3·K)]
        Raises InputError: another number of coefficients, or values that are not finite.
        Source: Xie & Liu 2007, Eq. 15, if ``steadiness`` is 0. Otherwise the sequence j that minimises
        Σ ‖ô_t − g_j(t)‖² + steadiness · Σ ‖d_j(t) − d_j(t−1)‖², over the nearest candidates of each frame, where d is
        the detail; found exactly by dynamic programming.
        Cost: O(T·N·K) for distances, O(T·neighbours²) for the search.
        """
        wanted = len(self.eigenlips.channels)
        if coefficients.ndim != 2 or coefficients.shape[1] != wanted or not np.isfinite(coefficients).all():
            raise InputError(
                f"coefficients of shape {coefficients.shape}, required finite ones of shape (T, {wanted}), "
                "as Eigenlips.project gives them"
            )
        numbers, costs = self._nearest(np.stack(np.split(coefficients.astype(np.float32), len(COLOURS), axis=1)))
        if self.options.steadiness:
            changes = self.candidates.detail_distances
            if self.options.together:
                changes = changes.sum(axis=0, keepdims=True)
            path = best_sequence(costs, numbers, np.float32(self.options.steadiness) * changes)
        else:
            path = numbers[:, :, 0]
        return np.broadcast_to(path, (len(COLOURS), path.shape[1])).T.copy()

    def pictures(self, coefficients: Values, chosen: Index) -> Pictures:
        """Return the pictures [shape=(T, H, W, 3)] of eigenlips [shape=(T, 3·K)] with the detail of candidates.

        chosen : of ``choose``, or a part of it: pictures of long speech are made a few frames at a time
        Raises InputError: another number of coefficients.
        Source: Xie & Liu 2007, Eq. 16.
        """
        levels = self.eigenlips.expand(coefficients)
        if (chosen == chosen[:, :1]).all():
            levels += self.candidates.details[chosen[:, 0]]
        else:
            for colour in range(len(COLOURS)):
                levels[..., colour] += self.candidates.details[chosen[:, colour], :, :, colour]
        np.rint(levels, out=levels)
        return np.clip(levels, 0, 255, out=levels).astype(np.uint8)

    def _nearest(self, wanted: Costs) -> tuple[Index, Costs]:
        """Return the nearest candidates of each frame, in order, and their costs [shape=(1 or 3, T, n), both]."""
        count = min(self.options.neighbours, len(self.candidates))
        frames = wanted.shape[1]
        rows = 1 if self.options.together else len(COLOURS)
        numbers, costs = np.empty((rows, frames, count), np.intp), np.empty((rows, frames, count), np.float32)
        for start in range(0, frames, BLOCK):
            part = slice(start, start + BLOCK)
            pairs = zip(wanted[:, part], self.candidates.by_colour, strict=True)
            distances = np.stack([squared_distances(frame, candidate) for frame, candidate in pairs])
            if self.options.together:
                distances = distances.sum(axis=0, keepdims=True)
            least = np.argpartition(distances, count - 1, axis=2)[:, :, :count]
            order = np.argsort(np.take_along_axis(distances, least, axis=2), axis=2, kind="stable")
            numbers[:, part] = np.take_along_axis(least, order, axis=2)
            costs[:, part] = np.take_along_axis(distances, numbers[:, part], axis=2)
        return numbers, costs


def best_sequence(costs: Costs, numbers: Index, changes: Costs) -> Index:
    """Return the cheapest sequence of candidates, for each of some searches at once [shape=(C, T)].

    costs   : of every choice [shape=(C, T, n)]
    numbers : the candidates that are the choices [shape=(C, T, n)]
    changes : cost of going from one candidate to another [shape=(C, N, N)]
    Cost: O(C·T·n²).
    """
    searches, frames, count = costs.shape
    if not frames:
        return np.zeros((searches, 0), np.intp)
    before = np.zeros((frames, searches, count), np.intp)
    row = np.arange(searches)[:, None]
    total = costs[:, 0].astype(np.float64)
    for frame in range(1, frames):
        steps = changes[row[:, :, None], numbers[:, frame, :, None], numbers[:, frame - 1, None, :]] + total[:, None, :]
        before[frame] = steps.argmin(axis=2)
        total = np.take_along_axis(steps, before[frame][:, :, None], axis=2)[:, :, 0] + costs[:, frame]
    place = total.argmin(axis=1)
    path = np.empty((searches, frames), np.intp)
    for frame in range(frames - 1, -1, -1):
        path[:, frame] = numbers[row[:, 0], frame, place]
        place = before[frame, row[:, 0], place]
    return path
