"""The decision trees of one stream, which tie states in context: they share densities."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from lipmotion.hmm.multistream.densities import GaussianStatistics
from lipmotion.hmm.multistream.streams import MOTION
from lipmotion.hmm.multistream.unit_states import Inventory, TriphoneState
from lipmotion.printable import printable
from lipmotion.stats.trees import Context, Question, Tree, gaussian_log_likelihood, grow_tree, multispace_log_likelihood


@dataclass(frozen=True, eq=False)
class Forest:
    """Trees by the names of ``Inventory.trees``; their leaves are numbered consecutively, tree after tree."""

    inventory: Inventory
    trees: Mapping[str, Tree]

    @cached_property
    def _first_leaf(self) -> dict[str, int]:
        ends = np.cumsum([0, *(len(tree.leaves) for tree in self.trees.values())])
        return dict(zip(self.trees, ends.tolist(), strict=False))

    @cached_property
    def _leaf_cache(self) -> dict[TriphoneState, int]:
        return {}

    @property
    def size(self) -> int:
        """The number of leaves."""
        return sum(len(tree.leaves) for tree in self.trees.values())

    def leaf(self, state: TriphoneState) -> int:
        """Return the leaf of a state in context, whether or not the context occurred in training."""
        number = self._leaf_cache.get(state)
        if number is None:
            context, position = state
            name = self.inventory.tree(context[1], position)
            tree = self.trees[name]
            number = self._first_leaf[name] + int(np.searchsorted(tree.leaves, tree.path(context)[-1]))
            self._leaf_cache[state] = number
        return number

    def leaves(self, states: Iterable[TriphoneState]) -> NDArray[np.intp]:
        """Return the leaves of states in context [shape=(S,)]."""
        return np.array([self.leaf(state) for state in states], np.intp)

    def leaf_grid(self, unit: str, state: int, neighbours: Sequence[str]) -> NDArray[np.intp]:
        """Return the leaves of a state beside every left and every right neighbour [shape=(N, N)]."""
        name = self.inventory.tree(unit, state)
        tree, leaves = self.trees[name], np.empty((len(neighbours), len(neighbours)), np.intp)
        names = np.array(neighbours)
        numbers = {int(node): self._first_leaf[name] + i for i, node in enumerate(tree.leaves)}

        def fill(node: int, left: NDArray[np.intp], right: NDArray[np.intp]) -> None:
            if tree.asked[node] < 0:
                leaves[np.ix_(left, right)] = numbers[node]
                return
            position, _, members = tree.questions[tree.asked[node]]
            if position == 1:
                fill(node + 1 if unit in members else int(tree.no[node]), left, right)
                return
            one_of = np.isin(names, list(members))
            for answer, following in ((True, node + 1), (False, int(tree.no[node]))):
                sides = [s[one_of[s] == answer] if position == at else s for at, s in ((0, left), (2, right))]
                if len(sides[0]) and len(sides[1]):
                    fill(following, *sides)

        everything = np.arange(len(neighbours))
        fill(0, everything, everything)
        return leaves

    def name(self, leaf: int) -> str:
        """Return the tree of a leaf and the answers that lead to it, in words."""
        tree = next(name for name in reversed(self._first_leaf) if self._first_leaf[name] <= leaf)
        return f"state {tree}: {self.trees[tree].name(int(self.trees[tree].leaves[leaf - self._first_leaf[tree]]))}"

    def text(self) -> str:
        """Return all trees as readable text."""
        return "\n".join(f"state {printable(name)}\n{tree.text()}" for name, tree in self.trees.items())


def unit_forest(inventory: Inventory, spoken: Sequence[str]) -> Forest:
    """Return trees with one leaf for each unit in ``spoken``, and one for all other units together."""
    questions = tuple(Question(1, unit, frozenset([unit])) for unit in inventory.names)
    number = {unit: i for i, unit in enumerate(inventory.names)}
    trees = {}
    for name, (unit, _) in inventory.trees.items():
        order = [] if unit else [number[spoken_unit] for spoken_unit in spoken if spoken_unit not in inventory.free]
        nodes = 2 * len(order) + 1
        asked, no = np.full((2, nodes), -1, np.int32)
        asked[:-1:2], no[:-1:2] = order, np.arange(2, nodes, 2)  # one after another, until one is answered with yes
        trees[name] = Tree(questions, asked, no, np.zeros(nodes))
    return Forest(inventory, trees)


def context_questions(inventory: Inventory, classes: Mapping[str, frozenset[str]]) -> tuple[Question, ...]:
    """Return all questions about the left neighbour, the unit, and the right neighbour.

    classes : sets of units, by name
    Each question asks whether the name is in one of the classes, or whether it is one of the units.
    """
    known = set(inventory.names)
    distinct: dict[frozenset[str], str] = {}
    for name, members in [*classes.items(), *((unit, frozenset([unit])) for unit in inventory.names)]:
        in_inventory = frozenset(members & known)
        if in_inventory and in_inventory != known:
            distinct.setdefault(in_inventory, name)
    return tuple(Question(position, name, members) for position in range(3) for members, name in distinct.items())


def choose_positions(
    stream: str, inventory: Inventory, unit: str, state: int, *, both_neighbours: bool = False
) -> tuple[int, ...]:
    """Return the positions of the context that the tree of a state may ask about (``Question.position``).

    both_neighbours : in acoustic streams, all states ask about both; otherwise those before a unit's middle ask about
                      the left one, those after it about the right one, and the middle about none: fewer nodes to search
    """
    if stream == MOTION:
        return (0, 2) if unit in inventory.free else (0, 1, 2)
    if unit in inventory.free:
        return ()
    if both_neighbours:
        return (0, 1, 2)
    return {-1: (0, 1), 0: (1,), 1: (1, 2)}[inventory.side(unit, state)]


@dataclass(frozen=True)
class TreeCosts:
    """What trees may ask, and what limits their growth.

    factor         : price of a leaf, in units of its description length
    least_frames   : frames that a leaf must have
    least_variance : of a leaf's Gaussian, in the scale of the stream
    both_neighbours : as of ``choose_positions``
    """

    factor: float
    least_frames: float
    least_variance: float
    both_neighbours: bool = False


def grow_forest(
    stream: str,
    inventory: Inventory,
    questions: tuple[Question, ...],
    triphones: Sequence[TriphoneState],
    statistics: GaussianStatistics,
    *,
    has_spaces: bool,
    costs: TreeCosts,
) -> Forest:
    """Return the trees that tie the states in context of one stream.

    triphones  : every state in context that occurred
    statistics : of the frames of each, for one Gaussian each
    has_spaces : whether frames may be without a value: densities then have a point mass
    Source: ``stats.trees.grow_tree``; a leaf costs its mean, its variance and, where there is one, its point mass.
    """
    values = statistics.moments[:, 0]
    if has_spaces:
        values = np.concatenate([statistics.frames[:, None], values], axis=1)
    likelihood = multispace_log_likelihood if has_spaces else gaussian_log_likelihood
    names = np.array([inventory.tree(context[1], state) for context, state in triphones])
    trees = {}
    for name, (unit, state) in inventory.trees.items():
        asked = choose_positions(stream, inventory, unit, state, both_neighbours=costs.both_neighbours)
        in_tree = np.flatnonzero(names == name)
        index: dict[Context, int] = {}  # contexts reduced to the positions asked about
        groups = [
            index.setdefault(
                tuple(part if place in asked else "" for place, part in enumerate(triphones[i][0])), len(index)
            )
            for i in in_tree.tolist()
        ]
        pooled = np.zeros((max(len(index), 1), values.shape[1]))
        np.add.at(pooled, np.array(groups, np.intp), values[in_tree])
        trees[name] = grow_tree(
            list(index) or [("", "", "")],
            pooled,
            [q if q.position in asked else q._replace(members=frozenset()) for q in questions],  # always no
            partial(likelihood, least_variance=costs.least_variance),
            parameters=values.shape[1] - 1,
            factor=costs.factor,
            least=costs.least_frames,
        )
    return Forest(inventory, {name: Tree(questions, tree.asked, tree.no, tree.frames) for name, tree in trees.items()})
