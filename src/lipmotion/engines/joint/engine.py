"""The joint engine: one model of five streams, after Hofer 2008."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, final

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.base import Arrays, Engine, Fit
from lipmotion.errors import CorpusError, InputError
from lipmotion.hmm.multistream.align import StatePath, align
from lipmotion.hmm.multistream.arrays import joint_arrays, joint_from_arrays
from lipmotion.hmm.multistream.generate import densities_of_path, densities_of_paths, single_gaussians
from lipmotion.hmm.multistream.inventory import Inventory
from lipmotion.hmm.multistream.labels import units_in_frames, units_in_time
from lipmotion.hmm.multistream.model import JointConfig, JointHmm
from lipmotion.hmm.multistream.recognise import joint_recogniser
from lipmotion.hmm.multistream.streams import MOTION, StreamObservations, StreamWeights, stream_observations
from lipmotion.hmm.multistream.train import TrainingUtterance, train_joint
from lipmotion.motion.arrays import MOTION_ARRAYS, motion_arrays, motion_from_arrays
from lipmotion.motion.closure import Closure, fit_closure
from lipmotion.motion.frame_labels import with_unit_names
from lipmotion.motion.generation import LearnedMotion, Statistics
from lipmotion.motion.limits import MotionLimits, check_poses, limits_of
from lipmotion.motion.space import MotionSpace, fit_reduced_motion
from lipmotion.storage.checkpoint import NO_CHECKPOINT, Checkpoint
from lipmotion.storage.schema import arrays_under, format_errors, refuse_undeclared
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
from lipmotion.units import LIP_CLOSING, UnitSet, unit_set

PREFIX = "joint_"
"""What the names of the joint model's own arrays begin with."""


COUNT = Rule(least=1)


@dataclass(frozen=True)
class JointEngineConfig(Configuration):
    """How the joint engine models speech, F0 and motion.

    units      : what is modelled: a unit set's name, or a table's (docs/unit-sets.md)
    states     : states per unit, left to right, no skips
    mixtures, motion_mixtures : Gaussians per state of speech, and of motion (powers of two)
    components : principal components that all point channels are reduced to
    f0         : model the three streams of F0 (False: their weights are 0 everywhere)
    motion_in_training : give the motion stream weight 1 when states are aligned in training (False: weight 0)
    recognise_units : recognise the model's own units by its own bigram where neither words nor units are given (False:
                 take the phones that the shared recogniser finds). Given units or words always win
    paths      : generate from so many state sequences, sampled from their posterior, instead of the best one, wherever
                 units are recognised; needs ``recognise_units``
    seed       : of the sampling
    closures   : make the lips meet in every p, b and m, and in every recognised unit of these alone
    """

    units: str = "phone"
    states: int = option(3, COUNT)
    mixtures: int = option(4, COUNT)
    motion_mixtures: int = option(1, COUNT)
    components: int = option(16, COUNT)
    f0: bool = True
    motion_in_training: bool = True
    recognise_units: bool = False
    paths: int = option(1, COUNT)
    seed: int = option(0, Rule(least=0))
    closures: bool = True

    former: ClassVar[Mapping[str, str]] = {"sees": "motion_in_training", "recognises": "recognise_units"}

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.paths > 1 and not self.recognise_units:
            raise InputError(
                f"paths is {self.paths}: several are sampled only where units are recognised (recognise_units)"
            )

    def check_files(self) -> None:  # noqa: D102
        unit_set(self.units)

    @property
    def joint(self) -> JointConfig:
        """How the model is built, trained and used."""
        f0 = float(self.f0)
        heard = StreamWeights(f0=f0, f0_slope=f0, f0_curvature=f0, motion=0.0)
        return JointConfig(
            states=self.states,
            mixtures=self.mixtures,
            motion_mixtures=self.motion_mixtures,
            training=StreamWeights(f0=f0, f0_slope=f0, f0_curvature=f0, motion=float(self.motion_in_training)),
            recognition=heard,
        )


@dataclass(frozen=True, eq=False)
class JointModel:
    """A joint model with the space of its motion.

    closure : how the lips close (None: the motion has no opening)
    """

    units: UnitSet
    space: MotionSpace
    hmm: JointHmm
    closure: Closure | None

    @cached_property
    def limits(self) -> MotionLimits:
        """Between which values motion lies."""
        return self.poses.extended(self.hmm.models[MOTION].scale.deviation[: self.space.dimensions])

    @cached_property
    def motion(self) -> LearnedMotion:
        """The end of the path from speech to motion."""
        return LearnedMotion(self.space, self.closure, self.limits)

    @property
    def poses(self) -> MotionLimits:
        """Between which values the means of all states lie."""
        part, Q = self.hmm.models[MOTION], self.space.dimensions
        means = part.tied.mixtures.means[:, :, :Q].reshape(-1, Q)
        return limits_of(means * part.scale.deviation[:Q] + part.scale.mean[:Q])


@final
@dataclass(frozen=True)
class JointEngine(Engine[JointModel]):
    """One model of speech, F0 and motion: recognition or alignment by the heard streams, generation by motion.

    Source: Hofer 2008, §4 and §5.  Deviations: training starts from phones in time (aligned or labelled), not from
    nothing; the trees of what is heard ask for one neighbour, those of motion for both; unless it ``recognises``, the
    phones of sound alone are those of the shared recogniser.
    """

    config: JointEngineConfig
    name: ClassVar[str] = "joint"
    Config: ClassVar[type[Configuration]] = JointEngineConfig

    @property
    def wants_f0(self) -> bool:  # noqa: D102
        return self.config.f0

    def fit(  # noqa: D102
        self,
        examples: Sequence[Example],
        monitor: Monitor,
        checkpoint: Checkpoint = NO_CHECKPOINT,  # noqa: ARG002 - a matter of two minutes
    ) -> Fit[JointModel]:
        units = unit_set(self.config.units)
        space, values = fit_reduced_motion(examples, self.config.components)
        utterances = [self._transcribed(one, x, units) for one, x in zip(examples, values, strict=True)]
        if all(set(utterance.units) <= set(units.silence) for utterance in utterances):
            raise CorpusError(f"nothing is said in {len(examples)} examples; learn from speech")
        inventory = Inventory(units.units, units.silence[:1] + _also_silent(units), self.config.states)
        hmm = train_joint(utterances, inventory, units.classes(), self.config.joint, monitor)
        closure = fit_closure(space.direct_names, values, examples)
        figures = {f"leaves_{name}": float(part.forest.size) for name, part in hmm.models.items()}
        frames = sum(int(example.valid.sum()) for example in examples)
        return Fit(JointModel(units, space, hmm, closure), {"frames": frames, **figures})

    def without_closures(self) -> JointEngine:  # noqa: D102
        return replace(self, config=replace(self.config, closures=False))

    def generate(self, model: JointModel, speech: Speech, constraints: Constraints | None = None) -> Generation:  # noqa: D102
        observed = self._observed(speech)
        if self.config.recognise_units and not speech.units_known:
            spoken, paths = self._recognised(model, observed, speech.features.duration_s)
        else:
            spoken, paths = speech.units, [_aligned(model, observed, speech.units)]
        densities = densities_of_path(model.hmm, paths[0]) if len(paths) == 1 else densities_of_paths(model.hmm, paths)
        means, precisions = single_gaussians(densities)

        def statistics(frames: slice) -> Statistics:
            return means[frames], precisions[frames]

        motion, variance = model.motion.generate(
            statistics,
            len(speech.features.values),
            spoken,
            constraints,
            close=self.config.closures,
            closing_units=model.units.units_within(LIP_CLOSING),
        )
        return Generation(
            motion,
            variance,
            with_unit_names(spoken, model.units),
            StateTrace(_sources(model.hmm, paths[0]), paths[0].frames),
        )

    def describe(self, model: JointModel) -> str:  # noqa: D102
        return model.hmm.text()

    def to_arrays(self, model: JointModel) -> dict[str, NDArray[Any]]:  # noqa: D102
        joint = {f"{PREFIX}{name}": array for name, array in joint_arrays(model.hmm).items()}
        return motion_arrays(model.units, model.space, model.closure) | joint

    def from_arrays(self, arrays: Arrays) -> JointModel:  # noqa: D102
        with format_errors("the joint model"):
            refuse_undeclared(arrays, MOTION_ARRAYS, (name for name in arrays if name.startswith(PREFIX)))
            units, space, closure = motion_from_arrays(arrays, self.config.units)
            hmm = joint_from_arrays(arrays_under(arrays, PREFIX), self.config.joint)
            if set(hmm.inventory.names) != set(units.units):
                raise ValueError(f"the units {' '.join(hmm.inventory.names)}, required {' '.join(units.units)}")
            if MOTION not in hmm.models or len(hmm.models[MOTION].scale.mean) != 3 * space.dimensions:
                raise ValueError(f"motion that is not of {space.dimensions} dimensions")
            model = JointModel(units, space, hmm, closure)
            check_poses(model.poses, space, closure)
            return model

    def _observed(
        self, speech: Speech, motion: NDArray[np.float64] | None = None, seen: NDArray[np.bool_] | None = None
    ) -> StreamObservations:
        f0 = speech.log_f0 if self.config.f0 else None
        return stream_observations(np.asarray(speech.features.values), f0, motion, seen)

    def _transcribed(self, example: Example, values: NDArray[np.float64], units: UnitSet) -> TrainingUtterance:
        observed = self._observed(example.speech, values, example.valid)
        said, bounds = units_in_frames(example.speech.units, observed.frames, units.silence[0], units.unit_of)
        return TrainingUtterance(observed, said, bounds)

    def _recognised(
        self, model: JointModel, observed: StreamObservations, duration_s: float
    ) -> tuple[Timeline[Unit], list[StatePath]]:
        recogniser = joint_recogniser(model.hmm)
        said = recogniser.recognise(observed)
        spoken = units_in_time(said, duration_s, model.units.label)
        if self.config.paths > 1:
            return spoken, recogniser.sampled_paths(observed, self.config.paths, self.config.seed)
        bounds = np.array([*(one.first for one in said), observed.frames])
        return spoken, [align(model.hmm, observed, [one.unit for one in said], bounds)]


def _also_silent(units: UnitSet) -> tuple[str, ...]:
    return tuple(unit for unit in units.silence[1:] if units.silent(unit))


def _aligned(model: JointModel, observed: StreamObservations, units: Timeline[Unit]) -> StatePath:
    said, bounds = units_in_frames(units, observed.frames, model.units.silence[0], model.units.unit_of)
    return align(model.hmm, observed, said, bounds)


def _sources(hmm: JointHmm, path: StatePath) -> tuple[str, ...]:
    """Return what stands behind every state of a path, in words."""
    forest = hmm.models[MOTION].forest
    return tuple(
        f"{left}-{unit}+{right}.{state}: {forest.name(forest.leaf(((left, unit, right), state)))}"
        for (left, unit, right), state in path.states.triphones
    )
