"""Decision trees that tie states in context: contexts with the same answers to questions share a density."""

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
LEAST_VARIANCE = 1e-12
"""Least variance of a Gaussian."""
TIE = 1e-10
"""Gains of questions that differ by less, as a share of the log likelihood or of the frames, are equal."""


class Question(NamedTuple):
    """The question whether the name at one position of a context is one of some.

    position : 0 the left neighbour, 1 the unit, 2 the right neighbour
    name     : of the question
    members  : the names for which the answer is yes
    """

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
    asked     : [shape=(N,)], the number of each node's question; -1 for a leaf
    no        : [shape=(N,)], the node after the answer no (after yes it is the next one); -1 for a leaf
    frames    : [shape=(N,)], the frames of training data in each node
    """

    questions: tuple[Question, ...]
    asked: NDArray[np.int32]
    no: NDArray[np.int32]
    frames: NDArray[np.float64]

    def path(self, context: Context) -> list[int]:
        """Return the nodes from the root to the leaf of a context, whether or not it occurred in training."""
        asked, no = self._lists
        nodes, node = [0], 0
        while asked[node] >= 0:
            node = node + 1 if self.questions[asked[node]].answer(context) else no[node]
            nodes.append(node)
        return nodes

    @cached_property
    def _lists(self) -> tuple[list[int], list[int]]:
        """``asked`` and ``no`` as lists, which are faster to look up."""
        return self.asked.tolist(), self.no.tolist()

    def path_to(self, node: int) -> list[int]:
        """Return the nodes from the root to a node."""
        _, no = self._lists
        nodes = [0]
        while nodes[-1] != node:
            at = nodes[-1]
            nodes.append(at + 1 if node < no[at] else no[at])
        return nodes

    @property
    def leaves(self) -> NDArray[np.intp]:
        """The numbers of the leaves."""
        return np.nonzero(self.asked < 0)[0]

    def name(self, node: int) -> str:
        """Return the answers that lead to a node, in words."""
        path = self.path_to(node)
        answers = []
        for at, following in pairwise(path):
            asked = self.questions[self.asked[at]]
            answers.append(f"{POSITIONS[asked.position]} {'is' if following == at + 1 else 'is not'} {asked.name}")
        return ", ".join(answers) or "any"

    def text(self) -> str:
        """Return the tree as readable text: one line for each node, indented by its depth."""
        lines: list[str] = []

        def write(node: int, depth: int, answer: str) -> None:
            asked = self.asked[node]
            question = self.questions[asked] if asked >= 0 else None
            line = f"{POSITIONS[question.position]} is {question.name}?" if question else "leaf"
            lines.append(f"{'  ' * depth}{answer}{line} ({self.frames[node]:.0f} frames)")
            if question:
                write(node + 1, depth + 1, "yes: ")
                write(int(self.no[node]), depth + 1, "no: ")

        write(0, 0, "")
        return "\n".join(map(printable, lines))


POSITIONS = ("left", "unit", "right")
_STORED_POSITIONS = [str(position) for position in range(len(POSITIONS))]


def gaussian_log_likelihood(statistics: Array, least_variance: float = LEAST_VARIANCE) -> Array:
    """Return the log likelihood of frames under their maximum-likelihood diagonal Gaussian [shape=(N,)].

    statistics     : [shape=(N, 1 + 2·D)]: number of frames, sums, sums of squares
    least_variance : of the Gaussian; without it the likelihood of a few equal frames has no limit
    """
    count = np.maximum(statistics[:, :1], 1e-12)
    sums, squares = np.split(statistics[:, 1:] / count, 2, axis=1)
    spread = np.maximum(squares - sums * sums, 0.0)
    variance = np.maximum(spread, least_variance)
    return -0.5 * count[:, 0] * (np.log(2 * np.pi * variance) + spread / variance).sum(axis=1)


def multispace_log_likelihood(statistics: Array, least_variance: float = LEAST_VARIANCE) -> Array:
    """Return the log likelihood of frames, some without a value, under their maximum-likelihood density [shape=(N,)].

    statistics : [shape=(N, 2 + 2·D)]: number of frames, of frames with a value, and their sums and sums of squares
    least_variance : as in ``gaussian_log_likelihood``
    The density is a Gaussian for frames with a value and a point mass for those without one.
    """
    count, voiced = statistics[:, 0], statistics[:, 1]
    whole = np.maximum(count, 1e-12)
    likelihood: Array = _share_likelihood(voiced, whole) + _share_likelihood(count - voiced, whole)
    return likelihood + np.where(voiced > 0, gaussian_log_likelihood(statistics[:, 1:], least_variance), 0.0)


def _share_likelihood(part: Array, whole: Array) -> Array:
    """Return part · log(part / whole), 0 where there is no part."""
    part = np.maximum(part, 0.0)
    return part * np.log(np.where(part > 0, part, whole) / whole)


def grow_tree(
    contexts: Sequence[Context],
    statistics: Array,
    questions: Sequence[Question],
    log_likelihood: Likelihood,
    *,
    parameters: int,
    factor: float,
    least: float,
) -> Tree:
    """Return the tree in which every split raises the log likelihood by more than its description length.

    contexts   : C distinct ones
    statistics : of each context [shape=(C, K)], additive, the number of frames first
    log_likelihood : function of statistics
    parameters : number of parameters of a density; a split adds as many, of price ``factor`` · ½ log(frames) each
    least      : frames that a leaf must have
    Source: Shinoda & Watanabe 2000 (minimum description length).
    """
    questions = tuple(questions)
    answers = np.array([[q.answer(c) for c in contexts] for q in questions], float).reshape(len(questions), -1)
    price = factor * parameters / 2 * np.log(max(statistics[:, 0].sum(), 2.0))
    asked: list[int] = []
    no: list[int] = []
    frames: list[float] = []

    def add(members: NDArray[np.intp]) -> None:
        node = len(asked)
        inside = statistics[members]
        asked.append(_best_question(answers[:, members], inside, log_likelihood, price, least))
        no.append(-1)
        frames.append(float(inside[:, 0].sum()))
        if asked[node] >= 0:
            yes = answers[asked[node], members] > 0
            add(members[yes])
            no[node] = len(asked)
            add(members[~yes])

    add(np.arange(len(contexts)))
    return Tree(questions, np.array(asked, np.int32), np.array(no, np.int32), np.array(frames))


def _best_question(answers: Array, statistics: Array, log_likelihood: Likelihood, price: float, least: float) -> int:
    """Return the number of the question with the largest gain in log likelihood; -1: no gain exceeds the price.

    answers    : of each question for each context [shape=(N, C)], 1 for yes
    statistics : of the contexts [shape=(C, K)]
    Of several equal gains the first question's is taken.
    """
    total = statistics.sum(axis=0)
    yes = answers @ statistics
    allowed = np.nonzero((yes[:, 0] >= least) & (total[0] - yes[:, 0] >= least))[0]
    if not len(allowed):
        return -1
    whole = log_likelihood(total[None])
    gain = log_likelihood(yes[allowed]) + log_likelihood(total - yes[allowed]) - whole
    tolerance = TIE * (np.abs(whole[0]) + total[0])
    best = int(np.argmax(gain >= gain.max() - tolerance))  # the first: rounding must not choose among equal splits
    return int(allowed[best]) if gain[best] > price else -1


def trees_to_arrays(trees: Mapping[str, Tree]) -> dict[str, NDArray[Any]]:
    """Serialise trees that share their questions, by name; only questions that are asked are stored."""
    questions = next(iter(trees.values())).questions
    asked = np.concatenate([tree.asked for tree in trees.values()])
    used = np.unique(asked[asked >= 0])
    kept = [questions[number] for number in used]
    return {
        "questions": np.array([(str(q.position), q.name, " ".join(sorted(q.members))) for q in kept], np.str_).reshape(
            -1, 3
        ),
        "trees": np.array(list(trees)),
        "sizes": np.array([len(tree.asked) for tree in trees.values()], np.int32),
        "asked": np.where(asked >= 0, np.searchsorted(used, asked), -1).astype(np.int32),
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
        asked, no = stored["asked"][start:end], stored["no"][start:end]
        _check_nodes(asked, no, len(questions))
        trees[name] = Tree(questions, asked, no, stored["frames"][start:end])
    return trees


def _check_nodes(asked: NDArray[np.int32], no: NDArray[np.int32], questions: int) -> None:
    """Raise ValueError unless the nodes are a tree in the order of ``Tree``."""
    inner = asked >= 0
    if (asked >= questions).any() or (asked < -1).any() or (no[~inner] != -1).any():
        raise ValueError("a tree asks a question that does not exist")
    ends = [len(asked)]  # of the subtrees that contain the node
    for node in range(len(asked)):
        if node == ends[-1]:
            ends.pop()
        if inner[node]:
            if not node + 1 < no[node] < ends[-1]:
                raise ValueError("a tree whose branches do not end")
            ends.append(int(no[node]))
        elif node + 1 != ends[-1]:
            raise ValueError("a tree whose branches do not meet")
