"""The joint model: a tied hidden Markov model of several streams, and the trees that tie its states."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.hmm.multistream.densities import (
    F0_STREAMS,
    MIN_SCALE,
    MOTION,
    SPEECH,
    STREAMS,
    GaussianStatistics,
    StreamObservations,
    StreamScale,
    StreamWeights,
    TiedDensities,
)
from lipmotion.hmm.multistream.unit_states import Inventory, TriphoneState
from lipmotion.printable import printable
from lipmotion.stats.bigram import BIGRAM, Bigram, bigram_from_array
from lipmotion.stats.mixture import MIXTURES, mixtures_from_arrays
from lipmotion.stats.trees import (
    TREES,
    Context,
    Question,
    Tree,
    grow_tree,
    score_gaussian,
    score_multispace,
    trees_from_arrays,
    trees_to_arrays,
)
from lipmotion.storage.schema import (
    BELOW_ONE,
    NEGATIVE,
    POSITIVE,
    Arrays,
    ArraySpec,
    check_arrays,
    format_errors,
    refuse_undeclared,
    select_arrays,
)


@dataclass(frozen=True, eq=False)
class Forest:
    """Trees by the names of ``Inventory.trees``; their leaves are numbered consecutively, tree after tree."""

    inventory: Inventory
    trees: Mapping[str, Tree]

    @cached_property
    def _first_leaf(self) -> dict[str, int]:
        ends = np.cumsum([0, *(len(tree.leaves) for tree in self.trees.values())])
        return dict(zip(self.trees, ends.tolist(), strict=False))

    @property
    def size(self) -> int:
        """The number of leaves."""
        return sum(len(tree.leaves) for tree in self.trees.values())

    def leaf(self, state: TriphoneState) -> int:
        """Return the leaf of a state in context, whether or not the context occurred in training."""
        context, position = state
        name = self.inventory.tree(context[1], position)
        return self._first_leaf[name] + self.trees[name].rank(context)

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
            if tree.splits[node] < 0:
                leaves[np.ix_(left, right)] = numbers[node]
                return
            position, _, members = tree.questions[tree.splits[node]]
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


def build_unit_forest(inventory: Inventory, spoken: Sequence[str]) -> Forest:
    """Return trees with one leaf for each unit in ``spoken``, and one for all other units together."""
    questions = tuple(Question(1, unit, frozenset([unit])) for unit in inventory.names)
    number = {unit: i for i, unit in enumerate(inventory.names)}
    trees = {}
    for name, (unit, _) in inventory.trees.items():
        order = [] if unit else [number[spoken_unit] for spoken_unit in spoken if spoken_unit not in inventory.free]
        nodes = 2 * len(order) + 1
        splits, no = np.full((2, nodes), -1, np.int32)
        splits[:-1:2], no[:-1:2] = order, np.arange(2, nodes, 2)  # one after another, until a yes
        trees[name] = Tree(questions, splits, no, np.zeros(nodes))
    return Forest(inventory, trees)


def list_context_questions(inventory: Inventory, classes: Mapping[str, frozenset[str]]) -> tuple[Question, ...]:
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
class JointConfig:
    """How a joint model is built, trained and used.

    states       : states per unit, left to right, no skips
    mixtures, motion_mixtures : most Gaussians per state of speech, and of motion (powers of two)
    plain_iterations, iterations : embedded Baum–Welch iterations without context, and in every later stage
    both_neighbours : trees of speech and F0 ask about both neighbours in every state, not about one
    tree_factor  : price of a leaf, in units of its description length
    least_frames : frames that a leaf must have
    variance_floor : least variance, as a share of a dimension's overall variance
    bigram_weight, insertion : scale of the log bigram, and log insertion penalty of every unit, in recognition
    training, recognition : weights of the streams in each
    """

    states: int = 3
    mixtures: int = 16
    motion_mixtures: int = 1
    plain_iterations: int = 6
    iterations: int = 4
    both_neighbours: bool = False
    tree_factor: float = 1.0
    least_frames: float = 30.0
    variance_floor: float = 0.02
    bigram_weight: float = 4.0
    insertion: float = -4.0
    training: StreamWeights = field(default=StreamWeights())
    recognition: StreamWeights = field(default=StreamWeights(motion=0.0))


def grow_forest(
    stream: str,
    inventory: Inventory,
    questions: tuple[Question, ...],
    triphones: Sequence[TriphoneState],
    statistics: GaussianStatistics,
    *,
    has_spaces: bool,
    config: JointConfig,
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
    likelihood = score_multispace if has_spaces else score_gaussian
    names = np.array([inventory.tree(context[1], state) for context, state in triphones])
    trees = {}
    for name, (unit, state) in inventory.trees.items():
        positions = choose_positions(stream, inventory, unit, state, both_neighbours=config.both_neighbours)
        in_tree = np.flatnonzero(names == name)
        index: dict[Context, int] = {}  # contexts reduced to the positions asked about
        contexts = (enumerate(triphones[i][0]) for i in in_tree.tolist())
        keys = (tuple(part if place in positions else "" for place, part in context) for context in contexts)
        groups = [index.setdefault(key, len(index)) for key in keys]
        pooled = np.zeros((max(len(index), 1), values.shape[1]))
        np.add.at(pooled, np.array(groups, np.intp), values[in_tree])
        trees[name] = grow_tree(
            list(index) or [("", "", "")],
            pooled,
            [q if q.position in positions else q._replace(members=frozenset()) for q in questions],  # always no
            partial(likelihood, min_variance=config.variance_floor),
            parameters=values.shape[1] - 1,
            factor=config.tree_factor,
            min_frames=config.least_frames,
        )
    return Forest(inventory, {name: replace(tree, questions=questions) for name, tree in trees.items()})


@dataclass(frozen=True, eq=False)
class StreamModel:
    """The model of one stream: its scale, the trees that tie its states, and the densities of their leaves."""

    scale: StreamScale
    forest: Forest
    tied: TiedDensities


@dataclass(frozen=True, eq=False)
class JointHmm:
    """Models of all units, in several streams that share their transitions.

    log_stay  : [shape=(R,)], log P(stay in the state) of every state without context (``Inventory.monophones``)
    spoken    : the units that occurred in training: those that recognition searches
    """

    config: JointConfig
    inventory: Inventory
    models: Mapping[str, StreamModel]
    log_stay: NDArray[np.float64]
    spoken: tuple[str, ...]
    bigram: Bigram

    def standardise(self, observed: StreamObservations, weights: StreamWeights) -> dict[str, NDArray[np.float32]]:
        """Return the active streams, standardised. Raises InputError: none is there, or one has other dimensions."""
        active = [name for name in weights.active if name in observed.streams and name in self.models]
        if not active:
            raise InputError(
                f"switched on are {', '.join(weights.active) or 'no streams'}; "
                f"of the model's {', '.join(self.models)} were observed {', '.join(observed.streams)}"
            )
        for name in active:
            observed_size, required = observed.streams[name].values.shape[1], len(self.models[name].scale.mean)
            if observed_size != required:
                raise InputError(f"the stream {name} has {observed_size} dimensions, the model's has {required}")
        return {name: self.models[name].scale.standardise(observed.streams[name]) for name in active}

    def leaves(self, triphones: Sequence[TriphoneState]) -> dict[str, NDArray[np.intp]]:
        """Return the leaves of states in context, by stream [shape=(S,)]."""
        return {name: model.forest.leaves(triphones) for name, model in self.models.items()}

    def log_density(
        self, streams: Mapping[str, NDArray[np.float32]], leaves: Mapping[str, NDArray[np.intp]], weights: StreamWeights
    ) -> NDArray[np.float64]:
        """Return the weighted sum of the log densities of S states [shape=(T, S)], of standardised streams."""
        total = np.zeros((1, 1))
        for name, rows in streams.items():
            model = self.models[name]
            values = model.tied.log_density(rows, leaves[name], model.scale.log_determinant)
            total = total + weights.active[name] * values.astype(float)
        return total

    @property
    def log_move(self) -> NDArray[np.float64]:
        """Log P(leave the state) of every state without context [shape=(R,)]."""
        return np.log(-np.expm1(self.log_stay))

    def text(self) -> str:
        """Return the trees of all streams as readable text."""
        forests = ((printable(name), model.forest) for name, model in self.models.items())
        return "\n\n".join(f"{name}: {forest.size} leaves\n{forest.text()}" for name, forest in forests)


NAMES = {
    "units": ArraySpec(np.str_, "U"),
    "free": ArraySpec(np.str_, "F"),
    "spoken": ArraySpec(np.int8, "U", 0, 1),
    "streams": ArraySpec(np.str_, "S"),
}
TIMES = {**BIGRAM, "log_stay": ArraySpec(np.float64, "R", -1e4, NEGATIVE)}
MIN_STORED_SCALE = MIN_SCALE / 10
"""Below ``MIN_SCALE``, for rounding to half precision; squares of values divided by less overflow in float32."""
STREAM = {
    **MIXTURES,
    "mean": ArraySpec(np.float64, "D", -1e6, 1e6),
    "deviation": ArraySpec(np.float64, "D", MIN_STORED_SCALE, 1e6),
}
VOICED = {"voiced": ArraySpec(np.float64, "G", POSITIVE, BELOW_ONE)}
"""How a model (``NAMES``, ``TIMES``) and each of its streams (``STREAM``, ``VOICED``) are stored; R states have no
context."""


def joint_to_arrays(hmm: JointHmm, precision: type[np.floating[Any]] = np.float16) -> dict[str, NDArray[Any]]:
    """Serialise a model; its configuration is not included."""
    arrays: dict[str, NDArray[Any]] = {
        "units": np.array(hmm.inventory.names),
        "free": np.array(hmm.inventory.free),
        "spoken": np.isin(hmm.inventory.names, hmm.spoken).astype(np.int8),
        "streams": np.array(list(hmm.models)),
        "log_stay": hmm.log_stay,
        "bigram": hmm.bigram.log_probability,
    }
    for name, model in hmm.models.items():
        of_stream: dict[str, NDArray[Any]] = {
            "mean": model.scale.mean,
            "deviation": model.scale.deviation,
            "log_weights": model.tied.mixtures.log_weights,
            "means": model.tied.mixtures.means.astype(precision),
            "variances": model.tied.mixtures.variances.astype(precision),
            **trees_to_arrays(model.forest.trees),
        }
        if model.tied.voiced is not None:
            of_stream["voiced"] = model.tied.voiced
        arrays |= {f"{name}/{key}": array for key, array in of_stream.items()}
    return arrays


def joint_from_arrays(arrays: Arrays, config: JointConfig) -> JointHmm:
    """Deserialise a model. Raises ModelFormatError: an array is missing, undeclared, inconsistent or out of range."""
    with format_errors("the joint model"):
        named = check_arrays(arrays, NAMES)
        units, free, streams = (tuple(named[key].tolist()) for key in ("units", "free", "streams"))
        of_streams = (name for name in arrays if name.partition("/")[0] in streams and "/" in name)
        refuse_undeclared(arrays, NAMES, TIMES, ["durations"], of_streams)  # which earlier files have
        if config.states > arrays["log_stay"].size:
            raise ValueError(f"{config.states} states a unit, of {arrays['log_stay'].size} in all")
        inventory = Inventory(units, free, config.states)
        spoken = tuple(unit for unit, occurred in zip(units, named["spoken"], strict=True) if occurred)
        if inventory.silence not in spoken:
            raise ValueError("silence did not occur in training")
        if SPEECH not in streams or not set(streams) <= set(STREAMS) or len(set(streams)) < len(streams):
            raise ValueError(f"streams {streams}")
        stored = check_arrays(arrays, TIMES, U=len(units), R=len(inventory.monophones))
        models = {name: _restore_stream(name, select_arrays(arrays, f"{name}/"), inventory) for name in streams}
        bigram = bigram_from_array(units, stored["bigram"])
        return JointHmm(config, inventory, models, stored["log_stay"], spoken, bigram)


def _restore_stream(name: str, arrays: Arrays, inventory: Inventory) -> StreamModel:
    try:
        table = STREAM | VOICED if name in F0_STREAMS else STREAM
        refuse_undeclared(arrays, TREES, table)
        forest = Forest(inventory, trees_from_arrays(arrays))
        if list(forest.trees) != list(inventory.trees):
            raise ValueError(f"trees {' '.join(forest.trees)}, required {' '.join(inventory.trees)}")
        stored = check_arrays(arrays, table, G=forest.size)
        if name == MOTION and stored.sizes["D"] % 3:
            raise ValueError(f"{stored.sizes['D']} dimensions")
        tied = TiedDensities(mixtures_from_arrays(stored), stored.arrays.get("voiced"))
        return StreamModel(StreamScale(stored["mean"], stored["deviation"]), forest, tied)
    except (KeyError, ValueError) as error:
        raise ValueError(f"{name}: {error}") from error
