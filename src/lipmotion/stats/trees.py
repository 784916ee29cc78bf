"""Decision trees that tie states in context: contexts with the same answers share a density, or a regression."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.printable import printable
from lipmotion.storage.schema import Arrays, ArraySpec, check_arrays

Context = tuple[str, ...]
"""The names that a state depends on, one for each position: left neighbour, unit, right neighbour."""
Array = NDArray[np.float64]
Likelihood = Callable[[Array], Array]
"""Function of N sufficient statistics [shape=(N, K)], the number of frames first: returns the log likelihood of each
under the density estimated from it [shape=(N,)]."""
MIN_VARIANCE = 1e-12
MAX_CONTEXTS = 50_000  # whose leaves are kept, so that motion is generated again sooner
TIE = 1e-10  # gains of questions that differ by less, as a share of the log likelihood or of the frames, are equal


class Question(NamedTuple):
    """Whether the name at a position (0 left, 1 the unit, 2 right) is one of ``members``."""

    position: int
    name: str
    members: frozenset[str]

    def answer(self, context: Context) -> bool:
        """Return the answer for a context."""
        return context[self.position] in self.members


@dataclass(frozen=True, eq=False)
class Tree:
    """A decision tree; its nodes are in depth-first order, the yes-branch first, and node 0 is the root.

    questions : those that may be asked
    splits    : [shape=(N,)], the number of the question that splits each node; -1 for a leaf
    no        : [shape=(N,)], the node after the answer no (after yes it is the next one); -1 for a leaf
    frames    : [shape=(N,)], the frames of training data in each node
    """

    questions: tuple[Question, ...]
    splits: NDArray[np.int32]
    no: NDArray[np.int32]
    frames: NDArray[np.float64]

    def path(self, context: Context) -> list[int]:
        """Return the nodes from the root to the leaf of a context, whether or not it occurred in training."""
        splits, no = self._lists
        nodes, node = [0], 0
        while splits[node] >= 0:
            node = node + 1 if self.questions[splits[node]].answer(context) else no[node]
            nodes.append(node)
        return nodes

    @cached_property
    def _lists(self) -> tuple[list[int], list[int]]:
        """``splits`` and ``no`` as lists, which are faster to look up."""
        return self.splits.tolist(), self.no.tolist()

    def path_to(self, node: int) -> list[int]:
        """Return the nodes from the root to a node."""
        _, no = self._lists
        nodes = [0]
        while nodes[-1] != node:
            at = nodes[-1]
            nodes.append(at + 1 if node < no[at] else no[at])
        return nodes

    @cached_property
    def leaves(self) -> NDArray[np.intp]:
        """The numbers of the leaves."""
        return np.nonzero(self.splits < 0)[0]

    def rank(self, context: Context) -> int:
        """Return the place of the leaf of a context among ``leaves``; it is looked for once."""
        if context not in self._ranks:
            if len(self._ranks) > MAX_CONTEXTS:
                self._ranks.clear()
            self._ranks[context] = int(np.searchsorted(self.leaves, self.path(context)[-1]))
        return self._ranks[context]

    @cached_property
    def _ranks(self) -> dict[Context, int]:
        return {}

    def name(self, node: int) -> str:
        """Return the answers that lead to a node, in words."""
        path = self.path_to(node)
        answers = []
        for at, following in pairwise(path):
            question = self.questions[self.splits[at]]
            verb = "is" if following == at + 1 else "is not"
            answers.append(f"{POSITIONS[question.position]} {verb} {question.name}")
        return ", ".join(answers) or "any"

    def text(self) -> str:
        """Return the tree as readable text: one line for each node, indented by its depth."""
        lines: list[str] = []

        def write(node: int, depth: int, answer: str) -> None:
            number = self.splits[node]
            question = self.questions[number] if number >= 0 else None
            line = f"{POSITIONS[question.position]} is {question.name}?" if question else "leaf"
            lines.append(f"{'  ' * depth}{answer}{line} ({self.frames[node]:.0f} frames)")
            if question:
                write(node + 1, depth + 1, "yes: ")
                write(int(self.no[node]), depth + 1, "no: ")

        write(0, 0, "")
        return "\n".join(map(printable, lines))


POSITIONS = ("left", "unit", "right")
_STORED_POSITIONS = [str(position) for position in range(len(POSITIONS))]


def score_gaussian(statistics: Array, min_variance: float = MIN_VARIANCE) -> Array:
    """Return the log likelihood of frames under their maximum-likelihood diagonal Gaussian [shape=(N,)].

    statistics     : [shape=(N, 1 + 2·D)]: number of frames, sums, sums of squares
    min_variance : of the Gaussian; without it the likelihood of a few equal frames has no limit
    """
    count = np.maximum(statistics[:, :1], 1e-12)
    sums, squares = np.split(statistics[:, 1:] / count, 2, axis=1)
    spread = np.maximum(squares - sums * sums, 0.0)
    variance = np.maximum(spread, min_variance)
    return -0.5 * count[:, 0] * (np.log(2 * np.pi * variance) + spread / variance).sum(axis=1)


def score_multispace(statistics: Array, min_variance: float = MIN_VARIANCE) -> Array:
    """Return the log likelihood of frames, some without a value, under their maximum-likelihood density [shape=(N,)].

    statistics : [shape=(N, 2 + 2·D)]: number of frames, of frames with a value, and their sums and sums of squares
    min_variance : as in ``score_gaussian``
    The density is a Gaussian for frames with a value and a point mass for those without one.
    """
    count, voiced = statistics[:, 0], statistics[:, 1]
    total = np.maximum(count, 1e-12)
    likelihood = np.zeros(len(count))
    for part in (np.maximum(voiced, 0.0), np.maximum(count - voiced, 0.0)):
        likelihood += part * np.log(np.where(part > 0, part, total) / total)
    return likelihood + np.where(voiced > 0, score_gaussian(statistics[:, 1:], min_variance), 0.0)


def grow_tree(
    contexts: Sequence[Context],
    statistics: Array,
    questions: Sequence[Question],
    log_likelihood: Likelihood,
    *,
    parameters: int,
    factor: float,
    min_frames: float,
) -> Tree:
    """Return the tree in which every split raises the log likelihood by more than its description length.

    contexts   : C distinct ones
    statistics : of each context [shape=(C, K)], additive, the number of frames first
    log_likelihood : function of statistics
    parameters : number of parameters of a density; a split adds as many, of price ``factor`` · ½ log(frames) each
    min_frames : frames that a leaf must have
    Source: Shinoda & Watanabe 2000 (minimum description length).
    """
    questions = tuple(questions)
    answers = np.array([[q.answer(c) for c in contexts] for q in questions], float).reshape(len(questions), -1)
    price = factor * parameters / 2 * np.log(max(statistics[:, 0].sum(), 2.0))
    splits: list[int] = []
    no: list[int] = []
    frames: list[float] = []

    def choose_question(members: NDArray[np.intp]) -> int:
        """Return the number of the question with the largest gain; -1: no gain exceeds the price."""
        total = statistics[members].sum(axis=0)
        yes = answers[:, members] @ statistics[members]
        allowed = np.nonzero((yes[:, 0] >= min_frames) & (total[0] - yes[:, 0] >= min_frames))[0]
        if not len(allowed):
            return -1
        unsplit = log_likelihood(total[None])
        gain = log_likelihood(yes[allowed]) + log_likelihood(total - yes[allowed]) - unsplit
        tolerance = TIE * (np.abs(unsplit[0]) + total[0])
        best = int(np.argmax(gain >= gain.max() - tolerance))  # the first: rounding must not choose among equal splits
        return int(allowed[best]) if gain[best] > price else -1

    def add(members: NDArray[np.intp]) -> None:
        node = len(splits)
        splits.append(choose_question(members))
        no.append(-1)
        frames.append(float(statistics[members, 0].sum()))
        if splits[node] >= 0:
            yes = answers[splits[node], members] > 0
            add(members[yes])
            no[node] = len(splits)
            add(members[~yes])

    add(np.arange(len(contexts)))
    return Tree(questions, np.array(splits, np.int32), np.array(no, np.int32), np.array(frames))


def trees_to_arrays(trees: Mapping[str, Tree]) -> dict[str, NDArray[Any]]:
    """Serialise trees that share their questions, by name; only questions that are asked are stored."""
    questions = next(iter(trees.values())).questions
    splits = np.concatenate([tree.splits for tree in trees.values()])
    used = np.unique(splits[splits >= 0])
    stored = [(str(q.position), q.name, " ".join(sorted(q.members))) for q in (questions[n] for n in used)]
    return {
        "questions": np.array(stored, np.str_).reshape(-1, 3),
        "trees": np.array(list(trees)),
        "sizes": np.array([len(tree.splits) for tree in trees.values()], np.int32),
        "asked": np.where(splits >= 0, np.searchsorted(used, splits), -1).astype(np.int32),
        "no": np.concatenate([tree.no for tree in trees.values()]),
        "frames": np.concatenate([tree.frames for tree in trees.values()]),
    }


TREES = {
    "questions": ArraySpec(np.str_, "q 3"),
    "trees": ArraySpec(np.str_, "N"),
    "sizes": ArraySpec(np.int32, "N", 1, 1e6),
    "asked": ArraySpec(np.int32, "S", -1, 1e6),
    "no": ArraySpec(np.int32, "S", -1, 1e6),
    "frames": ArraySpec(np.float64, "S", 0, 1e12),
}
"""How trees are stored: N of them with S nodes in all."""


def trees_from_arrays(arrays: Arrays) -> dict[str, Tree]:
    """Deserialise trees, by name. Raises KeyError, ValueError: something is missing or inconsistent."""
    stored = check_arrays(arrays, TREES)
    questions = tuple(
        Question(_STORED_POSITIONS.index(position), name, frozenset(members.split()))
        for position, name, members in stored["questions"].tolist()
    )
    names, sizes, ends = stored["trees"].tolist(), stored["sizes"], np.cumsum(stored["sizes"])
    if ends[-1] != stored.sizes["S"] or len(set(names)) < len(names):
        raise ValueError(f"trees of {ends[-1]} nodes with {stored.sizes['S']} questions asked, or two of one name")
    trees = {}
    for name, start, end in zip(names, ends - sizes, ends, strict=True):
        splits, no = stored["asked"][start:end], stored["no"][start:end]
        _check_nodes(splits, no, len(questions))
        trees[name] = Tree(questions, splits, no, stored["frames"][start:end])
    return trees


def _check_nodes(splits: NDArray[np.int32], no: NDArray[np.int32], questions: int) -> None:
    inner = splits >= 0
    if (splits >= questions).any() or (splits < -1).any() or (no[~inner] != -1).any():
        raise ValueError("a tree asks a question that does not exist")
    ends = [len(splits)]  # of the subtrees that contain the node
    for node in range(len(splits)):
        if node == ends[-1]:
            ends.pop()
        if inner[node]:
            if not node + 1 < no[node] < ends[-1]:
                raise ValueError("a tree whose branches do not end")
            ends.append(int(no[node]))
        elif node + 1 != ends[-1]:
            raise ValueError("a tree whose branches do not meet")


@dataclass(frozen=True, eq=False)
class RegressionStatistics:
    """Statistics of a regression, accumulated in place: Σ z zᵀ [shape=(F, F)], Σ z rᵀ [shape=(F, P)]."""

    products: Array
    targets: Array

    def add(self, z: NDArray[np.floating[Any]], r: NDArray[np.floating[Any]]) -> None:
        """Accumulate the statistics of frames [shapes=(N, F), (N, P)]."""
        np.add(self.products, z.T @ z, out=self.products)
        np.add(self.targets, z.T @ r, out=self.targets)

    def __add__(self, other: RegressionStatistics) -> RegressionStatistics:
        return RegressionStatistics(self.products + other.products, self.targets + other.targets)


def create_statistics(inputs: int, outputs: int) -> RegressionStatistics:
    """Return the statistics of no frames."""
    return RegressionStatistics(np.zeros((inputs, inputs)), np.zeros((inputs, outputs)))


def ridge(moments: RegressionStatistics, prior: Array, strength: float) -> Array:
    """Return the coefficients of a ridge regression towards a prior [shape=(F, P)].

    prior    : coefficients [shape=(F, P)]
    strength : weight of the prior, in squared units of z
    argmin Σ |r - Cᵀz|² + strength |C - prior|²
    """
    system = moments.products + strength * np.eye(len(moments.products))
    return prior + np.linalg.solve(system, moments.targets - moments.products @ prior).astype(float)


def fit_tree_regressions(
    tree: Tree, moments: Mapping[int, RegressionStatistics], shared: Array, strength: float
) -> dict[int, Array]:
    """Return the coefficients of every node in ``moments`` [shape=(F, P)]; each has those of the node above as prior.

    moments : by node, the statistics of the leaves whose regression is that of the node
    shared  : the prior of the root
    """
    regressions: dict[int, Array] = {}

    def visit(node: int, end: int, prior: Array) -> None:
        inside = [moments[other] for other in moments if node <= other < end]
        if not inside:
            return
        coefficients = ridge(sum(inside[1:], inside[0]), prior, strength)
        if node in moments:
            regressions[node] = coefficients
        if tree.splits[node] >= 0:
            visit(node + 1, int(tree.no[node]), coefficients)
            visit(int(tree.no[node]), end, coefficients)

    visit(0, len(tree.splits), shared)
    return regressions
