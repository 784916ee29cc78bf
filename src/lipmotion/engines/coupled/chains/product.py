"""Structures of chains, and their product: the joint states that chains reach, arcs between them, probabilities."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.units import PHONES, UnitSet, load_unit_set

HMM, MULTISTREAM, FACTORIAL, COUPLED = "hmm", "multistream", "factorial", "coupled"
STRUCTURES = (HMM, MULTISTREAM, FACTORIAL, COUPLED)
UNSEEN_LOSS = 10.0  # chosen on the validation list (docs/results/xieliu2007.md)


@dataclass(frozen=True)
class Structure:
    """The chains, their units, and how the chains depend on each other.

    kind        : ``hmm`` (one chain, one mixture over all streams), ``multistream`` (one chain, one mixture for each
                  stream), ``factorial`` (chains with independent transitions, emission densities of joint states) or
                  ``coupled`` (chains whose transitions depend on the states of all, densities of each chain's states)
    chains      : the unit set of each chain; the first chain emits speech, and its bigram decides which unit follows
    states      : states per unit, left to right, without skips
    limit       : the greatest asynchrony, in states; None: no limit
    cross_units : whether chains may leave a unit at different times
    start_limit : without a limit, the one that holds while the first densities are learned (Viterbi training)
    unseen_loss : without a limit, what the log density of a joint state without a density of its own loses, nats; 0:
                  all densities integrate to 1, and nothing but the shared densities holds the chains together
    moves_together : of coupled chains: whether the chance that a chain moves on depends also on which chains before it
                  move in the same frame. In Eq. 2 it depends on the joint state before alone, so that chains in step
                  must fall out of step, for a frame at least, nearly wherever one moves
    Source: Xie & Liu 2007, Fig. 3 and Eqs. 17–19.
    Raises InputError: a number of chains or a limit that does not fit the kind.
    """

    kind: str
    chains: tuple[UnitSet, ...]
    states: int
    limit: int | None
    cross_units: bool = True
    start_limit: int = 1
    unseen_loss: float = UNSEEN_LOSS
    moves_together: bool = False

    def __post_init__(self) -> None:
        if (self.kind in (HMM, MULTISTREAM)) != (len(self.chains) == 1):
            raise InputError(f"structure {self.kind} with {len(self.chains)} chains; hmm and multistream have one")
        if self.moves_together and self.kind != COUPLED:
            raise InputError(f"moves_together with the structure {self.kind}; required {COUPLED}")
        if self.limit is None and (self.kind != FACTORIAL or len(self.chains) != 2):
            raise InputError("asynchrony is -1, no limit, which only two factorial chains have")
        if self.limit is not None and not 0 <= self.limit < self.states:
            raise InputError(f"asynchrony is {self.limit} states, required 0 to {self.states - 1}, or -1: no limit")

    @cached_property
    def units(self) -> tuple[tuple[str, ...], ...]:
        """The units of every chain; those of the first are sorted by the corresponding units of the others."""
        first, *others = self.chains
        key = {
            unit: [chain.units.index(find_matching_unit(chain, first, unit)) for chain in others]
            for unit in first.units
        }
        return (tuple(sorted(first.units, key=lambda unit: key[unit])), *(chain.units for chain in others))

    @cached_property
    def corresponding_units(self) -> tuple[tuple[int, ...], ...]:
        """For each chain, the number of its unit that corresponds to each unit of the first chain."""
        return tuple(
            tuple(units.index(find_matching_unit(chain, self.chains[0], unit)) for unit in self.units[0])
            for chain, units in zip(self.chains, self.units, strict=True)
        )

    @cached_property
    def state_counts(self) -> tuple[int, ...]:
        """The number of states of each chain."""
        return tuple(len(units) * self.states for units in self.units)

    def chain_of(self, stream: int) -> int:
        """Return the chain that emits a stream: the first emits speech, the others the visual streams in order."""
        return min(stream, len(self.chains) - 1)

    def name(self, states: Iterable[int]) -> str:
        """Return the name of a joint state, given that of each chain: ``b.1 | bi.2``, with states counted from 1."""
        return " | ".join(self.state_name(chain, state) for chain, state in enumerate(states))

    def state_name(self, chain: int, state: int) -> str:
        """Return the name of a state of one chain, as ``b.1``."""
        unit, position = divmod(state, self.states)
        return f"{self.units[chain][unit]}.{position + 1}"


def list_unit_sets(names: str) -> tuple[UnitSet, ...]:
    """Return the unit sets named, or read from files, in a text. Raises InputError: none, or no such set."""
    sets = tuple(load_unit_set(name) for name in names.split())
    if not sets:
        raise InputError("no chains were given; required the unit set of each, as in 'phone viseme'")
    return sets


def find_matching_unit(chain: UnitSet, first: UnitSet, unit: str) -> str:
    """Return the unit of a chain that corresponds to a unit of the first chain: that of most of its phones."""
    if chain is first:
        return unit
    units = [chain.unit(phone) for phone in PHONES if first.unit(phone) == unit]
    return max(units, key=units.count)


Index = NDArray[np.intp]


class JointState(NamedTuple):
    """The unit of each chain, its state within the unit, and whether it has left the unit of the others (``ahead``)."""

    units: tuple[int, ...]
    states: tuple[int, ...]
    ahead: tuple[bool, ...]


class Grammar(NamedTuple):
    """The bigrams of the units of each chain; chains with a limit of asynchrony all follow that of the first chain.

    bigrams : P(next unit | unit) [each shape=(U_c, U_c)], all more than 0
    initial : probability that an utterance begins with each unit [each shape=(U_c,)]
    """

    bigrams: tuple[NDArray[np.float64], ...]
    initial: tuple[NDArray[np.float64], ...]


@dataclass(frozen=True, eq=False)
class Product:
    """The reachable joint states of chains, and the arcs between them.

    grammar          : of the units of the chains
    joint_states     : the S joint states
    arc_from         : the source states of all arcs, sorted by target [shape=(E,)]
    arc_to           : the target states of all arcs [shape=(E,)]
    moves            : whether each chain moves on along each arc [shape=(C, E)]
    unit_probability : of the units that each arc enters, among those that may be entered [shape=(E,)]
    initial          : probability of beginning in each joint state [shape=(S,)]
    Source: Xie & Liu 2007, Eqs. 17–19. What the mask of Eq. 19 leaves of a row of the tables is normalised to sum to 1.
    """

    structure: Structure
    grammar: Grammar
    joint_states: tuple[JointState, ...]
    arc_from: Index
    arc_to: Index
    moves: NDArray[np.bool_]
    unit_probability: NDArray[np.float64]
    initial: NDArray[np.float64]

    @cached_property
    def chain_states(self) -> Index:
        """The state of every chain in each joint state [shape=(C, S)]."""
        units, states, _ = (np.array(part, np.intp).T for part in zip(*self.joint_states, strict=True))
        return units * self.structure.states + states

    @cached_property
    def lead(self) -> Index:
        """The asynchrony: how many states each chain is ahead of the first in each joint state [shape=(C, S)]."""
        _, states, ahead = (np.array(part, np.intp).T for part in zip(*self.joint_states, strict=True))
        positions = states + self.structure.states * ahead
        return positions - positions[0]


def find_reachable(structure: Structure, grammar: Grammar) -> Product:
    """Return the product of chains: the joint states that can be reached from the beginning of an utterance.

    All chains go through corresponding units; those without a limit of asynchrony are not listed, but ``lattice``'s.
    """
    chains = range(len(structure.chains))
    initial_states = {}
    for unit, probability in enumerate(grammar.initial[0].tolist()):
        units = tuple(structure.corresponding_units[c][unit] for c in chains)
        initial_states[JointState(units, (0,) * len(chains), (False,) * len(chains))] = probability
    list_moves = cache(lambda *joint: [*_list_moves(structure, *joint)])
    enter_units = cache(partial(_enter_units, structure.corresponding_units, grammar.bigrams[0]))
    reached: dict[JointState, list[tuple[JointState, tuple[bool, ...], float]]] = {}
    waiting = deque(initial_states)
    while waiting:
        joint = waiting.popleft()
        if joint in reached:
            continue
        reached[joint] = [
            (JointState(units, states, ahead), moved, probability)
            for moved, leaving, states, ahead in list_moves(joint.states, joint.ahead)
            for units, probability in enter_units(joint.units, leaving, joint.ahead).items()
        ]
        waiting.extend(target for target, _, _ in reached[joint] if target not in reached)
    joint_states = tuple(sorted(reached, key=lambda j: (j.ahead, j.states, j.units[1:], j.units[0])))
    number = {joint: index for index, joint in enumerate(joint_states)}
    arcs = [
        (number[target], number[source], moves, probability)
        for source, targets in reached.items()
        for target, moves, probability in targets
    ]
    initial = np.array([initial_states.get(joint, 0.0) for joint in joint_states])
    targets, sources, moved, unit_probability = zip(*sorted(arcs, key=lambda arc: arc[:2]), strict=True)
    arrays = np.array(sources, np.intp), np.array(targets, np.intp), np.array(moved, bool).T, np.array(unit_probability)
    return Product(structure, grammar, joint_states, *arrays, initial / initial.sum())


_Flags = tuple[bool, ...]


def _list_moves(
    structure: Structure, states: tuple[int, ...], ahead: _Flags
) -> Iterator[tuple[_Flags, _Flags, tuple[int, ...], _Flags]]:
    """Yield which chains may move on, which leave a unit, and their states and who is ahead then, within the limit."""
    for moved in product((False, True), repeat=len(states)):
        leaving = tuple(move and state == structure.states - 1 for move, state in zip(moved, states, strict=True))
        if any(out and was for out, was in zip(leaving, ahead, strict=True)):
            continue  # the chain would be a second unit ahead
        if any(leaving) and not (structure.cross_units or all(leaving)):
            continue
        after = tuple(0 if out else state + move for out, state, move in zip(leaving, states, moved, strict=True))
        now_ahead = tuple(out or was for out, was in zip(leaving, ahead, strict=True))
        positions = [state + structure.states * out for state, out in zip(after, now_ahead, strict=True)]
        if structure.limit is None or max(positions) - min(positions) <= structure.limit:
            yield moved, leaving, after, (False,) * len(ahead) if all(now_ahead) else now_ahead


def _enter_units(
    corresponding: Sequence[Sequence[int]],
    bigram: NDArray[np.float64],
    units: tuple[int, ...],
    leaving: _Flags,
    ahead: _Flags,
) -> dict[tuple[int, ...], float]:
    """Return the units of all chains after some leave theirs, with probabilities, by the first chain's bigram."""
    entered = {units[0]: 1.0}  # of the first chain, if it enters one or is in it already
    if any(leaving) and not ahead[0]:
        row, chains_ahead = bigram[units[0]], [c for c, is_ahead in enumerate(ahead) if is_ahead]
        candidates = [u for u in range(len(row)) if all(corresponding[c][u] == units[c] for c in chains_ahead)]
        total = sum(row[unit] for unit in candidates)
        entered = {unit: float(row[unit] / total) for unit in candidates}
    probabilities: dict[tuple[int, ...], float] = defaultdict(float)
    for unit, probability in entered.items():
        after = tuple(corresponding[c][unit] if out else units[c] for c, out in enumerate(leaving))
        probabilities[after] += probability
    return probabilities


Array = NDArray[np.float64]
INITIAL_ADVANCE = 0.2  # probability of moving on in a frame before training: a state lasts 50 ms on average
MIN_FRAMES = 50.0
"""A joint state with fewer frames in training shares its row with all that have the same own state and asynchrony."""
MIN_ADVANCE = 1e-5  # least probability of moving on, and of staying
MAX_SWEEPS, CONVERGENCE_TOLERANCE = 50, 1e-6
"""Iterative scaling ends after so many sweeps, or when no probability changes by as much."""


@dataclass(frozen=True, eq=False)
class Transitions:
    """The probability that each chain moves on, given the joint state of the frame before.

    rows    : for each chain, the row of its table that each joint state uses [each shape=(S,)]
    advance : for each chain, the probability of moving on in each row of its table [each shape=(R_c,)]; where chains
              move together, its table has such rows for every combination of the chains before it that move

    The weight of an arc is the product of its chains' probabilities of moving on or staying and of the probability of
    the units entered. Its probability is this weight by the sum over the arcs that the mask leaves to the same source.
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
            advance = self.advance[chain][self._arc_rows(chain)]
            weight *= np.where(self.product.moves[chain], advance, 1 - advance)
        total = np.bincount(self.product.arc_from, weight, len(self.product.joint_states))
        return np.log(weight / total[self.product.arc_from])

    def reestimated(self, counts: Array) -> Transitions:
        """Return the transitions with the most likely tables (M-step); rows without data stay as they are.

        counts : the expected count of each arc [shape=(E,)]
        Every arc uses one entry of each chain's table. While the other chains' tables are fixed, the likelihood is
        highest where the expected use of each entry equals its count. Iterative scaling does this chain after chain and
        never lowers the likelihood. Without a mask one sweep is the usual closed form, and so it is where chains move
        together (the row before counts as one more frame, so that chains that begin in step may fall out of step).
        Source: Darroch & Ratcliff 1972; the M-step of Xie & Liu 2007, Eq. A.16, is exact only without the mask.
        """
        if self.product.structure.moves_together:
            shares = []
            for chain, old in enumerate(self.advance):
                rows = self._arc_rows(chain)
                moved = np.bincount(rows, counts * self.product.moves[chain], len(old))
                share = (moved + old) / (np.bincount(rows, counts, len(old)) + 1)
                shares.append(np.clip(share, MIN_ADVANCE, 1 - MIN_ADVANCE))
            return replace(self, advance=tuple(shares))
        left: Array = np.bincount(self.product.arc_from, counts, len(self.product.joint_states)).astype(float)
        left, current = left[self.product.arc_from], self
        for _ in range(MAX_SWEEPS):
            before = current.advance
            for chain in range(len(self.rows)):
                current = current._rescaled(chain, counts, left * np.exp(current.arc_log))
            if all(np.abs(a - b).max() < CONVERGENCE_TOLERANCE for a, b in zip(before, current.advance, strict=True)):
                break
        return current

    def tied(self, frames: NDArray[Any]) -> Transitions:
        """Return the transitions with one shared row for joint states, of one state and asynchrony, of few frames."""
        rows, advance = [], []
        for chain, own in enumerate(self.rows):
            blocks = self.advance[chain].reshape(self._blocks(chain), -1)
            key, count = own.copy(), blocks.shape[1]
            rare = frames < MIN_FRAMES
            parts: Sequence[Index] = [self.product.chain_states[chain], *(self.product.lead - self.product.lead[chain])]
            _, number = np.unique(np.stack(parts), axis=1, return_inverse=True)
            key[rare] = count + np.asarray(number, np.intp).reshape(-1)[rare]
            distinct, first, row = np.unique(key, return_index=True, return_inverse=True)
            rows.append(row.astype(np.intp))
            advance.append(blocks[:, own[first[: len(distinct)]]].ravel())
        return replace(self, rows=tuple(rows), advance=tuple(advance))

    def _blocks(self, chain: int) -> int:
        """Return how many combinations of moves of the chains before it a chain's table has rows for."""
        return 1 << chain if self.product.structure.moves_together else 1

    def _arc_rows(self, chain: int) -> Index:
        """Return the row of a chain's table that each arc uses [shape=(E,)]."""
        blocks, rows = self._blocks(chain), self.rows[chain][self.product.arc_from]
        if blocks == 1:
            return rows
        return rows + len(self.advance[chain]) // blocks * ((1 << np.arange(chain)) @ self.product.moves[:chain])

    def _rescaled(self, chain: int, counts: Array, expected: Array) -> Transitions:
        """Return the transitions after a step of iterative scaling, of one chain's table, towards counts of arcs."""
        row, moves = self._arc_rows(chain), self.product.moves[chain]
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
        advance = np.clip(advance, MIN_ADVANCE, 1 - MIN_ADVANCE)
        return replace(self, advance=(*self.advance[:chain], advance, *self.advance[chain + 1 :]))


def create_transitions(product: Product) -> Transitions:
    """Return untrained transitions, in coupled chains with a row for each joint state, in others for each state."""
    coupled = product.structure.kind == COUPLED
    own = np.arange(len(product.joint_states))
    rows = [own if coupled else states for states in product.chain_states]
    counts = [len(own) if coupled else count for count in product.structure.state_counts]
    advance = [np.full(count, INITIAL_ADVANCE) for count in counts]
    if product.structure.moves_together:
        for chain, count in enumerate(counts[1:], start=1):
            share = np.full((1 << chain, count), INITIAL_ADVANCE)
            share[0], share[-1] = INITIAL_ADVANCE / 4, 1 - INITIAL_ADVANCE
            advance[chain] = share.ravel()
    return Transitions(product, tuple(rows), tuple(advance))
