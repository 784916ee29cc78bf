"""Candidate mouths: a few hundred recorded pictures whose fine detail makes generated mouths sharp again."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.motion.eigenlips import COLOURS, Eigenlips

Values = NDArray[np.float32]
Pictures = NDArray[np.uint8]
Index = NDArray[np.intp]

CANDIDATES = 500
"""Number of candidate mouths. Source: Xie & Liu 2007, §6.1."""
ROUNDS = 8
"""Rounds in which the centres of the groups are moved: more did not lower the error on GRID."""
MIXED_CANDIDATES, MIXTURE_SHARE = 20, 0.95
"""Recorded mouths of which a predicted one is mixed, and the share of the mixture."""
LEAST_NEARNESS = 1e-3
"""The furthest of them is penalised as if its squared distance were smaller by this share than the largest one."""
PICTURES_AT_ONCE = 16
"""Pictures that are restored at a time."""
BLOCK = 2048
"""Pictures whose distances to all candidates are in memory at a time."""
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
    def by_colour(self) -> Values:
        """The coefficients of each colour [shape=(3, N, K)]."""
        return np.moveaxis(self.coefficients.reshape(len(self), len(COLOURS), -1), 1, 0)

    @cached_property
    def detail_distances(self) -> Values:
        """Squared distances between the details of any two candidates, in each colour [shape=(3, N, N)], grey²."""
        distances = []
        for number in range(len(COLOURS)):  # of a large face one colour of 500 details has 130 MB
            colour = self.details[..., number].reshape(len(self), -1).astype(np.float32)
            distances.append(squared_distances(colour, colour))
        return np.stack(distances)


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
        group = _nearest(values, centres)
        order = np.argsort(group, kind="stable")
        present, first = np.unique(group[order], return_index=True)
        sums = np.add.reduceat(values[order].astype(np.float64), first, axis=0)
        centres[present] = sums / np.diff(np.append(first, len(values)))[:, None]
    return np.unique(_nearest(centres, values))


def make_candidates(eigenlips: Eigenlips, pictures: Pictures, coefficients: Values | None = None) -> Candidates:
    """Return recorded mouth pictures as candidates, without those that are damaged.

    pictures     : those chosen [shape=(N, H, W, 3)], uint8
    coefficients : of the same pictures [shape=(N, 3·K)], for eigenlips of ``enlarge``; None: their projections
    A picture that differs from what its eigenlips restore by over ``LARGEST_DETAIL`` grey levels somewhere is left out.
    Raises InputError: no pictures, none that is whole, or of another size than those of the eigenlips.
    """
    if coefficients is None:
        coefficients = eigenlips.project(pictures)
    details, deepest = measure_details(eigenlips, pictures, coefficients)
    undamaged = deepest <= LARGEST_DETAIL
    if not undamaged.any():
        raise InputError(
            f"{len(pictures)} pictures, all of which differ from their eigenlips by more than {LARGEST_DETAIL} grey "
            "levels; required at least one that does not: are they pictures of the person whom the eigenlips were "
            "trained on?"
        )
    return Candidates(coefficients[undamaged], details[undamaged])


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
        distances = squared_distances(some, recorded)
        near = np.argpartition(distances, count - 1, axis=1)[:, :count]
        steps = recorded[near] - some[:, None]
        products = (steps @ steps.swapaxes(1, 2)).astype(np.float64)
        penalty = np.take_along_axis(distances, near, axis=1).astype(np.float64)
        penalty /= 1 + LEAST_NEARNESS - penalty / np.maximum(penalty.max(axis=1, keepdims=True), np.finfo(float).tiny)
        least = NO_DISTANCE * np.trace(products, axis1=1, axis2=2)[:, None] + np.finfo(float).tiny
        products[:, np.arange(count), np.arange(count)] += penalty + least
        weights = np.maximum(np.linalg.solve(products, np.ones((len(some), count, 1)))[:, :, 0], 0)
        weights /= weights.sum(axis=1, keepdims=True)
        mixtures = np.einsum("tn,tnd->td", weights.astype(np.float32), recorded[near])
        result[start : start + BLOCK] = MIXTURE_SHARE * mixtures + (1 - MIXTURE_SHARE) * some
    return result


def squared_distances(some: Values, others: Values) -> Values:
    """Return the squared distances between rows of two tables [shape=(M, D) and (N, D)]: float32 [shape=(M, N)]."""
    products = some @ others.T
    lengths = np.einsum("nd,nd->n", some, some)[:, None] + np.einsum("nd,nd->n", others, others)
    return np.maximum(lengths - 2 * products, 0)


LARGEST_COEFFICIENT = 1e6
"""No coefficient of a picture is larger: 255 · √D of D pixels, and pictures have at most 10⁷."""


def _nearest(values: Values, others: Values) -> Index:
    """Return for each row of ``values`` the nearest row of ``others`` [shape=(T,)]."""
    if len(others) > len(values):  # blocks of the longer table
        best, number = np.full(len(values), np.inf, np.float32), np.zeros(len(values), np.intp)
        for start in range(0, len(others), BLOCK):
            distances = squared_distances(values, others[start : start + BLOCK])
            least = distances.min(axis=1)
            nearer = least < best
            best[nearer], number[nearer] = least[nearer], distances.argmin(axis=1)[nearer] + start
        return number
    starts = range(0, len(values), BLOCK)
    return np.concatenate([squared_distances(values[start : start + BLOCK], others).argmin(axis=1) for start in starts])
