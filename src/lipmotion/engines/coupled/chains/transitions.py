"""Transition probabilities of chains with a limit of asynchrony: coupled tables under a mask, and their M-step."""

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
INITIAL_ADVANCE = 0.2
"""Probability of moving on in a frame before training: a state lasts 50 ms on average."""
LEAST_FRAMES = 50.0
"""A joint state with fewer frames in training shares its row with all that have the same own state and asynchrony."""
LEAST_ADVANCE = 1e-5
"""Least probability of moving on, and of staying."""
MOST_SWEEPS, CONVERGENCE_TOLERANCE = 50, 1e-6
"""Iterative scaling ends after so many sweeps, or when no probability changes by as much."""


@dataclass(frozen=True, eq=False)
class Transitions:
    """The probability that each chain moves on, given the joint state of the frame before.

    rows    : for each chain, the row of its table that each joint state uses [each shape=(S,)]
    advance : for each chain, the probability of moving on in each row of its table [each shape=(R_c,)]

    The weight of an arc is the product of its chains' probabilities of moving on or staying and of the probability of
    the units entered. Its probability is this weight, divided by the sum over the arcs from the same joint state that
    the mask leaves.
    Source: Xie & Liu 2007, Eqs. 2, 17–19. Deviation: which unit follows is decided by the bigram, not by the tables.
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
    def statistic_count(self) -> int:
        """The number of transition statistics: the expected count of each arc."""
        return len(self.product.arc_from)

    @cached_property
    def arc_log(self) -> Array:
        """Log probability of every arc [shape=(E,)]."""
        weight = self.product.unit_probability.copy()
        for chain in range(len(self.rows)):
            advance = self.advance[chain][self.rows[chain]][self.product.arc_from]
            weight *= np.where(self.product.moves[chain], advance, 1 - advance)
        total = np.bincount(self.product.arc_from, weight, len(self.product.joint_states))
        return np.log(weight / total[self.product.arc_from])

    def reestimated(self, counts: Array) -> Transitions:
        """Return the transitions with the most likely tables (M-step); rows without data stay as they are.

        counts : the expected count of each arc [shape=(E,)]
        Every arc uses one entry of each chain's table. While the other chains' tables are fixed, the likelihood is
        highest where the expected use of each entry equals its count. Iterative scaling does this chain after chain and
        never lowers the likelihood. Without a mask one sweep is the usual closed form.
        Source: Darroch & Ratcliff 1972; the M-step of Xie & Liu 2007, Eq. A.16, is exact only without the mask.
        """
        left: Array = np.bincount(self.product.arc_from, counts, len(self.product.joint_states)).astype(float)[
            self.product.arc_from
        ]
        current = self
        for _ in range(MOST_SWEEPS):
            before = current.advance
            for chain in range(len(self.rows)):
                current = current._rescaled(chain, counts, left * np.exp(current.arc_log))
            if all(np.abs(a - b).max() < CONVERGENCE_TOLERANCE for a, b in zip(before, current.advance, strict=True)):
                break
        return current

    def tied(self, frames: NDArray[Any]) -> Transitions:
        """Return the transitions with one shared row for joint states, of an own state and asynchrony, with few frames
        [shape=(S,)].
        """
        rows, advance = [], []
        for chain, own in enumerate(self.rows):
            key, count = own.copy(), len(self.advance[chain])
            rare = frames < LEAST_FRAMES
            parts: Sequence[Index] = [self.product.chain_states[chain], *(self.product.lead - self.product.lead[chain])]
            _, number = np.unique(np.stack(parts), axis=1, return_inverse=True)
            key[rare] = count + np.asarray(number, np.intp).reshape(-1)[rare]
            distinct, first, row = np.unique(key, return_index=True, return_inverse=True)
            rows.append(row.astype(np.intp))
            advance.append(self.advance[chain][own[first[: len(distinct)]]])
        return replace(self, rows=tuple(rows), advance=tuple(advance))

    def _rescaled(self, chain: int, counts: Array, expected: Array) -> Transitions:
        """Return the transitions after a step of iterative scaling, of one chain's table, towards counts of arcs
        [shape=(E,)].
        """
        row, moves = self.rows[chain][self.product.arc_from], self.product.moves[chain]
        size = len(self.advance[chain])
        entries = []
        for moved, present in ((True, self.advance[chain]), (False, 1 - self.advance[chain])):
            counted_use = np.bincount(row, np.where(moves == moved, counts, 0), size)
            expected_use = np.bincount(row, np.where(moves == moved, expected, 0), size)
            divisor = np.where(expected_use > 0, expected_use, 1)
            entries.append(np.where(expected_use > 0, present * counted_use / divisor, present))
        total = entries[0] + entries[1]
        known = total > 0
        advance = np.where(known, entries[0] / np.where(known, total, 1), self.advance[chain])
        advance = np.clip(advance, LEAST_ADVANCE, 1 - LEAST_ADVANCE)
        return replace(self, advance=(*self.advance[:chain], advance, *self.advance[chain + 1 :]))


def initial_transitions(product: Product) -> Transitions:
    """Return the transitions before training: in tables of coupled chains each joint state has a row of its own; in
    those of other chains each state of the chain has one.
    """
    coupled = product.structure.kind == COUPLED
    own = np.arange(len(product.joint_states))
    rows = [own if coupled else states for states in product.chain_states]
    counts = [len(own) if coupled else count for count in product.structure.state_counts]
    return Transitions(product, tuple(rows), tuple(np.full(count, INITIAL_ADVANCE) for count in counts))
