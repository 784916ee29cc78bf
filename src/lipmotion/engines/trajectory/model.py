"""The trajectory engine's options and model: a Gaussian for each tied state, combined with a predictor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from lipmotion.hmm.multistream.phone_recogniser import OwnPhoneRecogniser
from lipmotion.motion.articulation import (
    KNOWN_VOICE_SHARE,
    TABLE_WEIGHT_WITH_PREDICTOR,
    ArticulationPrior,
    Statistics,
    count_unseen,
    slice_dynamics,
)
from lipmotion.motion.closure import Closure
from lipmotion.motion.context_window import WINDOW, AcousticContext, acoustic_context_from_arrays
from lipmotion.motion.frame_labels import FullContextState, StateLayout, rate_phones
from lipmotion.motion.generation import LearnedMotion, VarianceScaling
from lipmotion.motion.modulation_filter import STRENGTH, ModulationFilter
from lipmotion.motion.predictors import AUTOMATIC, Predictor, check_predictor
from lipmotion.motion.space import MotionLimits, MotionSpace, check_spread, measure_limits
from lipmotion.stats.trees import TREES, Tree, trees_from_arrays
from lipmotion.storage.schema import POSITIVE, Arrays, ArraySpec, check_arrays
from lipmotion.types import Configuration, Rule, Speech, option
from lipmotion.units import UnitSet, load_unit_set

ABOVE_ZERO, ODD = Rule(above=0), Rule(least=1, odd=True)


@dataclass(frozen=True)
class TrajectoryConfig(Configuration):
    """Options of the trajectory engine; defaults were chosen on the validation list (docs/decisions/motion.md).

    states, silent_states : states of a phone, and of a silence; odd numbers
    edge_s     : longest duration of a state before or after the middle one, seconds
    components : principal components that all point channels are reduced to
    tree_factor : gain that a split of a decision tree must have, in units of its description length
    least_frames : smallest number of frames of a leaf of a tree
    shrinkage, variance_shrinkage : weights, in frames, of the mean and of the variance of the parent node
    acoustic_regression : regress the means on the acoustic features around the frame (False: plain Gaussians)
    acoustic_components : principal components that the acoustic features around a frame are reduced to
    ridge, shared_ridge : ridge parameters: of a node's regression towards its parent's, of the one of all towards zero
    ridge_frames : smallest number of frames of a node with a regression of its own
    variance_scaling : scale generated movements to the variance of recorded ones
    closures   : make the lips meet in every p, b and m, whatever their units are
    joint_recogniser : train the joint model as well, where there is enough speech: it recognises phones of its speakers
    conditions : acoustic conditions in which the acoustic network is trained on each recording; 0: no network
    epochs     : how often the training of the network uses each recording
    predictor  : name of the predictor beside the states (docs/extend/predictor.md); ``auto``: an acoustic network, or,
                 where the model stands on another one, a regression on what that makes of the speech
    articulation : lean on the table of English articulation in contexts that training saw little of
    units      : name of a unit set, or path of a table of units (docs/unit-sets.md), which training reads
    modulation_filter : how far motion gets the modulation spectrum of recordings, 0 to 1 or more (docs/results/jerk.md)
    """

    states: int = option(5, ODD)
    silent_states: int = option(13, ODD)
    edge_s: float = option(0.08, ABOVE_ZERO)
    components: int = option(16, Rule(least=1))
    tree_factor: float = option(0.2, ABOVE_ZERO)
    least_frames: float = option(8.0, ABOVE_ZERO)
    shrinkage: float = option(10.0, ABOVE_ZERO)
    variance_shrinkage: float = option(20.0, ABOVE_ZERO)
    acoustic_regression: bool = True
    acoustic_components: int = option(150, Rule(least=1))
    ridge: float = option(2000.0, ABOVE_ZERO)
    shared_ridge: float = option(100.0, ABOVE_ZERO)
    ridge_frames: float = option(100.0, ABOVE_ZERO)
    variance_scaling: bool = True
    closures: bool = True
    joint_recogniser: bool = True
    conditions: int = option(8, Rule(least=0))
    epochs: int = option(100, Rule(least=1))
    articulation: bool = True
    units: str = "phone"
    predictor: str = option(AUTOMATIC, omit_default=True)
    modulation_filter: float = option(1.0, STRENGTH)

    aliases: ClassVar[Mapping[str, str]] = {
        "parts": "states",
        "silent_parts": "silent_states",
        "listens": "acoustic_regression",
        "axes": "acoustic_components",
        "full_range": "variance_scaling",
        "joint": "joint_recogniser",
    }
    removed: ClassVar[Mapping[str, Any]] = {"trajectory_steps": 0}
    default_if_missing: ClassVar[Mapping[str, Any]] = {"modulation_filter": 0.0}

    def check_files(self) -> None:  # noqa: D102
        load_unit_set(self.units)
        check_predictor(self.predictor)

    def layout(self, units: UnitSet) -> StateLayout:
        """Return the states of phones and silences, for a unit set."""
        return StateLayout(self.states, self.silent_states, self.edge_s, units)


Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class AcousticRegression:
    """Linear regressions of the means of motion on the acoustic features around a frame.

    context      : reduces the features around a frame to F numbers
    coefficients : float32 array [shape=(R, F, 3·Q)], of R regressions
    rows         : int array [shape=(L,)], number of the regression of each density; -1: its mean is constant
    """

    context: AcousticContext
    coefficients: NDArray[np.float32]
    rows: NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Emission:
    """Densities of static value, Δ and Δ² (Q dimensions each) of all tied states.

    layout     : the states of phones and silences
    forest     : a decision tree for every state of speech and of silence (``StateLayout.names``)
    means, variances : float32 arrays [shape=(L, 3, Q)], leaf by leaf, tree by tree; the last row is the rest pose
    regression : regression of the means on acoustic features (None: the means are constant)
    """

    layout: StateLayout
    forest: Mapping[str, Tree]
    means: NDArray[np.float32]
    variances: NDArray[np.float32]
    regression: AcousticRegression | None

    @cached_property
    def _first_rows(self) -> dict[str, int]:
        ends = np.cumsum([0, *(len(tree.leaves) for tree in self.forest.values())])
        return dict(zip(self.forest, ends.tolist(), strict=False))

    def row(self, state: FullContextState) -> int:
        """Return the number of the density of a full-context state: its row in ``means``."""
        if state == self.layout.rest:
            return len(self.means) - 1
        name = self.layout.name(state)
        return self._first_rows[name] + self.forest[name].rank(state.context)

    def rows(self, states: Sequence[FullContextState]) -> NDArray[np.intp]:
        """Return the number of the density of each state [shape=(len(states),)]."""
        distinct = {state: self.row(state) for state in dict.fromkeys(states)}
        return np.array([distinct[state] for state in states], np.intp)

    def source(self, state: FullContextState) -> str:
        """Return the origin of the density of a state, in words: its tree, its leaf, and the frames of the leaf."""
        if state == self.layout.rest:
            return "rest"
        name, (left, unit, right) = self.layout.name(state), state.context
        tree = self.forest[name]
        leaf = int(tree.leaves[tree.rank(state.context)])
        return f"{left}-{unit}+{right} {name}: {tree.name(leaf)} ({tree.frames[leaf]:.0f} frames)"

    def statistics(
        self, rows: NDArray[np.intp], features: NDArray[np.float32], frames: slice | NDArray[np.intp]
    ) -> tuple[Array, Array]:
        """Return means and precisions [each shape=(N, 3, Q)] of N of the frames, of densities [shape=(N,)]."""
        means, precisions = self.means[rows].astype(float), 1 / self.variances[rows].astype(float)
        if self.regression is not None:
            z, used = self.regression.context(features, frames), self.regression.rows[rows]
            for row in np.unique(used[used >= 0]):
                places = np.nonzero(used == row)[0]
                means[places] += (z[places] @ self.regression.coefficients[row]).reshape(len(places), *means.shape[1:])
        return means, precisions


def emission_from_arrays(arrays: Arrays, layout: StateLayout, dimensions: int) -> Emission:
    """Deserialise the densities.

    layout     : the states of phones and silences
    dimensions : of the motion space, Q
    Raises KeyError, ValueError: an array is missing, or has a wrong shape, type or range.
    """
    forest = trees_from_arrays(arrays)
    if len(forest) != layout.speech + layout.silence or list(forest) != layout.names:
        raise ValueError(f"trees for {len(forest)} states, required {layout.speech} and {layout.silence} of silence")
    leaves = sum(len(tree.leaves) for tree in forest.values()) + 1
    densities = check_arrays(arrays, DENSITIES, L=leaves, Q=dimensions)
    check_spread(densities["means"][:, 0], densities["variances"][:, 0])
    regression = None
    if REGRESSION.keys() & arrays.keys():
        stored = check_arrays(arrays, REGRESSION, L=leaves, V=3 * dimensions)
        rows = stored["coefficient_rows"]
        if rows.max() >= stored.sizes["C"]:
            raise ValueError(f"a density that uses regression {rows.max()} of {stored.sizes['C']}")
        regression = AcousticRegression(acoustic_context_from_arrays(stored), stored["coefficients"], rows)
    return Emission(layout, forest, densities["means"], densities["variances"], regression)


DENSITIES = {"means": ArraySpec(np.float32, "L 3 Q"), "variances": ArraySpec(np.float32, "L 3 Q", POSITIVE)}
REGRESSION = {
    **WINDOW,
    "coefficients": ArraySpec(np.float32, "C A V"),
    "coefficient_rows": ArraySpec(np.int32, "L", -1, 1e6),
}
EMISSION = (*TREES, *DENSITIES, *REGRESSION)
"""Names of the arrays of an emission: L densities, C regressions on A components."""


NETWORK_SHARE = 0.6  # weight of the predictor beside the states, 0 to 1, in models that have no other
RESTING_SHARE = 0.5
"""Share of its weight that the predictor has where the states rest, with voices that training knows: their mouths open
before they speak."""
UNSEEN_VOICE_LOSS = 0.8  # share of their weight that states lose with voices that training does not know at all


@dataclass(frozen=True, eq=False)
class Experts:
    """The states and the predictor on one recording.

    emission, rows : densities, and the one of each frame [shape=(T,)]; the last density is that of the rest pose
    network        : predicts motion without the states (None: there was too little speech to train it)
    network_share  : weight of that predictor, 0 to 1, in contexts that training knows well
    prior          : says how well training knows a phone in its context (None: taken as well known)
    silent         : frames of digital silence, in which states count alone [shape=(T,)] (None: there are none)
    """

    emission: Emission
    rows: NDArray[np.intp]
    speech: Speech
    network: Predictor | None
    prior: ArticulationPrior | None
    network_share: float = NETWORK_SHARE
    silent: NDArray[np.bool_] | None = None

    def statistics(self, frames: slice) -> Statistics:
        """Return means and precisions of a range of N frames [each shape=(N, 3, Q)]: weighted means of both."""
        means, precisions = self.emission.statistics(self.rows[frames], np.asarray(self.speech.features.values), frames)
        if self.network is None or self._predicted is None:
            return means, precisions
        share = self._share[frames, None, None]
        means += share * (slice_dynamics(self._predicted[0], frames) - means)
        precisions += share * (1 / self.network.variances - precisions)
        return means, precisions

    @cached_property
    def reliability(self) -> Array:
        """How far the phones in time can be relied on, 0 to 1 [shape=(T,)]."""
        return rate_phones(self.speech, None if self._predicted is None else self._predicted[1], len(self.rows))

    @cached_property
    def _predicted(self) -> tuple[Array, Array] | None:
        """Motion [shape=(T, Q)] and distortion [shape=(T,)] by the predictor."""
        if self.network is None or not self.network.can_predict(self.speech):
            return None
        return self.network.predict(self.speech)

    @cached_property
    def _share(self) -> Array:
        """The share of the predictor in every frame, 0 to 1 [shape=(T,)]."""
        familiarity = np.ones(len(self.rows))
        if self.prior is not None and not (self.network is not None and self.network.uses_articulation):
            familiarity = self.prior.familiarity(self.speech.units, len(self.rows))
        resting = self.rows == len(self.emission.means) - 1
        personal = self.network is not None and self.network.uses_prior  # states of a person, not a distant speaker
        unseen = count_unseen(self.speech.voice)
        known = 1.0 if personal else 1 - UNSEEN_VOICE_LOSS * unseen
        states = (1 - self.network_share) * self.reliability * familiarity * known
        at_rest = np.maximum(1 - self.reliability, 0.0 if personal else RESTING_SHARE * (1 - unseen))
        if self.silent is not None:
            at_rest[self.silent] = 0
        network = self.network_share * np.where(resting, at_rest, 1.0)
        return network / np.maximum(states + network, 1e-12)


@dataclass(frozen=True, eq=False)
class TrajectoryModel:
    """Full-context hidden Markov models of motion.

    space    : the Q dimensions in which motion is modelled
    variance_factors : factors of variance scaling about the rest pose [shape=(Q,)]
    closure  : of the lips in p, b and m (None: the motion has no channel ``opening``)
    phone_recogniser : recognises the phones of speakers that it was trained on (None: there was too little speech)
    network  : predicts motion without the states (None: there was too little speech, and no other model)
    network_share : weight of this predictor, 0 to 1, beside the states in contexts that training knows well
    prior    : the table of articulation in the speaker's range (None: it is not used)
    modulation : restores fast movement (None: the motion stays as it is)
    """

    units: UnitSet
    space: MotionSpace
    emission: Emission
    variance_factors: NDArray[np.float64]
    closure: Closure | None
    phone_recogniser: OwnPhoneRecogniser | None = None
    network: Predictor | None = None
    prior: ArticulationPrior | None = None
    network_share: float = NETWORK_SHARE
    modulation: ModulationFilter | None = None

    def __repr__(self) -> str:
        states = f"{len(self.emission.means)} tied states"
        return f"TrajectoryModel({self.units.name} units, {states}, {self.space.dimensions} dimensions)"

    @cached_property
    def motion(self) -> LearnedMotion:
        """Motion space, closure, limits and variance scaling, which turn predicted means into motion."""
        scaling = VarianceScaling(self.variance_factors, self.emission.means[-1, 0])
        limits, prior = self.poses.extend(np.sqrt(self.emission.variances[:, 0].max(axis=0))), self.prior
        if prior is not None and self.network is not None:
            weaker = replace(prior, weight=TABLE_WEIGHT_WITH_PREDICTOR, known_voice_share=KNOWN_VOICE_SHARE)
            prior = None if self.network.uses_articulation else weaker
        return LearnedMotion(self.space, self.closure, limits, scaling, prior, self.modulation)

    @property
    def poses(self) -> MotionLimits:
        """Smallest and largest means of all states [each shape=(Q,)]."""
        return measure_limits(self.emission.means[:, 0])


VARIANCE_FACTORS = {"gain": ArraySpec(np.float64, "Q", POSITIVE, 10)}
SHARE = {"network_share": ArraySpec(np.float64, "1", 0, 1)}
