"""Candidate mouths, recorded pictures whose fine detail makes generated mouths sharp, and the choice among them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.motion.eigenlips import COLOURS, Eigenlips
from lipmotion_faces.appearance.poisson import round_levels

Values = NDArray[np.float32]
Pictures = NDArray[np.uint8]
Index = NDArray[np.intp]

CANDIDATES = 500  # number of candidate mouths. Source: Xie & Liu 2007, §6.1
ROUNDS = 8  # rounds in which the centres of the groups are moved: more did not lower the error on GRID
MIXED_CANDIDATES, MIXTURE_SHARE = 20, 0.95
"""Recorded mouths of which a predicted one is mixed, and the share of the mixture."""
MIN_NEARNESS = 1e-3
"""The furthest of them is penalised as if its squared distance were smaller by this share than the largest one."""
PICTURES_AT_ONCE = 16
BLOCK = 2048  # pictures whose distances to all candidates are in memory at a time
LARGEST_DETAIL = 100
"""The largest detail of an undamaged picture, in grey levels. Of 499 candidates of GRID s1, one has more (139): an
error of the video left a blue square in it. The others have at most 70."""
NO_DISTANCE = 1e-6
"""Mouths are the same if their squared distance is at most this share of the largest squared distance to the mean."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """Recorded mouths, each as its eigenlips and the detail that the eigenlips leave out.

    coefficients : eigenlips, g^r of Eq. 14 [shape=(N, 3·K)], grey levels, as ``Eigenlips.project`` gives them
    details      : recorded picture less the picture that its eigenlips restore [shape=(N, H, W, 3)], in whole grey
                   levels from -100 to 100
    Source: Xie & Liu 2007, Eq. 14. Deviation: the higher coefficients g^d are kept as the picture that they expand to.
    The detail of a picture is A·g^d if A is whole, so Eq. 16 is a sum of pictures, and no basis of 980
    components must be stored; nothing of a candidate is lost that the 980 pictures do not span.
    """

    coefficients: Values
    details: NDArray[np.int8]

    def __len__(self) -> int:
        return len(self.coefficients)

    @property
    def size(self) -> tuple[int, int]:
        """Height and width of a picture, px."""
        return self.details.shape[1], self.details.shape[2]

    @cached_property
    def detail_distances(self) -> Values:
        """Squared distances between the details of any two candidates, in each colour [shape=(3, N, N)], grey²."""
        rows = self.details.reshape(len(self), -1, len(COLOURS))  # of a large face one colour of 500 has 130 MB
        colours = (rows[:, :, number].astype(np.float32) for number in range(len(COLOURS)))
        return np.stack([square_distances(colour, colour) for colour in colours])


def choose_candidates(coefficients: NDArray[np.floating[Any]], count: int = CANDIDATES) -> Index:
    """Return the numbers of recorded mouths that cover all others, ascending [shape=(N,), N ≤ count].

    coefficients : eigenlips of the recorded pictures [shape=(T, 3·K)]
    count        : how many are wanted; fewer are returned where fewer differ
    The first centre is the mouth nearest to the mean; each next one is the mouth furthest from all centres before it
    (Gonzalez 1985), so that no rare mouth is left out. Then ``ROUNDS`` rounds of k-means move the centres
    to where mouths are frequent, and the recorded mouth nearest to each centre is taken. Nothing is random.
    Source: Xie & Liu 2007, §6.1, ask for pictures that cover almost all mouths; how they chose them is not said.
    Raises InputError: no mouths, values that are not finite, or a count below 1.
    Cost: O(T · count · K), ``BLOCK`` · count distances in memory.
    """
    values = np.asarray(coefficients, np.float32)
    if values.ndim != 2 or not values.size or not np.isfinite(values).all():
        required = "finite ones of at least one picture (T, 3·K), as Eigenlips.project gives them"
        raise InputError(f"eigenlips of shape {values.shape}, required {required}")
    if count < 1:
        raise InputError(f"{count} candidate mouths asked for, required at least 1 (the paper has {CANDIDATES})")
    centred = values - values.mean(axis=0, dtype=np.float64).astype(np.float32)
    lengths = np.einsum("td,td->t", centred, centred)
    chosen, distance = [int(lengths.argmin())], np.full(len(values), np.inf, np.float32)
    while len(chosen) < count:
        latest = chosen[-1]
        np.minimum(distance, lengths + lengths[latest] - 2 * (centred @ centred[latest]), out=distance)
        furthest = int(distance.argmax())
        if not distance[furthest] > NO_DISTANCE * lengths.max():
            break  # no more mouths differ
        chosen.append(furthest)
    centres = values[chosen]
    for _ in range(ROUNDS):
        group = _find_nearest(values, centres)
        order = np.argsort(group, kind="stable")
        present, first = np.unique(group[order], return_index=True)
        sums = np.add.reduceat(values[order].astype(np.float64), first, axis=0)
        centres[present] = sums / np.diff(np.append(first, len(values)))[:, None]
    return np.unique(_find_nearest(centres, values))


def measure_details(
    eigenlips: Eigenlips, pictures: Pictures, coefficients: Values
) -> tuple[NDArray[np.int8], NDArray[np.float32]]:
    """Return what eigenlips leave out of pictures, and the largest value of it in each picture before it is cut off.

    pictures     : [shape=(N, H, W, 3)], uint8
    coefficients : their eigenlips [shape=(N, 3·K)]
    Returns whole grey levels, cut off at ``LARGEST_DETAIL`` [shape=(N, H, W, 3)], and [shape=(N,)].
    """
    details, deepest = np.empty(pictures.shape, np.int8), np.empty(len(pictures), np.float32)
    for start in range(0, len(pictures), PICTURES_AT_ONCE):
        part = slice(start, start + PICTURES_AT_ONCE)
        exact = pictures[part] - eigenlips.expand(coefficients[part])
        deepest[part] = np.abs(np.rint(exact, out=exact)).max(axis=(1, 2, 3))
        details[part] = np.clip(exact, -LARGEST_DETAIL, LARGEST_DETAIL, out=exact)
    return details, deepest


def draw_to_recorded(wanted: Values, recorded: Values) -> Values:
    """Return coefficients [shape=(T, D)] that are drawn towards recorded ones: no mouth is an impossible one.

    wanted   : coefficients that a regression predicts [shape=(T, D)]
    recorded : of recorded mouths [shape=(N, D)]
    Each is replaced by ``MIXTURE_SHARE`` of the nearest mixture of its ``MIXED_CANDIDATES`` nearest recorded
    ones, and the rest of itself.
    Mixtures have weights ≥ 0 whose sum is 1, and prefer what is near. The weight of the furthest one is almost 0, so
    they change smoothly over time.
    Source: Wang et al. 2010, "Locality-constrained linear coding", Eq. 7. Deviation: the penalty is d / (1 - d / D)
    of squared distances d, of which D is the largest. What it gains: docs/results/panel.md.
    Cost: O(T·N·D) for distances, O(T·MIXED³).
    """
    count = min(MIXED_CANDIDATES, len(recorded))
    result = np.empty(wanted.shape, np.float32)
    for start in range(0, len(wanted), BLOCK):
        some = wanted[start : start + BLOCK]
        distances = square_distances(some, recorded)
        near = np.argpartition(distances, count - 1, axis=1)[:, :count]
        steps = recorded[near] - some[:, None]
        products = (steps @ steps.swapaxes(1, 2)).astype(np.float64)
        penalty = np.take_along_axis(distances, near, axis=1).astype(np.float64)
        penalty /= 1 + MIN_NEARNESS - penalty / np.maximum(penalty.max(axis=1, keepdims=True), np.finfo(float).tiny)
        ridge = NO_DISTANCE * np.trace(products, axis1=1, axis2=2)[:, None] + np.finfo(float).tiny
        products[:, np.arange(count), np.arange(count)] += penalty + ridge
        weights = np.maximum(np.linalg.solve(products, np.ones((len(some), count, 1)))[:, :, 0], 0)
        weights /= weights.sum(axis=1, keepdims=True)
        mixtures = np.einsum("tn,tnd->td", weights.astype(np.float32), recorded[near])
        result[start : start + BLOCK] = MIXTURE_SHARE * mixtures + (1 - MIXTURE_SHARE) * some
    return result


def square_distances(some: Values, others: Values) -> Values:
    """Return the squared distances between rows of two tables [shape=(M, D) and (N, D)]: float32 [shape=(M, N)]."""
    products = some @ others.T
    lengths = np.einsum("nd,nd->n", some, some)[:, None] + np.einsum("nd,nd->n", others, others)
    return np.maximum(lengths - 2 * products, 0)


LARGEST_COEFFICIENT = 1e6  # no coefficient of a picture is larger: 255 · √D of D pixels, and pictures have at most 10⁷


def _find_nearest(values: Values, others: Values) -> Index:
    """Return for each row of ``values`` the nearest row of ``others`` [shape=(T,)]."""
    if len(others) > len(values):  # blocks of the longer table
        best, number = np.full(len(values), np.inf, np.float32), np.zeros(len(values), np.intp)
        for start in range(0, len(others), BLOCK):
            distances = square_distances(values, others[start : start + BLOCK])
            smallest = distances.min(axis=1)
            nearer = smallest < best
            best[nearer], number[nearer] = smallest[nearer], distances.argmin(axis=1)[nearer] + start
        return number
    starts = range(0, len(values), BLOCK)
    return np.concatenate([square_distances(values[start : start + BLOCK], others).argmin(axis=1) for start in starts])


Levels = NDArray[np.floating[Any]]
Costs = NDArray[np.float32]


@dataclass(frozen=True)
class RefinementOptions:
    """How the detail of each frame is chosen.

    steadiness : weight of the change of detail between frames, beside the distance in the space of eigenlips; both
                 are squared grey levels. 0: the nearest candidate in every frame, as in the paper
    neighbours : number of nearest candidates of a frame that are considered, at most
    blur_px    : what is finer than a Gaussian window of this standard deviation, px of the face, is wholly that of
                 the candidate; 0: only what eigenlips leave out, as in the paper
    """

    together: bool = True
    steadiness: float = 1.0
    neighbours: int = 20
    blur_px: float = 0.0

    def __post_init__(self) -> None:
        if not 0 <= self.steadiness < np.inf:
            raise InputError(f"steadiness {self.steadiness:g}, required a number from 0")
        if self.neighbours < 1:
            raise InputError(f"{self.neighbours} neighbours, required at least 1")


STEADY = RefinementOptions(steadiness=1.0, blur_px=3.0)
"""The default: one candidate for all colours, steady; the edges of lips are its own, as mixed ones are blurred."""
PAPER = RefinementOptions(together=False, steadiness=0.0, neighbours=1)
"""The refinement of the paper: the nearest candidate of every colour and frame."""


SHARPENING = 0.3
"""Share of the difference from a picture blurred by one sample that is added: what resampling there and back takes away
(docs/results/video.md)."""


def sharpen(pictures: Pictures, share: float) -> Pictures:
    """Return pictures [shape=(T, H, W, 3)] that are sharper in lightness; colours would have fringes.

    share : of the difference between lightness and blurred lightness, added to all colours
    """
    from scipy.ndimage import gaussian_filter

    if not share:
        return pictures
    lightness = pictures.astype(np.float32) @ np.full(len(COLOURS), 1 / len(COLOURS), np.float32)
    detail = lightness - gaussian_filter(lightness, 1.0, axes=(1, 2))
    return round_levels(pictures + np.float32(share) * detail[..., None])


def widen(pictures: NDArray[Any], factors: Levels) -> Values:
    """Return pictures [shape=(T, H, W, 3)] made wider about their middle by factors [shape=(T,)], of the same size."""
    from lipmotion_faces.kernels import affine

    height, width = pictures.shape[1:3]
    middle, result = (width - 1) / 2, np.empty(pictures.shape, np.float32)
    for frame, factor in enumerate(factors.tolist()):
        to_source = np.array([[1 / factor, 0, middle - middle / factor], [0, 1, 0]])
        result[frame] = affine.resample(pictures[frame : frame + 1], to_source, (height, width))[0]
    return result


def smooth_curves(coefficients: Levels, frames: int = 3) -> NDArray[np.float64]:
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

    def choose(self, coefficients: Levels) -> Index:
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
        numbers, costs = self._find_nearest(np.stack(np.split(coefficients.astype(np.float32), len(COLOURS), axis=1)))
        if self.options.steadiness:
            changes = self.candidates.detail_distances
            if self.options.together:
                changes = changes.sum(axis=0, keepdims=True)
            path = find_best_sequence(costs, numbers, np.float32(self.options.steadiness) * changes)
        else:
            path = numbers[:, :, 0]
        return np.broadcast_to(path, (len(COLOURS), path.shape[1])).T.copy()

    def refine(self, coefficients: Levels, chosen: Index, factors: Levels | None = None) -> Pictures:
        """Return the pictures [shape=(T, H, W, 3)] of eigenlips [shape=(T, 3·K)] with the detail of candidates.

        chosen  : of ``choose``, or a part of it: pictures of long speech are made a few frames at a time
        factors : how much wider the detail is made in each frame, where all colours have one [shape=(T,)]; None: 1
        Raises InputError: another number of coefficients.
        Source: Xie & Liu 2007, Eq. 16.
        """
        levels = self.eigenlips.expand(coefficients)
        if (chosen == chosen[:, :1]).all():
            details = self.candidates.details[chosen[:, 0]]
            levels += details if factors is None else widen(details, factors)
        else:
            for colour in range(len(COLOURS)):
                levels[..., colour] += self.candidates.details[chosen[:, colour], :, :, colour]
        return round_levels(levels)

    def _find_nearest(self, wanted: Costs) -> tuple[Index, Costs]:
        """Return the nearest candidates of each frame, in order, and their costs [shape=(1 or 3, T, n), both]."""
        count = min(self.options.neighbours, len(self.candidates))
        frames = wanted.shape[1]
        rows = 1 if self.options.together else len(COLOURS)
        by_colour = np.moveaxis(self.candidates.coefficients.reshape(len(self.candidates), len(COLOURS), -1), 1, 0)
        numbers, costs = np.empty((rows, frames, count), np.intp), np.empty((rows, frames, count), np.float32)
        for start in range(0, frames, BLOCK):
            part = slice(start, start + BLOCK)
            pairs = zip(wanted[:, part], by_colour, strict=True)
            distances = np.stack([square_distances(frame, candidate) for frame, candidate in pairs])
            if self.options.together:
                distances = distances.sum(axis=0, keepdims=True)
            nearest = np.argpartition(distances, count - 1, axis=2)[:, :, :count]
            order = np.argsort(np.take_along_axis(distances, nearest, axis=2), axis=2, kind="stable")
            numbers[:, part] = np.take_along_axis(nearest, order, axis=2)
            costs[:, part] = np.take_along_axis(distances, numbers[:, part], axis=2)
        return numbers, costs


def find_best_sequence(costs: Costs, numbers: Index, changes: Costs) -> Index:
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
