"""The decision trees of one stream: which states in which contexts share a density."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from lipmotion.hmm.multistream.densities import Sums
from lipmotion.hmm.multistream.inventory import Inventory, Place
from lipmotion.hmm.multistream.streams import MOTION
from lipmotion.printable import printable
from lipmotion.stats.trees import Context, Question, Tree, gaussian_likelihood, grow, multispace_likelihood


@dataclass(frozen=True, eq=False)
class Forest:
    """Trees by the names of ``Inventory.trees``; their leaves are numbered through, tree after tree."""

    inventory: Inventory
    trees: Mapping[str, Tree]

    @cached_property
    def _first(self) -> dict[str, int]:
        ends = np.cumsum([0, *(len(tree.leaves) for tree in self.trees.values())])
        return dict(zip(self.trees, ends.tolist(), strict=False))

    @cached_property
    def _found(self) -> dict[Place, int]:
        return {}

    @property
    def size(self) -> int:
        """How many leaves there are."""
        return sum(len(tree.leaves) for tree in self.trees.values())

    def leaf(self, place: Place) -> int:
        """Return the leaf of a state in a context, seen in training or not."""
        number = self._found.get(place)
        if number is None:
            context, state = place
            name = self.inventory.tree(context[1], state)
            tree = self.trees[name]
            number = self._first[name] + int(np.searchsorted(tree.leaves, tree.path(context)[-1]))
            self._found[place] = number
        return number

    def leaves(self, places: Iterable[Place]) -> NDArray[np.intp]:
        """Return the leaves of states in their contexts [shape=(S,)]."""
        return np.array([self.leaf(place) for place in places], np.intp)

    def name(self, leaf: int) -> str:
        """Return the tree of a leaf and the answers that lead to it, in words."""
        tree = next(name for name in reversed(self._first) if self._first[name] <= leaf)
        return f"state {tree}: {self.trees[tree].name(int(self.trees[tree].leaves[leaf - self._first[tree]]))}"

    def text(self) -> str:
        """Return all trees for people to read."""
        return "\n".join(f"state {printable(name)}\n{tree.text()}" for name, tree in self.trees.items())


def unit_forest(inventory: Inventory, spoken: Sequence[str]) -> Forest:
    """Return the trees that give each unit that is spoken a density of its own, and all others one together."""
    questions = tuple(Question(1, unit, frozenset([unit])) for unit in inventory.names)
    number = {unit: i for i, unit in enumerate(inventory.names)}
    trees = {}
    for name, (unit, _) in inventory.trees.items():
        asked = [] if unit else [number[spoken_unit] for spoken_unit in spoken if spoken_unit not in inventory.free]
        trees[name] = _list(questions, asked)
    return Forest(inventory, trees)


def _list(questions: tuple[Question, ...], order: Sequence[int]) -> Tree:
    """Return the tree that asks some questions one after another, as long as the answer is no."""
    nodes = 2 * len(order) + 1
    asked, no = np.full(nodes, -1, np.int32), np.full(nodes, -1, np.int32)
    asked[:-1:2] = order
    no[:-1:2] = np.arange(2, nodes, 2)
    return Tree(questions, asked, no, np.zeros(nodes))


def questions_about(inventory: Inventory, classes: Mapping[str, frozenset[str]]) -> tuple[Question, ...]:
    """Return all questions about the left neighbour, the unit, and the right one: whether it is in one of the classes,
    and whether it is one of the units.
    """
    known = set(inventory.names)
    distinct: dict[frozenset[str], str] = {}
    for name, members in [*classes.items(), *((unit, frozenset([unit])) for unit in inventory.names)]:
        inside = frozenset(members & known)
        if inside and inside != known:
            distinct.setdefault(inside, name)
    return tuple(Question(place, name, members) for place in range(3) for members, name in distinct.items())


def places_asked(stream: str, inventory: Inventory, unit: str, state: int) -> tuple[int, ...]:
    """Return which places of the context the tree of a state may ask for.

    Of what is heard, states before the middle ask for the left neighbour, those after it for the right one: so whole
    sequences of units in context can be searched exactly. Motion, which is not searched, may ask for both.
    """
    if stream == MOTION:
        return (0, 2) if unit in inventory.free else (0, 1, 2)
    if unit in inventory.free:
        return ()
    return {-1: (0, 1), 0: (1,), 1: (1, 2)}[inventory.side(unit, state)]


def grown(
    stream: str,
    inventory: Inventory,
    questions: tuple[Question, ...],
    seen: Sequence[Place],
    sums: Sums,
    *,
    has_spaces: bool,
    factor: float,
    least_frames: float,
    least_variance: float,
) -> Forest:
    """Return the trees that tie the contexts of one stream.

    seen  : every state in every context that was seen
    sums  : what the frames say about each, a Gaussian each
    Source: ``stats.trees.grow``; a leaf costs what its mean, variance and, where there is one, point mass cost.
    """
    statistics = sums.sums[:, 0]
    if has_spaces:
        statistics = np.concatenate([sums.frames[:, None], statistics], axis=1)
    likelihood = multispace_likelihood if has_spaces else gaussian_likelihood
    names = np.array([inventory.tree(context[1], state) for context, state in seen])
    trees = {}
    for name, (unit, state) in inventory.trees.items():
        asked = places_asked(stream, inventory, unit, state)
        mine = np.flatnonzero(names == name)
        contexts, pooled = _pooled([seen[i][0] for i in mine.tolist()], statistics[mine], asked)
        trees[name] = grow(
            contexts,
            pooled,
            [question if question.place in asked else _never(question) for question in questions],
            partial(likelihood, least_variance=least_variance),
            parameters=statistics.shape[1] - 1,
            factor=factor,
            least=least_frames,
        )
    return Forest(inventory, {name: Tree(questions, tree.asked, tree.no, tree.frames) for name, tree in trees.items()})


def _never(question: Question) -> Question:
    return Question(question.place, question.name, frozenset())


def _pooled(
    contexts: Sequence[Context], statistics: NDArray[np.float64], asked: Sequence[int]
) -> tuple[list[Context], NDArray[np.float64]]:
    """Return contexts without the places that are not asked for, and the sums of those that are alike then."""
    alike: dict[Context, int] = {}
    groups = [
        alike.setdefault(tuple(name if place in asked else "" for place, name in enumerate(context)), len(alike))
        for context in contexts
    ]
    if not alike:
        return [("", "", "")], np.zeros((1, statistics.shape[1]))
    pooled = np.zeros((len(alike), statistics.shape[1]))
    np.add.at(pooled, groups, statistics)
    return list(alike), pooled
