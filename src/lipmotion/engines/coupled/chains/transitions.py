"""When chains move on: coupled tables under the asynchrony mask, and their exact re-estimation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.coupled.chains.product import Product
from lipmotion.engines.coupled.chains.structures import COUPLED

Array = NDArray[np.float64]
Index = NDArray[np.intp]
FIRST_ADVANCE = 0.2
"""Probability of moving on in a frame before anything is known: 50 ms a state."""
LEAST_FRAMES = 50.0
"""A joint state with fewer frames in training moves on as all with the same own state and the same lead do."""
LEAST, SWEEPS, ENOUGH = 1e-5, 50, 1e-6


@dataclass(frozen=True, eq=False)
class Transitions:
    """Probability that each chain moves on, given the joint state before.

    rows    : the row of the tables that holds in each joint state, chain by chain [each shape=(S,)]
    advance : probability of moving on in each row, chain by chain [each shape=(R_c,)]

    An arc has the product of its chains' probabilities of moving or staying and that of the unit entered, divided by
    the sum of these over the arcs that the mask leaves.
    Source: Xie & Liu 2007, Eqs. 2, 17–19. Deviation: which unit follows is the bigram's, not the tables'.
    """

    product: Product
    rows: tuple[Index, ...]
    advance: tuple[Array, ...]

    @cached_property
    def log_initial(self) -> Array:
        """Log probability of beginning in each joint state [shape=(S,)]."""
        with np.errstate(divide="ignore"):
            return np.log(self.product.initial)

    @property
    def count(self) -> int:
        """How many numbers transitions are learned from: one an arc."""
        return len(self.product.arc_from)

    @cached_property
    def arc_log(self) -> Array:
        """Log probability of every arc [shape=(E,)]."""
        weight = self.product.base.copy()
        for chain in range(len(self.rows)):
            weight *= self._factor(chain)
        total = np.bincount(self.product.arc_from, weight, len(self.product.joints))
        return np.log(weight / total[self.product.arc_from])

    def relearned(self, counts: Array) -> Transitions:
        """Return the tables that explain best how often arcs were followed [shape=(E,)].

        Every arc takes one entry of each chain's table, so with the others fixed the likelihood is highest where the
        expected use of each entry is the counted one: iterative scaling, chain after chain, which never lowers it.
        Without a mask one sweep is the usual closed form. Rows without data stay as they are.
        Source: Darroch & Ratcliff 1972; the M-step of Xie & Liu 2007, Eq. A.16, is exact only without the mask.
        """
        left: Array = np.bincount(self.product.arc_from, counts, len(self.product.joints)).astype(float)[
            self.product.arc_from
        ]
        current = self
        for _ in range(SWEEPS):
            before = current.advance
            for chain in range(len(self.rows)):
                current = current._rescaled(chain, counts, left * np.exp(current.arc_log))
            if all(np.abs(a - b).max() < ENOUGH for a, b in zip(before, current.advance, strict=True)):
                break
        return current

    def tied(self, frames: NDArray[Any]) -> Transitions:
        """Return the same tables, rows of rare joint states shared.

        frames : how long each joint state is expected to have been visited [shape=(S,)]
        """
        rows, advance = [], []
        for chain, own in enumerate(self.rows):
            key, count = own.copy(), len(self.advance[chain])
            rare = frames < LEAST_FRAMES
            key[rare] = count + _alike(self.product, chain)[rare]
            distinct, first, row = np.unique(key, return_index=True, return_inverse=True)
            rows.append(row.astype(np.intp))
            advance.append(self.advance[chain][own[first[: len(distinct)]]])
        return replace(self, rows=tuple(rows), advance=tuple(advance))

    def _factor(self, chain: int) -> Array:
        advance = self.advance[chain][self.rows[chain]][self.product.arc_from]
        return np.where(self.product.moves[chain], advance, 1 - advance)

    def _rescaled(self, chain: int, counts: Array, expected: Array) -> Transitions:
        row, moves = self.rows[chain][self.product.arc_from], self.product.moves[chain]
        size = len(self.advance[chain])
        entries = []
        for moved, now in ((True, self.advance[chain]), (False, 1 - self.advance[chain])):
            seen = np.bincount(row, np.where(moves == moved, counts, 0), size)
            meant = np.bincount(row, np.where(moves == moved, expected, 0), size)
            entries.append(np.where(meant > 0, now * seen / np.where(meant > 0, meant, 1), now))
        total = entries[0] + entries[1]
        known = total > 0
        share = np.where(known, entries[0] / np.where(known, total, 1), self.advance[chain])
        new = np.clip(share, LEAST, 1 - LEAST)
        return replace(self, advance=(*self.advance[:chain], new, *self.advance[chain + 1 :]))


def first_transitions(product: Product) -> Transitions:
    """Return tables before training: coupled chains have a row a joint state, others one a state of their own."""
    coupled = product.structure.kind == COUPLED
    own = np.arange(len(product.joints))
    rows = [own if coupled else states for states in product.chain_states]
    counts = [len(own) if coupled else count for count in product.structure.counts]
    return Transitions(product, tuple(rows), tuple(np.full(count, FIRST_ADVANCE) for count in counts))


def _alike(product: Product, chain: int) -> Index:
    """Return a number for the own state and the leads of all chains [shape=(S,)]."""
    key: Sequence[Index] = [product.chain_states[chain], *(product.lead - product.lead[chain])]
    _, number = np.unique(np.stack(key), axis=1, return_inverse=True)
    return np.asarray(number, np.intp).reshape(-1)
