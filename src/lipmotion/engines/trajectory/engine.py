"""The trajectory engine."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, ClassVar, final

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.base import Arrays, Engine, Fit, Inputs
from lipmotion.engines.trajectory.model import Experts, TrajectoryModel, model_arrays, model_from_arrays
from lipmotion.motion.frame_labels import StateLayout, label_full_context, with_unit_names
from lipmotion.motion.general_motion import hear_articulators
from lipmotion.motion.modulation_filter import STRENGTH
from lipmotion.motion.predictors import AUTOMATIC, check_predictor, count_conditions
from lipmotion.motion.rest import find_digital_silence
from lipmotion.printable import printable
from lipmotion.storage.archive import NO_CHECKPOINT, Checkpoint
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

if TYPE_CHECKING:
    from lipmotion.engines.trajectory.trajectory_training import TrainingOptions

POSITIVE, ODD = Rule(above=0), Rule(least=1, odd=True)


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
    edge_s: float = option(0.08, POSITIVE)
    components: int = option(16, Rule(least=1))
    tree_factor: float = option(0.2, POSITIVE)
    least_frames: float = option(8.0, POSITIVE)
    shrinkage: float = option(10.0, POSITIVE)
    variance_shrinkage: float = option(20.0, POSITIVE)
    acoustic_regression: bool = True
    acoustic_components: int = option(150, Rule(least=1))
    ridge: float = option(2000.0, POSITIVE)
    shared_ridge: float = option(100.0, POSITIVE)
    ridge_frames: float = option(100.0, POSITIVE)
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
    def training(self) -> TrainingOptions:
        """The options of the training. Raises InputError: no such unit set, or a table with errors."""
        from lipmotion.engines.trajectory.trajectory_training import TrainingOptions

        names = {field.name for field in fields(TrainingOptions)} - {"layout"}
        return TrainingOptions(self.layout(load_unit_set(self.units)), **{name: getattr(self, name) for name in names})


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

        model = fit_trajectory(examples, self.config.training, monitor, checkpoint)
        frames = sum(int(example.valid.sum()) for example in examples)
        uses_prior = model.network is not None and model.network.uses_prior
        return Fit(model, {"frames": frames, "leaves": len(model.emission.means)}, uses_prior)

    def hidden(  # noqa: D102
        self, model: TrajectoryModel, speech: Speech
    ) -> tuple[NDArray[np.float32], NDArray[np.float64]] | None:
        return model.network.hidden(speech) if model.network is not None else None

    def recognise(self, model: TrajectoryModel, speech: Speech) -> Timeline[Unit] | None:  # noqa: D102
        return model.phone_recogniser.phones(speech) if model.phone_recogniser is not None else None

    def without_closures(self) -> TrajectoryEngine:  # noqa: D102
        return replace(self, config=replace(self.config, closures=False))

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
        return model_arrays(model)

    def from_arrays(self, arrays: Arrays) -> TrajectoryModel:  # noqa: D102
        filtered = self.config.modulation_filter > 0
        return model_from_arrays(arrays, self.config.layout, self.config.units, filtered=filtered)
