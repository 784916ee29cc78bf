"""Decision trees that tie states in contexts: alike contexts share a density, unseen ones find theirs by questions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.printable import printable
from lipmotion.storage.schema import Arrays, ArraySpec, checked_arrays

Context = tuple[str, ...]
"""What a state depends on, one name a place (left neighbour, unit, right neighbour)."""
Array = NDArray[np.float64]
Likelihood = Callable[[Array], Array]
"""Sufficient statistics [shape=(N, K)], the count of frames first -> log likelihood, each under its own density."""
LEAST_VARIANCE = 1e-12
TIE = 1e-10
"""Questions whose gains differ by less than this share of the log likelihood, or of the frames, split alike."""


class Question(NamedTuple):
    """Whether the name at one place of a context is one of some.

    place : 0 is the left neighbour, 1 the unit, 2 the right neighbour
    """

    position: int
    name: str
    members: frozenset[str]

    def answer(self, context: Context) -> bool:
        """Return whether it is."""
        return context[self.position] in self.members


@dataclass(frozen=True, eq=False)
class Tree:
    """Nodes in the order in which they are met going down the yes-side first; node 0 is the root.

    questions : those that may be asked
    asked     : int array [shape=(N,)], the question of each node; -1 marks a leaf
    no        : int array [shape=(N,)], the node behind the answer no (the one behind yes is the next); -1 at a leaf
    frames    : float array [shape=(N,)], the frames behind each node
    """

    questions: tuple[Question, ...]
    asked: NDArray[np.int32]
    no: NDArray[np.int32]
    frames: NDArray[np.float64]

    def path(self, context: Context) -> list[int]:
        """Return the nodes from the root to the leaf of a context, seen in training or not."""
        nodes = [0]
        while self.asked[nodes[-1]] >= 0:
            node = nodes[-1]
            nodes.append(node + 1 if self.questions[self.asked[node]].answer(context) else int(self.no[node]))
        return nodes

    def path_to(self, node: int) -> list[int]:
        """Return the nodes from the root to a node."""
        nodes = [0]
        while nodes[-1] != node:
            at = nodes[-1]
            nodes.append(at + 1 if node < self.no[at] else int(self.no[at]))
        return nodes

    @property
    def leaves(self) -> NDArray[np.intp]:
        """The nodes that ask nothing."""
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
        """Return the tree for people to read: a line a node, indented by its depth."""
        lines: list[str] = []

        def write(node: int, depth: int, answer: str) -> None:
            asked = self.asked[node]
            question = self.questions[asked] if asked >= 0 else None
            says = f"{POSITIONS[question.position]} is {question.name}?" if question else "leaf"
            lines.append(f"{'  ' * depth}{answer}{says} ({self.frames[node]:.0f} frames)")
            if question:
                write(node + 1, depth + 1, "yes: ")
                write(int(self.no[node]), depth + 1, "no: ")

        write(0, 0, "")
        return "\n".join(map(printable, lines))


POSITIONS = ("left", "unit", "right")
_PLACES = [str(place) for place in range(len(POSITIONS))]
"""As they are stored."""


def gaussian_log_likelihood(statistics: Array, least_variance: float = LEAST_VARIANCE) -> Array:
    """Return the log likelihood of frames under the diagonal Gaussian that fits them best [shape=(N,)].

    statistics     : [shape=(N, 1 + 2·D)]: count, sums, sums of squares
    least_variance : that the Gaussian may have: else a few frames that are alike gain without limit
    """
    count = np.maximum(statistics[:, :1], 1e-12)
    sums, squares = np.split(statistics[:, 1:] / count, 2, axis=1)
    spread = np.maximum(squares - sums * sums, 0.0)
    variance = np.maximum(spread, least_variance)
    likelihood: Array = -0.5 * count[:, 0] * (np.log(2 * np.pi * variance) + spread / variance).sum(axis=1)
    return likelihood


def multispace_log_likelihood(statistics: Array, least_variance: float = LEAST_VARIANCE) -> Array:
    """Return the log likelihood of frames, some without a value, under the density that fits them best [shape=(N,)].

    statistics : [shape=(N, 2 + 2·D)]: count, count of frames with a value, their sums, sums of squares
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
    """Return the tree whose every split gains more likelihood than its description costs.

    contexts   : C different ones
    statistics : [shape=(C, K)], additive, the count of frames first
    parameters : of one density; a split adds as many, at ``factor`` · ½ log(frames) each
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
    """Return the question that gains most, the first of several that gain the same, or -1 where none gains more than
    its price.
    """
    total = statistics.sum(axis=0)
    yes = answers @ statistics
    allowed = np.nonzero((yes[:, 0] >= least) & (total[0] - yes[:, 0] >= least))[0]
    if not len(allowed):
        return -1
    whole = log_likelihood(total[None])
    gain = log_likelihood(yes[allowed]) + log_likelihood(total - yes[allowed]) - whole
    alike = TIE * (np.abs(whole[0]) + total[0])
    best = int(np.argmax(gain >= gain.max() - alike))  # the first: rounding must not choose among equal splits
    return int(allowed[best]) if gain[best] > price else -1


def tree_arrays(trees: Mapping[str, Tree]) -> dict[str, NDArray[Any]]:
    """Return trees that share their questions, by name, as plain arrays, with the questions that are asked."""
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
    """Return the trees again. Raises KeyError, ValueError: something is missing or inconsistent."""
    found = checked_arrays(arrays, TREES)
    questions = tuple(
        Question(_PLACES.index(place), name, frozenset(members.split()))
        for place, name, members in found["questions"].tolist()
    )
    names, sizes, ends = found["trees"].tolist(), found["sizes"], np.cumsum(found["sizes"])
    if ends[-1] != found.sizes["S"] or len(set(names)) < len(names):
        raise ValueError(f"trees of {ends[-1]} nodes with {found.sizes['S']} questions asked, or two of one name")
    trees = {}
    for name, start, end in zip(names, ends - sizes, ends, strict=True):
        asked, no = found["asked"][start:end], found["no"][start:end]
        _check_nodes(asked, no, len(questions))
        trees[name] = Tree(questions, asked, no, found["frames"][start:end])
    return trees


def _check_nodes(asked: NDArray[np.int32], no: NDArray[np.int32], questions: int) -> None:
    """Raise ValueError where the nodes are no tree in the order of ``Tree``."""
    inner = asked >= 0
    if (asked >= questions).any() or (asked < -1).any() or (no[~inner] != -1).any():
        raise ValueError("a tree asks a question that there is not")
    end = [len(asked)]  # where the subtrees that are open end
    for node in range(len(asked)):
        if node == end[-1]:
            end.pop()
        if inner[node]:
            if not node + 1 < no[node] < end[-1]:
                raise ValueError("a tree whose branches do not end")
            end.append(int(no[node]))
        elif node + 1 != end[-1]:
            raise ValueError("a tree whose branches do not meet")
