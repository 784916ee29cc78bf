"""The trajectory engine, its options and model: a Gaussian for each tied state, combined with a predictor."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, final

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.base import Engine, Fit, Inputs
from lipmotion.hmm.multistream.phone_recogniser import (
    JOINT_PREFIX,
    OwnPhoneRecogniser,
    recogniser_from_arrays,
    recogniser_to_arrays,
)
from lipmotion.motion.arrays import MOTION_ARRAYS, motion_from_arrays, motion_to_arrays
from lipmotion.motion.articulation import (
    KNOWN_VOICE_SHARE,
    TABLE_WEIGHT_WITH_PREDICTOR,
    ArticulationPrior,
    Statistics,
    count_unseen,
    slice_dynamics,
)
from lipmotion.motion.closure import Closure
from lipmotion.motion.context_window import (
    WINDOW,
    AcousticContext,
    acoustic_context_from_arrays,
    acoustic_context_to_arrays,
)
from lipmotion.motion.frame_labels import (
    FullContextState,
    StateLayout,
    find_digital_silence,
    label_full_context,
    rate_phones,
    with_unit_names,
)
from lipmotion.motion.generation import LearnedMotion, VarianceScaling
from lipmotion.motion.modulation_filter import (
    MODULATION,
    STRENGTH,
    ModulationFilter,
    filter_from_arrays,
    filter_to_arrays,
)
from lipmotion.motion.network_steps import hear_articulators
from lipmotion.motion.predictors import (
    ADDED,
    AUTOMATIC,
    Predictor,
    check_predictor,
    count_conditions,
    list_predictor_arrays,
    predictor_from_arrays,
    predictor_to_arrays,
)
from lipmotion.motion.space import MotionLimits, MotionSpace, check_poses, check_spread, measure_limits
from lipmotion.printable import printable
from lipmotion.stats.trees import TREES, Context, Tree, trees_from_arrays, trees_to_arrays
from lipmotion.storage.archive import NO_CHECKPOINT, Checkpoint
from lipmotion.storage.schema import POSITIVE, Arrays, ArraySpec, check_arrays, format_errors, refuse_undeclared
from lipmotion.types import (
    Configuration,
    Constraints,
    Example,
    Generation,
    Monitor,
    Rule,
    Speech,
    StateTrace,
    Timeline,
    Unit,
    option,
)
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
    ridge, shared_ridge : ridge parameters: of a regression towards that of the parent node, and of the regression that
                 all nodes share towards zero
    ridge_frames : smallest number of frames of a node with a regression of its own
    variance_scaling : scale generated movements to the variance of recorded ones
    closures   : make the lips meet in every p, b and m, whatever their units are
    joint_recogniser : train the joint model as well, where there is enough speech: it recognises the phones of
                 speakers that it was trained on
    conditions : acoustic conditions in which each recording is used in the training of the acoustic network; 0: no
                 network
    epochs     : how often the training of the network uses each recording
    predictor  : name of the predictor beside the states (docs/extend/predictor.md); ``auto``: an acoustic network, or,
                 where the model stands on another one, a regression on what that makes of the speech
    articulation : lean on the table of English articulation in contexts that training saw little of
    units      : name of a unit set, or path of a table of units (docs/unit-sets.md), which training reads
    modulation_filter : how far generated motion is given the modulation spectrum of recorded motion: 0 not at all, 1
                 wholly; more goes beyond it (docs/results/jerk.md)
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
    conditions: int = option(15, Rule(least=0))
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

    @property
    def training_layout(self) -> StateLayout:
        """The states of the unit set that training reads. Raises InputError: no such unit set, or errors in a table."""
        return self.layout(load_unit_set(self.units))


Array = NDArray[np.float64]

MAX_CONTEXTS = 50_000
"""Contexts whose leaves are kept, so that motion is generated again sooner."""


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

    forest     : a decision tree for every state of speech and of silence (``StateLayout.names``)
    means, variances : float32 arrays [shape=(L, 3, Q)], leaf by leaf, tree by tree; the last row is the rest pose
    regression : regression of the means on acoustic features (None: the means are constant)
    """

    forest: Mapping[str, Tree]
    means: NDArray[np.float32]
    variances: NDArray[np.float32]
    regression: AcousticRegression | None

    @cached_property
    def _rows(self) -> dict[tuple[str, int], int]:
        leaves = [(name, leaf) for name, tree in self.forest.items() for leaf in tree.leaves.tolist()]
        return {leaf: row for row, leaf in enumerate(leaves)}

    def row(self, state: FullContextState, layout: StateLayout) -> int:
        """Return the number of the density of a full-context state: its row in ``means``."""
        if state == layout.rest:
            return len(self.means) - 1
        name = layout.name(state)
        return self._rows[name, self._leaf(name, state.context)]

    def _leaf(self, name: str, context: Context) -> int:
        """Return the leaf of a context in a tree; it is looked for once."""
        if (name, context) not in self._leaves:
            if len(self._leaves) > MAX_CONTEXTS:
                self._leaves.clear()
            self._leaves[name, context] = self.forest[name].path(context)[-1]
        return self._leaves[name, context]

    @cached_property
    def _leaves(self) -> dict[tuple[str, Context], int]:
        return {}

    @cached_property
    def _names(self) -> dict[tuple[str, int], str]:
        return {}

    def source(self, state: FullContextState, layout: StateLayout) -> str:
        """Return the origin of the density of a state, in words: its tree, its leaf, and the frames of the leaf."""
        if state == layout.rest:
            return "rest"
        name = layout.name(state)
        leaf = self._leaf(name, state.context)
        if (name, leaf) not in self._names:
            tree = self.forest[name]
            self._names[name, leaf] = f"{tree.name(leaf)} ({tree.frames[leaf]:.0f} frames)"
        left, unit, right = state.context
        return f"{left}-{unit}+{right} {name}: {self._names[name, leaf]}"

    def statistics(self, rows: NDArray[np.intp], features: NDArray[np.float32], frames: slice) -> tuple[Array, Array]:
        """Return means and precisions [each shape=(N, 3, Q)] of N successive frames of densities [shape=(N,)]."""
        means, precisions = self.means[rows].astype(float), 1 / self.variances[rows].astype(float)
        if self.regression is not None:
            add_acoustic_regression(means, self.regression, rows, self.regression.context(features, frames))
        return means, precisions


def add_acoustic_regression(
    means: Array, regression: AcousticRegression, rows: NDArray[np.intp], z: NDArray[np.float32]
) -> None:
    """Add the regressions on reduced features [shape=(N, F)] to constant means [shape=(N, 3, Q)], in place."""
    used = regression.rows[rows]
    for row in np.unique(used[used >= 0]):
        frames = np.nonzero(used == row)[0]
        means[frames] += (z[frames] @ regression.coefficients[row]).reshape(len(frames), *means.shape[1:])


def emission_from_arrays(arrays: Arrays, layout: StateLayout, dimensions: int) -> Emission:
    """Deserialise the densities.

    layout     : the states of phones and silences
    dimensions : of the motion space, Q
    Raises KeyError, ValueError: an array is missing, or has a wrong shape, type or range.
    """
    forest = trees_from_arrays(arrays)
    if len(forest) != layout.speech + layout.silence or list(forest) != layout.names:
        raise ValueError(
            f"trees for {len(forest)} states, required {layout.speech} of speech and {layout.silence} of silence"
        )
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
    return Emission(forest, densities["means"], densities["variances"], regression)


DENSITIES = {"means": ArraySpec(np.float32, "L 3 Q"), "variances": ArraySpec(np.float32, "L 3 Q", POSITIVE)}
REGRESSION = {
    **WINDOW,
    "coefficients": ArraySpec(np.float32, "C A V"),
    "coefficient_rows": ArraySpec(np.int32, "L", -1, 1e6),
}
EMISSION = (*TREES, *DENSITIES, *REGRESSION)
"""Names of the arrays of an emission: L densities, C regressions on A components."""


NETWORK_SHARE = 0.6
"""Weight of the predictor beside the states, 0 to 1, in models that have no other."""
RESTING_SHARE = 0.5
"""Share of its weight that the predictor has where the states rest, with voices that training knows: their mouths open
before they speak."""
UNSEEN_VOICE_LOSS = 0.8
"""Share of their weight that states lose with voices that training does not know at all."""


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
    def limits(self) -> MotionLimits:
        """Limits of plausible motion."""
        return self.poses.extend(np.sqrt(self.emission.variances[:, 0].max(axis=0)))

    @cached_property
    def motion(self) -> LearnedMotion:
        """Motion space, closure, limits and variance scaling, which turn predicted means into motion."""
        scaling = VarianceScaling(self.variance_factors, self.emission.means[-1, 0])
        prior = self.prior
        if prior is not None and self.network is not None:
            weaker = replace(prior, weight=TABLE_WEIGHT_WITH_PREDICTOR, known_voice_share=KNOWN_VOICE_SHARE)
            prior = None if self.network.uses_articulation else weaker
        return LearnedMotion(self.space, self.closure, self.limits, scaling, prior, self.modulation)

    @property
    def poses(self) -> MotionLimits:
        """Smallest and largest means of all states [each shape=(Q,)]."""
        return measure_limits(self.emission.means[:, 0])


VARIANCE_FACTORS = {"gain": ArraySpec(np.float64, "Q", POSITIVE, 10)}
SHARE = {"network_share": ArraySpec(np.float64, "1", 0, 1)}


@final
@dataclass(frozen=True)
class TrajectoryEngine(Engine[TrajectoryModel]):
    """Full-context hidden Markov models of motion, and maximum-likelihood parameter generation from them.

    Source: Hofer 2008, §5.  Deviations: the state of a frame follows from the times of its phone, which are known from
    recognition or forced alignment; means are regressed on the acoustic features around the frame.
    """

    config: TrajectoryConfig
    name: ClassVar[str] = "trajectory"
    Config: ClassVar[type[Configuration]] = TrajectoryConfig

    def inputs(self, motion_s: float = math.inf) -> Inputs:  # noqa: D102
        conditions = count_conditions(self.config.predictor, motion_s, self.config.conditions)
        return Inputs(self.config.joint_recogniser, conditions, prior=True, posteriors=True, encoding=True)

    def fit(  # noqa: D102
        self, examples: Sequence[Example], monitor: Monitor, checkpoint: Checkpoint = NO_CHECKPOINT
    ) -> Fit[TrajectoryModel]:
        from lipmotion.engines.trajectory.trajectory_training import fit_trajectory  # who animates does not train

        model = fit_trajectory(examples, self.config, monitor, checkpoint)
        frames = sum(int(example.valid.sum()) for example in examples)
        uses_prior = model.network is not None and model.network.uses_prior
        return Fit(model, {"frames": frames, "leaves": len(model.emission.means)}, uses_prior)

    def hidden(  # noqa: D102
        self, model: TrajectoryModel, speech: Speech
    ) -> tuple[NDArray[np.float32], NDArray[np.float64]] | None:
        return model.network.hidden(speech) if model.network is not None else None

    def recognise(self, model: TrajectoryModel, speech: Speech) -> Timeline[Unit] | None:  # noqa: D102
        return model.phone_recogniser.phones(speech) if model.phone_recogniser is not None else None

    def generate(self, model: TrajectoryModel, speech: Speech, constraints: Constraints | None = None) -> Generation:  # noqa: D102
        frames = len(speech.features.values)
        layout = self.config.layout(model.units)
        states = label_full_context(speech.units, frames, layout)
        distinct = {state: number for number, state in enumerate(dict.fromkeys(states))}
        path = np.array([distinct[state] for state in states], np.intp)
        rows = np.array([model.emission.row(state, layout) for state in distinct], np.intp)
        densities = rows[path]
        silent = find_digital_silence(np.asarray(speech.features.values), speech.units)
        densities[silent] = len(model.emission.means) - 1
        experts = Experts(model.emission, densities, speech, model.network, model.prior, model.network_share, silent)

        learned = model.motion if self.config.variance_scaling else replace(model.motion, scaling=None)
        motion, variance = learned.for_voice(speech.voice).generate(
            experts.statistics,
            frames,
            speech.units,
            constraints,
            close=self.config.closures,
            reliability=experts.reliability,
            articulators=None if model.prior is None else hear_articulators(speech),
            voice=speech.voice,
        )
        return Generation(
            motion,
            variance,
            with_unit_names(speech.units, model.units),
            StateTrace(tuple(model.emission.source(state, layout) for state in distinct), path),
        )

    def describe(self, model: TrajectoryModel) -> str:  # noqa: D102
        return "\n\n".join(f"{printable(name)}\n{tree.text()}" for name, tree in model.emission.forest.items())

    def to_arrays(self, model: TrajectoryModel) -> dict[str, NDArray[Any]]:  # noqa: D102
        emission, regression = model.emission, model.emission.regression
        arrays = motion_to_arrays(model.units, model.space, model.closure, model.prior)
        arrays |= {"gain": model.variance_factors} | trees_to_arrays(emission.forest)
        arrays |= {"means": emission.means.astype(np.float16), "variances": emission.variances}
        if regression is not None:
            arrays |= acoustic_context_to_arrays(regression.context)
            arrays |= {"coefficients": regression.coefficients.astype(np.float16), "coefficient_rows": regression.rows}
        if model.network is not None:
            arrays |= predictor_to_arrays(model.network) | {"network_share": np.array([model.network_share])}
        if model.phone_recogniser is not None:
            arrays |= recogniser_to_arrays(model.phone_recogniser)
        return arrays | filter_to_arrays(model.modulation)

    def from_arrays(self, arrays: Arrays) -> TrajectoryModel:  # noqa: D102
        with format_errors("the trajectory model"):
            joint = (name for name in arrays if name.startswith(JOINT_PREFIX))
            others = list_predictor_arrays(arrays)
            refuse_undeclared(arrays, MOTION_ARRAYS, EMISSION, VARIANCE_FACTORS, others, SHARE, joint, MODULATION)
            units, space, closure, prior = motion_from_arrays(arrays, self.config.units)
            emission = emission_from_arrays(arrays, self.config.layout(units), space.dimensions)
            factors = check_arrays(arrays, VARIANCE_FACTORS, Q=space.dimensions)["gain"]
            recogniser, network = recogniser_from_arrays(arrays), predictor_from_arrays(arrays, space.dimensions)
            # former models hold no share
            has_share = "network_share" in arrays or any(name.startswith(ADDED) for name in others)
            share = float(check_arrays(arrays, SHARE)["network_share"][0]) if has_share else NETWORK_SHARE
            modulation = filter_from_arrays(arrays, space.dimensions, needed=self.config.modulation_filter > 0)
            model = TrajectoryModel(
                units, space, emission, factors, closure, recogniser, network, prior, share, modulation
            )
            check_poses(model.poses, space, closure)
            return model
